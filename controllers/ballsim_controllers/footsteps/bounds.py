"""All bounds on the CoP and on the footholds over the horizon, as matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import BALL
from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.axis_model import (
    KNOWN_SIZE,
    SOLES,
    Prediction,
    SwingCells,
)
from ballsim_controllers.messages import Array, IntArray

__all__ = [
    "UNBOUNDED",
    "BoundTable",
    "PreviewStructure",
    "SeparationRow",
    "SupportRow",
    "build_bound_table",
]

#: Bound that is never met, [m].
UNBOUNDED = 1e3


@dataclass(frozen=True, slots=True)
class SupportRow:
    """One bound on the CoP: its distance from a (mean) sole in one cell.

    Attributes:
        cell: Index of the cell.
        standing: Weight of each foot that stands already (left, right).
        landings: Weight of each landing to come; all weights add up to 1.
        lower: Lower bound of the distance, [m].
        upper: Upper bound of the distance, [m].
        spread: What half of the distance between the feet as they stand now adds
            to the bounds.
    """

    cell: int
    standing: tuple[float, float]
    landings: tuple[float, ...]
    lower: float
    upper: float
    spread: float = 0.0


@dataclass(frozen=True, slots=True)
class SeparationRow:
    """Least distance of a landing foot from the other one.

    Attributes:
        landing: Index of the landing.
        other: Landing that the other foot stands on, -1 = where it stands now.
        other_foot: The other foot, 0 = left, 1 = right.
        sign: +1 where the landing foot belongs on the positive side.
        minimum: Least signed distance, [m].
    """

    landing: int
    other: int
    other_foot: int
    sign: float
    minimum: float


@dataclass(frozen=True, slots=True)
class PreviewStructure:
    """What one axis looks like over the horizon, wherever the robot is.

    Attributes:
        is_double: Whether both feet stand, per cell.
        rows: Bounds on the CoP.
        landing_cells: Cell at whose start each foot lands.
        landing_lower: Lower bounds of the landing offsets, [m].
        landing_upper: Upper bounds of the landing offsets, [m].
        landing_weights: Weight of the deviation from nominal per landing.
        separations: Distances that the feet keep at landing.
        swings: The swings that end within the horizon.
        lifting: Upward acceleration in each cell of a whole swing, [m/s^2].
        lift_cells: Cells at whose start a foot leaves the ball.
    """

    is_double: tuple[bool, ...]
    rows: tuple[SupportRow, ...]
    landing_cells: tuple[int, ...]
    landing_lower: tuple[float, ...]
    landing_upper: tuple[float, ...]
    landing_weights: tuple[float, ...]
    separations: tuple[SeparationRow, ...] = ()
    swings: tuple[SwingCells, ...] = ()
    lifting: tuple[float, ...] = ()
    lift_cells: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class BoundTable:
    """All bounds.

    ``lower <= by_known (z_0, s, swing, 1) + by_landings d + by_input (r + v) <= upper``
    with both bounds widened by ``spread`` times half of the feet's distance.

    Attributes:
        rows: A row for each: by_known, by_landings, lower, upper, spread.
        by_input: Transposed, shape (N, m).
    """

    rows: Array
    by_input: Array

    @property
    def by_landings(self) -> Array:
        """Return the columns of the landings, shape (m, n_landings)."""
        return self.rows[:, KNOWN_SIZE:-3]


def build_bound_table(
    structure: PreviewStructure, prediction: Prediction
) -> BoundTable:
    """Write a row for each support and each separation.

    A sole that stands at s is at ``s + 2 (b - b_0)`` when the ball is at b, one
    that lands at the offset d while the ball is at b_j is then at
    ``d + b_j + 2 (b - b_j)``.

    Args:
        structure: The bounds.
        prediction: Motion over the cells under the feedback.
    """
    rows, items = structure.rows, structure.separations
    n_landings = len(structure.landing_cells)
    table = _fill(
        np.array([row.cell for row in rows]),
        np.array([row.standing for row in rows]),
        np.array([row.landings for row in rows]).reshape(len(rows), n_landings),
        np.array(
            [[item.landing, item.other, item.other_foot] for item in items],
            dtype=np.int_,
        ).reshape(len(items), 3),
        np.array([item.sign for item in items]),
        np.array((*structure.landing_cells, 0)),  # never without a number
        prediction.states[:, BALL].copy(),
        prediction.commands,
    )
    first_input = KNOWN_SIZE + n_landings
    limits = [(row.lower, row.upper, row.spread) for row in rows]
    limits += [(item.minimum, UNBOUNDED, 0.0) for item in items]
    return BoundTable(
        np.hstack((table[:, :first_input], np.array(limits).reshape(len(table), 3))),
        np.ascontiguousarray(table[:, first_input:].T),
    )


@compiled
def _fill(
    cells: IntArray,
    standing: Array,
    landings: Array,
    feet: IntArray,
    signs: Array,
    landing_cells: IntArray,
    ball: Array,
    commands: Array,
) -> Array:
    """Return all rows, by the columns of a prediction.

    Args:
        cells: Cell of each row, shape (m,).
        standing: Weights of the standing feet (left, right), shape (m, 2).
        landings: Weights of the landings, shape (m, n_landings).
        feet: Of each separation: landing, landing of the other foot (-1 = it stands
            now) and the other foot itself, shape (l, 3).
        signs: Side on which the landing foot belongs, shape (l,).
        landing_cells: Cell of each landing.
        ball: b_k, shape (N + 1, columns).
        commands: u_k, shape (N, columns).
    """
    m, n_landings = landings.shape
    table = np.zeros((m + len(signs), commands.shape[1]))
    for i in range(m):
        row, k = table[i], cells[i]  # the ball is taken at the middle of the cell
        row[:] = commands[k] - ball[k] - ball[k + 1]
        for foot in range(2):
            row[SOLES + foot] -= standing[i, foot]
            row += 2.0 * standing[i, foot] * ball[0]
        for j in range(n_landings):
            row[KNOWN_SIZE + j] -= landings[i, j]
            row += landings[i, j] * ball[landing_cells[j]]
    for i in range(len(signs)):
        row, landing, other = table[m + i], feet[i, 0], feet[i, 1]
        sign, cell = signs[i], landing_cells[feet[i, 0]]
        row[KNOWN_SIZE + landing] = sign
        row -= sign * ball[cell]
        if other < 0:
            row[SOLES + feet[i, 2]] -= sign
            row += 2.0 * sign * ball[0]
        else:
            row[KNOWN_SIZE + other] -= sign
            row += sign * ball[landing_cells[other]]
    return table
