"""Model of one horizontal axis over the cells of a preview."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Array, IntArray

__all__ = ["AxisModel", "CellModel", "Prediction", "predict"]


@dataclass(frozen=True, slots=True)
class CellModel:
    """Discrete model of one axis over one cell, with its feedback.

    Attributes:
        transition: State matrix over the cell, shape (7, 7).
        input: Effect of the commanded CoP, shape (7,).
        gain: Feedback K of the ideal CoP, shape (7,).
    """

    transition: Array
    input: Array
    gain: Array


@dataclass(frozen=True, slots=True)
class AxisModel:
    """Model of one axis: the legs weigh differently in single and double support.

    Attributes:
        double: Both feet stand.
        single: One foot swings.
    """

    double: CellModel
    single: CellModel


@dataclass(frozen=True, slots=True)
class Prediction:
    """Motion over N cells under the feedback, ``u_k = r_k - K_k z_k``.

    Attributes:
        state_from_state: z_k by z_0, shape (N + 1, 7, 7).
        state_from_input: z_k by r, shape (N + 1, 7, N).
        command_from_state: u_k by z_0, shape (N, 7).
        command_from_input: u_k by r, shape (N, N).
        gains: K_k, shape (N, 7).
    """

    state_from_state: Array
    state_from_input: Array
    command_from_state: Array
    command_from_input: Array
    gains: Array


def predict(model: AxisModel, is_double: Sequence[bool]) -> Prediction:
    """Return the prediction for a sequence of supports.

    Args:
        model: Model and feedback of the axis.
        is_double: Whether both feet stand, per cell.
    """
    models = (model.single, model.double)
    gains = np.array([models[double].gain for double in is_double])
    return Prediction(
        *_predict(
            np.array(is_double, dtype=np.int_),
            np.array([cell.transition for cell in models]),
            np.array([cell.input for cell in models]),
            np.array([cell.gain for cell in models]),
        ),
        gains,
    )


@compiled
def _predict(
    supports: IntArray, transitions: Array, inputs: Array, gains: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the fields of a `Prediction`, but for the gains.

    Args:
        supports: Kind of support of each cell, shape (N,).
        transitions: Per kind of support, shape (2, 7, 7).
        inputs: Per kind of support, shape (2, 7).
        gains: Per kind of support, shape (2, 7).
    """
    n, size = len(supports), inputs.shape[1]
    states = np.zeros((n + 1, size, size))
    driven = np.zeros((n + 1, size, n))
    commands = np.zeros((n, size))
    commanded = np.zeros((n, n))
    for i in range(size):
        states[0, i, i] = 1.0
    for k in range(n):
        kind = supports[k]
        for i in range(size):
            for j in range(size):
                commands[k, j] -= gains[kind, i] * states[k, i, j]
            for j in range(k):
                commanded[k, j] -= gains[kind, i] * driven[k, i, j]
        commanded[k, k] = 1.0
        for i in range(size):
            for m in range(size):
                closed = transitions[kind, i, m] - inputs[kind, i] * gains[kind, m]
                for j in range(size):
                    states[k + 1, i, j] += closed * states[k, m, j]
                for j in range(k):
                    driven[k + 1, i, j] += closed * driven[k, m, j]
            driven[k + 1, i, k] = inputs[kind, i]
    return states, driven, commands, commanded
