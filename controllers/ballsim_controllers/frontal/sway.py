"""Periodic lateral sway of the wheeled LIP under alternating support.

The paper treats the sagittal plane only. In the frontal plane the CoP must
change from foot to foot; the antisymmetric periodic motion of the model under
that CoP is the reference about which the frontal plane is balanced.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.footsteps.preview import AxisModel
from ballsim_controllers.messages import Array

__all__ = ["SwayReference", "compute_sway"]

_BALL = 2


@dataclass(frozen=True, slots=True)
class SwayReference:
    """One half cycle: double support after the left foot landed, left support.

    The other half is the mirror image.

    Attributes:
        states: State (y, y', b, b', p) at the start of each cell, shape (n, 5).
        inputs: Commanded CoP of each cell, shape (n,), [m].
        double_cells: Cells of double support at the start of the half cycle.
    """

    states: Array
    inputs: Array
    double_cells: int


def compute_sway(
    model: AxisModel, landing_offset: float, double_cells: int, single_cells: int
) -> SwayReference:
    """Return the antisymmetric periodic motion for a step in place.

    Each foot lands at ``+-landing_offset`` from the ball's centre and is then
    carried by the ball. The CoP passes linearly from foot to foot during
    double support and stays at the foot's centre during single support. Both
    are affine in the initial state z0, and so is the whole half cycle; z0
    follows from ``z(half cycle) = -z0``.

    Args:
        model: Discrete model of the axis (its gain is not used).
        landing_offset: Lateral landing offset w of the left foot, [m].
        double_cells: Cells of double support per step.
        single_cells: Cells of single support per step.

    Returns:
        The half cycle that begins with the left foot's landing.
    """
    count = double_cells + single_cells
    # Columns: dependence on z0 (5), constant part (1).
    state = np.hstack((np.eye(5), np.zeros((5, 1))))
    ball_start = state[_BALL].copy()
    constant = np.eye(6)[5]
    # The right foot landed half a cycle earlier, when the ball was at -b(0).
    left_origin = landing_offset * constant - ball_start
    right_origin = -landing_offset * constant + ball_start
    states, inputs = [state], []
    for k in range(count):
        share = min((k + 0.5) / double_cells, 1.0) if k < double_cells else 1.0
        origin = share * left_origin + (1.0 - share) * right_origin
        command = origin + 2.0 * state[_BALL]
        inputs.append(command)
        state = model.transition @ state + np.outer(model.input, command)
        states.append(state)
    initial = np.linalg.solve(state[:, :5] + np.eye(5), -state[:, 5])
    extended = np.append(initial, 1.0)
    return SwayReference(
        states=np.array([s @ extended for s in states[:count]]),
        inputs=np.array([u @ extended for u in inputs]),
        double_cells=double_cells,
    )
