"""All bounds on the CoP and on the footholds over the horizon, as matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import BALL
from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.axis_model import Prediction
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
    """

    is_double: tuple[bool, ...]
    rows: tuple[SupportRow, ...]
    landing_cells: tuple[int, ...]
    landing_lower: tuple[float, ...]
    landing_upper: tuple[float, ...]
    landing_weights: tuple[float, ...]
    separations: tuple[SeparationRow, ...] = ()


@dataclass(frozen=True, slots=True)
class BoundTable:
    """All bounds, one row for each; ``by_input`` is transposed.

    ``lower <= by_landings d + by_input (r + v) + by_state z_0 - by_soles s <= upper``
    with both bounds widened by ``spread`` times half of the feet's distance.
    """

    by_landings: Array
    by_input: Array
    by_state: Array
    by_soles: Array
    lower: Array
    upper: Array
    spread: Array


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
    landing_cells = np.array((*structure.landing_cells, 0))  # never without a number
    by_landings, by_input, by_state, by_soles = _fill_support(
        np.array([row.cell for row in rows]),
        np.array([row.standing for row in rows]),
        np.array([row.landings for row in rows]).reshape(len(rows), n_landings),
        landing_cells,
        prediction.state_from_state[:, BALL].copy(),
        prediction.state_from_input[:, BALL].copy(),
        prediction.command_from_state,
        prediction.command_from_input,
    )
    lower, upper = [row.lower for row in rows], [row.upper for row in rows]
    spread = [row.spread for row in rows]
    if items:
        separations = _fill_separations(
            np.array([[item.landing, item.other, item.other_foot] for item in items]),
            np.array([item.sign for item in items]),
            n_landings,
            landing_cells,
            prediction.state_from_state[:, BALL].copy(),
            prediction.state_from_input[:, BALL].copy(),
        )
        by_landings, by_input, by_state, by_soles = (
            np.vstack(parts)
            for parts in zip(
                (by_landings, by_input, by_state, by_soles), separations, strict=True
            )
        )
        lower += [item.minimum for item in items]
        upper += [UNBOUNDED] * len(items)
        spread += [0.0] * len(items)
    return BoundTable(
        by_landings,
        np.ascontiguousarray(by_input.T),
        by_state,
        by_soles,
        np.array(lower),
        np.array(upper),
        np.array(spread),
    )


@compiled
def _fill_support(
    cells: IntArray,
    standing: Array,
    landings: Array,
    landing_cells: IntArray,
    ball_state: Array,
    ball_input: Array,
    command_from_state: Array,
    command_from_input: Array,
) -> tuple[Array, Array, Array, Array]:
    """Return the parts of the rows that keep the CoP in the soles.

    Args:
        cells: Cell of each row, shape (m,).
        standing: Weights of the standing feet (left, right), shape (m, 2).
        landings: Weights of the landings, shape (m, n_landings).
        landing_cells: Cell of each landing.
        ball_state: b_k by z_0, shape (N + 1, 7).
        ball_input: b_k by r, shape (N + 1, N).
        command_from_state: u_k by z_0, shape (N, 7).
        command_from_input: u_k by r, shape (N, N).

    Returns:
        ``by_landings``, ``by_input``, ``by_state`` and ``by_soles``.
    """
    m, n_landings = landings.shape
    n, size = command_from_state.shape
    by_landings, by_input = np.zeros((m, n_landings)), np.zeros((m, n))
    by_state = np.zeros((m, size))
    for row in range(m):
        k = cells[row]  # the ball is taken at the middle of the cell
        carried = 2.0 * (standing[row, 0] + standing[row, 1])
        for i in range(size):
            by_state[row, i] = (
                command_from_state[k, i]
                + carried * ball_state[0, i]
                - ball_state[k, i]
                - ball_state[k + 1, i]
            )
        for i in range(n):
            by_input[row, i] = (
                command_from_input[k, i] - ball_input[k, i] - ball_input[k + 1, i]
            )
        for j in range(n_landings):
            weight, cell = landings[row, j], landing_cells[j]
            by_landings[row, j] = -weight
            for i in range(size):
                by_state[row, i] += weight * ball_state[cell, i]
            for i in range(n):
                by_input[row, i] += weight * ball_input[cell, i]
    return by_landings, by_input, by_state, standing.copy()


@compiled
def _fill_separations(
    feet: IntArray,
    signs: Array,
    n_landings: int,
    landing_cells: IntArray,
    ball_state: Array,
    ball_input: Array,
) -> tuple[Array, Array, Array, Array]:
    """Return the parts of the rows that keep the feet apart.

    Args:
        feet: Landing, landing of the other foot (-1 = it stands now) and the other
            foot itself, shape (m, 3).
        signs: Side on which the landing foot belongs, shape (m,).
        n_landings: Number of landings.
        landing_cells: Cell of each landing.
        ball_state: b_k by z_0, shape (N + 1, 7).
        ball_input: b_k by r, shape (N + 1, N).

    Returns:
        ``by_landings``, ``by_input``, ``by_state`` and ``by_soles``.
    """
    m, size, n = len(signs), ball_state.shape[1], ball_input.shape[1]
    by_landings, by_input = np.zeros((m, n_landings)), np.zeros((m, n))
    by_state, by_soles = np.zeros((m, size)), np.zeros((m, 2))
    for row in range(m):
        landing, other, foot = feet[row, 0], feet[row, 1], feet[row, 2]
        sign, cell = signs[row], landing_cells[landing]
        by_landings[row, landing] = sign
        for i in range(size):
            by_state[row, i] = -sign * ball_state[cell, i]
        for i in range(n):
            by_input[row, i] = -sign * ball_input[cell, i]
        if other < 0:
            by_soles[row, foot] = sign
            for i in range(size):
                by_state[row, i] += 2.0 * sign * ball_state[0, i]
        else:
            landed = landing_cells[other]
            by_landings[row, other] = -sign
            for i in range(size):
                by_state[row, i] += sign * ball_state[landed, i]
            for i in range(n):
                by_input[row, i] += sign * ball_input[landed, i]
    return by_landings, by_input, by_state, by_soles
