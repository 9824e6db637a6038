"""Preview of CoP and footholds along one horizontal axis.

The balance controller's ideal CoP is a linear feedback, ``u = -K z``, on the
wheeled LIP. Over a horizon of some steps the planner looks for the CoP that is
nearest to the ideal one and still lies in the soles that will stand at each
instant; where the next feet land is part of the search:

    minimise   sum_k (u_k - u_ideal(z_k))^2 + weight sum_j (d_j - d_nominal_j)^2
    subject to the CoP in the standing soles, the footholds within reach.

Where no sole limits the CoP, the solution is the pole-placed feedback itself.
The soles stand on a rolling ball: a sole that stays is carried along at twice
the velocity of the ball's centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import daqp
import numpy as np

from ballsim_controllers.messages import Array

__all__ = ["AxisModel", "AxisPreview", "PreviewProblem", "PreviewSolution", "SeparationRow", "SupportRow"]

#: DAQP's code of a constraint that may be violated at a price.
_SOFT = 8
#: Position of the ball in the state (x, x', b, b', p).
_BALL = 2


@dataclass(frozen=True, slots=True)
class AxisModel:
    """Discrete model of one axis with its feedback.

    Attributes:
        transition: State matrix over one cell, state (x, x', b, b', p): CoM,
            ball and CoP with their velocities, shape (5, 5).
        input: Effect of the commanded CoP, shape (5,).
        gain: Feedback K of the ideal CoP, shape (5,).
        cell: Length of a cell, [s].
    """

    transition: Array
    input: Array
    gain: Array
    cell: float


@dataclass(frozen=True, slots=True)
class SupportRow:
    """One bound on the CoP: its distance from a (mean) sole in one cell.

    Attributes:
        cell: Index of the cell.
        standing: Weighted position of feet that stand already, [m].
        standing_weight: Sum of their weights.
        landings: Weight of each landing to come.
        lower: Lower bound of the distance, [m].
        upper: Upper bound of the distance, [m].
    """

    cell: int
    standing: float
    standing_weight: float
    landings: tuple[float, ...]
    lower: float
    upper: float


@dataclass(frozen=True, slots=True)
class SeparationRow:
    """Least distance of a landing foot from the other one.

    Attributes:
        landing: Index of the landing.
        other: Landing that the other foot stands on, -1 = where it stands now.
        standing: Where the other foot stands now (if ``other`` is -1), [m].
        sign: +1 where the landing foot belongs on the positive side.
        minimum: Least signed distance, [m].
    """

    landing: int
    other: int
    standing: float
    sign: float
    minimum: float


@dataclass(frozen=True, slots=True)
class PreviewProblem:
    """What one axis looks like over the horizon.

    Attributes:
        state: Present state (x, x', b, b', p), shape (5,).
        state_reference: Reference at the start of each cell, shape (N, 5).
        input_reference: CoP that belongs to the reference, shape (N,), [m].
        rows: Bounds on the CoP.
        landing_cells: Cell at whose start each foot lands.
        landing_nominal: Nominal landing offset from the ball's centre, [m].
        landing_lower: Lower bounds of the landing offsets, [m].
        landing_upper: Upper bounds of the landing offsets, [m].
        landing_weights: Weight of the deviation from nominal per landing.
        separations: Distances that the feet keep at landing.
    """

    state: Array
    state_reference: Array
    input_reference: Array
    rows: Sequence[SupportRow]
    landing_cells: tuple[int, ...]
    landing_nominal: tuple[float, ...]
    landing_lower: tuple[float, ...]
    landing_upper: tuple[float, ...]
    landing_weights: tuple[float, ...]
    separations: Sequence[SeparationRow] = ()


@dataclass(frozen=True, slots=True)
class PreviewSolution:
    """Result of one preview.

    Attributes:
        inputs: Commanded CoP per cell, shape (N,), [m].
        states: State at the start of each cell and after the last, (N + 1, 5).
        landings: Landing offsets from the ball's centre, [m].
        is_solved: False where the solver gave up; the inputs are then the
            ideal CoP of the feedback, not limited to the soles.
    """

    inputs: Array
    states: Array
    landings: Array
    is_solved: bool


class AxisPreview:
    """Solves the preview of one axis; all that can be is computed beforehand.

    Args:
        model: Discrete model and feedback.
        cells: Number of cells N of the horizon.
    """

    def __init__(self, model: AxisModel, cells: int) -> None:
        """Build the prediction matrices."""
        n = cells
        self.model = model
        self.cells = n
        self._free = np.empty((n + 1, 5, 5))
        self._forced = np.zeros((n + 1, 5, n))
        self._free[0] = np.eye(5)
        for k in range(n):
            self._free[k + 1] = model.transition @ self._free[k]
            self._forced[k + 1] = model.transition @ self._forced[k]
            self._forced[k + 1][:, k] = model.input
        # Deviation from the ideal CoP: u + K z = deviation @ U + deviation0 @ z0.
        self._deviation = np.eye(n) + np.einsum("i,kij->kj", model.gain, self._forced[:n])
        self._deviation0 = np.einsum("i,kij->kj", model.gain, self._free[:n])
        self._ball = self._forced[:, _BALL]
        self._ball0 = self._free[:, _BALL]
        middle = 0.5 * (self._ball[:-1] + self._ball[1:])
        self._middle0 = 0.5 * (self._ball0[:-1] + self._ball0[1:])
        self._distance = np.eye(n) - 2.0 * middle
        self._hessian = self._deviation.T @ self._deviation + 1e-6 * np.eye(n)

    def solve(self, problem: PreviewProblem) -> PreviewSolution:
        """Return CoP and footholds for one problem."""
        n, model, z0 = self.cells, self.model, problem.state
        landings = len(problem.landing_cells)
        wanted = problem.input_reference + problem.state_reference @ model.gain
        free = self._deviation0 @ z0 - wanted
        size = n + landings
        hessian = np.zeros((size, size))
        hessian[:n, :n] = self._hessian
        gradient = np.zeros(size)
        gradient[:n] = self._deviation.T @ free
        weights = np.array(problem.landing_weights)
        hessian[range(n, size), range(n, size)] = weights
        gradient[n:] = -weights * np.array(problem.landing_nominal)

        rows = problem.rows
        cell = np.array([row.cell for row in rows])
        shares = np.array([row.landings for row in rows]).reshape(len(rows), landings)
        standing = np.array([row.standing for row in rows])
        carried = np.array([row.standing_weight for row in rows])
        at = list(problem.landing_cells)
        matrix = np.empty((len(rows), size))
        matrix[:, :n] = self._distance[cell] + shares @ self._ball[at]
        matrix[:, n:] = -shares
        centre = (
            standing
            - 2.0 * carried * z0[_BALL]
            + 2.0 * self._middle0[cell] @ z0
            - shares @ (self._ball0[at] @ z0)
        )
        upper = np.concatenate(
            (
                np.full(n, 1e3),
                problem.landing_upper,
                centre + np.array([row.upper for row in rows]),
            )
        )
        lower = np.concatenate(
            (
                np.full(n, -1e3),
                problem.landing_lower,
                centre + np.array([row.lower for row in rows]),
            )
        )
        if problem.separations:
            apart, least = self._separation_rows(problem)
            matrix = np.vstack((matrix, apart))
            lower = np.concatenate((lower, least))
            upper = np.concatenate((upper, np.full(len(least), 1e3)))
        sense = np.zeros(len(upper), dtype=np.intc)
        sense[size:] = _SOFT
        solution, _, flag, _ = daqp.solve(hessian, gradient, matrix, upper, lower, sense)
        if flag < 1 or not np.all(np.isfinite(solution)):
            return self._fallback(problem)
        inputs = solution[:n]
        states = self._free @ z0 + self._forced @ inputs
        return PreviewSolution(inputs, states, solution[n:], True)

    def _separation_rows(self, problem: PreviewProblem) -> tuple[Array, Array]:
        """Return matrix and lower bounds of the distances between the feet.

        With s the other sole, carried to ``s - 2 b_0 + 2 b`` (or
        ``d_i - b_i + 2 b``) by the time of the landing at ``d_j + b``.
        """
        n, z0 = self.cells, problem.state
        matrix = np.zeros((len(problem.separations), n + len(problem.landing_cells)))
        least = np.empty(len(problem.separations))
        for row, item in enumerate(problem.separations):
            cell = problem.landing_cells[item.landing]
            matrix[row, :n] = -self._ball[cell]
            matrix[row, n + item.landing] = 1.0
            constant = -self._ball0[cell] @ z0
            if item.other < 0:
                constant += 2.0 * z0[_BALL] - item.standing
            else:
                other_cell = problem.landing_cells[item.other]
                matrix[row, :n] += self._ball[other_cell]
                matrix[row, n + item.other] = -1.0
                constant += self._ball0[other_cell] @ z0
            matrix[row] *= item.sign
            least[row] = item.minimum - item.sign * constant
        return matrix, least

    def _fallback(self, problem: PreviewProblem) -> PreviewSolution:
        """Follow the ideal CoP and land at the nominal places."""
        model = self.model
        inputs = np.empty(self.cells)
        states = np.empty((self.cells + 1, 5))
        states[0] = problem.state
        for k in range(self.cells):
            error = states[k] - problem.state_reference[k]
            inputs[k] = problem.input_reference[k] - model.gain @ error
            states[k + 1] = model.transition @ states[k] + model.input * inputs[k]
        nominal = np.clip(
            problem.landing_nominal, problem.landing_lower, problem.landing_upper
        )
        return PreviewSolution(inputs, states, np.asarray(nominal, float), False)
