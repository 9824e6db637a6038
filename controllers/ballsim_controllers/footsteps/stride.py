"""Periodic sagittal motion of the wheeled LIP over a stride: the swing's reaction.

A leg that swings pushes the robot off, and the robot the ball. Feedback alone
answers when ball and CoM have moved already. But the swing is known beforehand: so is
the motion of CoM and CoP with which the ball rolls on evenly. It is the reference about
which the sagittal plane is balanced, as the sway is that of the frontal plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import BALL, COP, STATE_SIZE
from ballsim_controllers.footsteps.axis_model import AxisModel
from ballsim_controllers.footsteps.quintic import mean_acceleration
from ballsim_controllers.messages import Array

__all__ = ["StrideMotion", "StrideReference", "compute_stride"]

#: Weight of the CoP's way from the ball's centre over that of the ball's speed, [1/s]:
#: decides where more than one motion keeps the ball's speed.
_COP_WEIGHT = 1e-2


@dataclass(frozen=True, slots=True)
class StrideMotion:
    """Deviation from an even roll over a step.

    Attributes:
        states: At the start of each cell, shape (n, 7), see `body_pendulum`.
        inputs: Commanded CoP of each cell, shape (n,), [m].
    """

    states: Array
    inputs: Array


@dataclass(frozen=True, slots=True)
class StrideReference:
    """One step: double support, then single support; both feet are alike.

    Attributes:
        roll: Due to the swing along the axis, per speed of the ball, [1/(m/s)].
        lift: Due to the swing up and down.
        lifting: Upward acceleration of the foot in each cell of a swing, [m/s^2].
    """

    roll: StrideMotion
    lift: StrideMotion
    lifting: tuple[float, ...]


def compute_stride(
    model: AxisModel, double_cells: int, lifting: Sequence[float]
) -> StrideReference:
    """Return the periodic motions in which the ball rolls evenly.

    A foot lands where the ball carries it through below the hip in the middle of its
    single support. Seen from the ball's centre it stands from -d to d and swings back
    from d to -d, ``d = v (double + single / 2)``.

    Args:
        model: Models of the axis (their gains are not used).
        double_cells: Cells of double support per step.
        lifting: Mean upward acceleration of the foot in each cell of single support,
            [m/s^2].
    """
    cell, single_cells = model.cell, len(lifting)
    duration, way = single_cells * cell, (double_cells + 0.5 * single_cells) * cell
    roll = [
        mean_acceleration(way, 1.0, 0.0, -way, 1.0, duration, k * cell, (k + 1) * cell)
        for k in range(single_cells)
    ]
    solve = _PeriodicMotion(model, double_cells, single_cells)
    lift = [model.lift * upward for upward in lifting]
    return StrideReference(solve(roll), solve(lift), tuple(lifting))


class _PeriodicMotion:
    """Linear map from the swing's acceleration to the motion of a step."""

    def __init__(self, model: AxisModel, double_cells: int, single_cells: int) -> None:
        """Write states over a step by initial state, inputs and accelerations."""
        self._double, n = double_cells, double_cells + single_cells
        width = STATE_SIZE + n
        state = np.eye(STATE_SIZE, width + single_cells)
        states = [state]
        for k in range(n):
            cell = model.double if k < double_cells else model.single
            state = cell.transition @ state
            state[:, STATE_SIZE + k] += cell.input
            if k >= double_cells:
                state[:, width + k - double_cells] += cell.swing
            states.append(state)
        self._states, self._width = np.array(states), width

    def __call__(self, accelerations: Sequence[float]) -> StrideMotion:
        """Return the motion for the mean accelerations of the swing's cells."""
        width, states = self._width, self._states
        free, given = states[..., :width], states[..., width:] @ np.array(accelerations)
        # Ball's speed and way of the CoP are to vanish, the end is to be the start.
        wanted = np.vstack(
            (free[:-1, BALL + 1], _COP_WEIGHT * (free[:-1, COP] - free[:-1, BALL]))
        )
        offset = np.concatenate(
            (given[:-1, BALL + 1], _COP_WEIGHT * (given[:-1, COP] - given[:-1, BALL]))
        )
        closed = free[-1] - free[0]
        place = free[:-1, BALL].sum(axis=0)  # on the mean that of the even roll
        rows = np.vstack((closed, place))
        ends = np.append(given[-1], given[:-1, BALL].sum())
        corner = np.zeros((len(rows), len(rows)))
        system = np.block([[wanted.T @ wanted, rows.T], [rows, corner]])
        right = -np.concatenate((wanted.T @ offset, ends))
        found = np.linalg.lstsq(system, right, rcond=None)[0][:width]
        motion = free @ found + given
        return StrideMotion(motion[:-1], found[STATE_SIZE:])
