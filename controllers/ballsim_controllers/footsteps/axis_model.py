"""Model of one horizontal axis over the cells of a preview."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import STATE_SIZE
from ballsim_controllers.messages import Array

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
    n = len(is_double)
    cells = [model.double if double else model.single for double in is_double]
    from_state = np.empty((n + 1, STATE_SIZE, STATE_SIZE))
    from_input = np.zeros((n + 1, STATE_SIZE, n))
    from_state[0] = np.eye(STATE_SIZE)
    for k, cell in enumerate(cells):
        closed = cell.transition - np.outer(cell.input, cell.gain)
        from_state[k + 1] = closed @ from_state[k]
        from_input[k + 1] = closed @ from_input[k]
        from_input[k + 1][:, k] = cell.input
    gains = np.array([cell.gain for cell in cells])
    return Prediction(
        state_from_state=from_state,
        state_from_input=from_input,
        command_from_state=-np.einsum("ki,kij->kj", gains, from_state[:n]),
        command_from_input=np.eye(n) - np.einsum("ki,kij->kj", gains, from_input[:n]),
        gains=gains,
    )
