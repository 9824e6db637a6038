"""Periodic lateral sway of the wheeled LIP under alternating support.

The paper treats the sagittal plane only. In the frontal plane the CoP must
change from foot to foot; the antisymmetric periodic motion of the model under
that CoP is the reference about which the frontal plane is balanced.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import BALL, STATE_SIZE
from ballsim_controllers.footsteps.axis_model import AxisModel
from ballsim_controllers.footsteps.quintic import mean_acceleration
from ballsim_controllers.messages import Array

__all__ = ["SwayReference", "compute_sway"]


@dataclass(frozen=True, slots=True)
class SwayReference:
    """One half cycle: double support after the left foot landed, left support.

    The other half is the mirror image.

    Attributes:
        states: State at the start of each cell, shape (n, 7), see `body_pendulum`.
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
    are affine in the initial state z0, and so is the whole half cycle, the reaction
    of the swinging leg included; z0 follows from ``z(half cycle) = -z0``.

    Args:
        model: Models of the axis (their gains are not used).
        landing_offset: Lateral landing offset w of the left foot, [m].
        double_cells: Cells of double support per step.
        single_cells: Cells of single support per step.

    Returns:
        The half cycle that begins with the left foot's landing.
    """
    count = double_cells + single_cells
    # Columns: dependence on z0, constant part.
    state = np.hstack((np.eye(STATE_SIZE), np.zeros((STATE_SIZE, 1))))
    ball_start = state[BALL].copy()
    constant = np.eye(STATE_SIZE + 1)[-1]
    # The right foot landed half a cycle earlier, when the ball was at -b(0).
    left_origin = landing_offset * constant - ball_start
    right_origin = -landing_offset * constant + ball_start
    states, inputs = [state], []
    for k in range(count):
        share = min((k + 0.5) / double_cells, 1.0) if k < double_cells else 1.0
        origin = share * left_origin + (1.0 - share) * right_origin
        command = origin + 2.0 * state[BALL]
        inputs.append(command)
        cell = model.double if k < double_cells else model.single
        if k == double_cells:
            cell = model.first_single
        state = cell.transition @ state + np.outer(cell.input, command)
        if k >= double_cells:
            lift_off = states[double_cells]
            start = (k - double_cells) * model.cell
            times = (single_cells * model.cell, start, start + model.cell)
            reaction = (
                mean_acceleration(1.0, 0.0, 0.0, 0.0, 0.0, *times)
                * (right_origin + lift_off[BALL])
                + mean_acceleration(0.0, 1.0, 0.0, 0.0, 1.0, *times)
                * lift_off[BALL + 1]
                - mean_acceleration(0.0, 0.0, 0.0, landing_offset, 0.0, *times)
                * constant
            )
            state = state + np.outer(cell.swing, reaction)
        states.append(state)
    initial = np.linalg.solve(state[:, :-1] + np.eye(STATE_SIZE), -state[:, -1])
    extended = np.append(initial, 1.0)
    return SwayReference(
        states=np.array([s @ extended for s in states[:count]]),
        inputs=np.array([u @ extended for u in inputs]),
        double_cells=double_cells,
    )
