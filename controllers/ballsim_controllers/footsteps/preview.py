"""Preview of CoP and footholds along one horizontal axis.

The balance controller's ideal CoP is a linear feedback, ``u = r - K z``, on the
wheeled LIP, r from the reference. Over a horizon of some steps the planner looks
for the CoP that is nearest to the ideal one and still lies in the soles that will
stand at each instant; where the next feet land is part of the search:

    minimise   sum_k v_k^2 + weight sum_j (d_j - d_nominal_j)^2
    subject to the CoP in the standing soles, the footholds within reach,

with v the deviation of the CoP from the ideal one. Where no sole limits the CoP,
v = 0: the solution is the pole-placed feedback itself. The soles stand on a rolling
ball: a sole that stays is carried along at twice the velocity of the ball's centre.

Which feet stand when, and with it every matrix of this quadratic program, depends on
the phase of the gait alone (`PreviewStructure`); the matrices are computed once.
"""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import numpy as np

from ballsim_controllers.body_pendulum import BALL, COM, STATE_SIZE
from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.axis_model import AxisModel, Prediction, predict
from ballsim_controllers.messages import Array

__all__ = [
    "AxisPreview",
    "PreviewProblem",
    "PreviewSolution",
    "PreviewStructure",
    "SeparationRow",
    "SupportRow",
]

#: DAQP's code of a constraint that may be violated at a price.
_SOFT = 8
_UNBOUNDED = 1e3  # [m]


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
class PreviewProblem:
    """Where the robot is and where it shall be.

    Attributes:
        state: Present state, shape (7,), see `body_pendulum`.
        reference: r_k = u_ref_k + K_k z_ref_k of each cell, shape (N,), [m]; see
            `AxisPreview.refer`.
        soles: Where the soles stand now along the axis (left, right), (2,), [m].
        landing_nominal: Nominal landing offsets from the ball's centre, [m].
    """

    state: Array
    reference: Array
    soles: Array
    landing_nominal: Array


@dataclass(frozen=True, slots=True)
class PreviewSolution:
    """Result of one preview.

    Attributes:
        problem: What was solved.
        prediction: Motion over the cells under the feedback.
        deviations: v_k, commanded less ideal CoP of each cell, shape (N,), [m].
        landings: Landing offsets from the ball's centre, [m].
        command: Commanded CoP of the first cell, [m].
        ideal_cop: CoP of the feedback in the first cell, not limited to the soles,
            [m].
        escape: How far the CoM is from the ball's centre at the end, signed, [m].
        is_solved: False where the solver gave up; the CoP is then the ideal one,
            not limited to the soles, and the landings are the nominal ones.
    """

    problem: PreviewProblem
    prediction: Prediction
    deviations: Array
    landings: Array
    command: float
    ideal_cop: float
    escape: float
    is_solved: bool

    @property
    def inputs(self) -> Array:
        """Return the commanded CoP of each cell, shape (N,), [m]."""
        prediction, problem = self.prediction, self.problem
        commands: Array = prediction.command_from_state @ problem.state
        commands += prediction.command_from_input @ (
            problem.reference + self.deviations
        )
        return commands

    @property
    def states(self) -> Array:
        """Return the states at the start of each cell and the end, (N + 1, 7)."""
        prediction, problem = self.prediction, self.problem
        states: Array = prediction.state_from_state @ problem.state
        states += prediction.state_from_input @ (problem.reference + self.deviations)
        return states


class AxisPreview:
    """Solves the preview of one axis for one structure.

    Args:
        model: Model and feedback of the axis.
        structure: What is known beforehand.
    """

    def __init__(self, model: AxisModel, structure: PreviewStructure) -> None:
        """Compute all matrices of the quadratic program."""
        self._prediction = prediction = predict(model, structure.is_double)
        self._n_landings = count = len(structure.landing_cells)
        self._table = table = _Table.build(structure, prediction)
        n, m = len(structure.is_double), len(table.lower)
        end_state, end_input = (
            matrices[-1][COM] - matrices[-1][BALL]
            for matrices in (prediction.state_from_state, prediction.state_from_input)
        )
        self._ends = (prediction.command_from_state[0].copy(), end_state, end_input)
        self._weights = np.array(structure.landing_weights)
        # Variables: landings, deviations. Bounds: landings, rows.
        self._lower, self._upper = np.empty(count + m), np.empty(count + m)
        self._lower[:count] = structure.landing_lower
        self._upper[:count] = structure.landing_upper
        self._gradient = np.zeros(count + n)
        self._sense = np.zeros(count + m, dtype=np.intc)
        self._sense[count:] = _SOFT
        self._solver = daqp.Model()
        self._solver.setup(
            np.diag(np.concatenate((self._weights, np.ones(n)))),
            self._gradient,
            np.hstack((table.by_landings, table.by_input.T)),
            np.full(count + m, _UNBOUNDED),
            np.full(count + m, -_UNBOUNDED),
            self._sense,
        )

    def refer(self, states: Array, inputs: Array) -> Array:
        """Return the reference as the feedback takes it, r = u_ref + K z_ref.

        Args:
            states: Reference at the start of each cell, shape (N, 7).
            inputs: CoP that belongs to it, shape (N,), [m].
        """
        return _refer(self._prediction.gains, states, inputs)

    def solve(self, problem: PreviewProblem) -> PreviewSolution:
        """Return CoP and footholds for one problem.

        The solver starts afresh: the solution does not depend on earlier ones.
        """
        count, nominal = self._n_landings, problem.landing_nominal
        ideal_cop = _fill_bounds(
            self._lower[count:],
            self._upper[count:],
            *self._table.bounds,
            self._ends[0],
            problem.state,
            problem.reference,
            problem.soles,
        )
        if count:
            self._gradient[:count] = -self._weights * nominal
        refused = self._solver.update(
            f=self._gradient,
            bupper=self._upper,
            blower=self._lower,
            sense=self._sense,
        )
        solution, _, flag, _ = self._solver.solve()
        is_solved = refused == 0 and flag >= 1 and bool(np.isfinite(solution).all())
        if is_solved:
            landings, deviations = solution[:count].copy(), solution[count:].copy()
        else:
            landings = np.clip(nominal, self._lower[:count], self._upper[:count])
            deviations = np.zeros(len(self._gradient) - count)
        _, end_state, end_input = self._ends
        escape = end_state @ problem.state + end_input @ (
            problem.reference + deviations
        )
        return PreviewSolution(
            problem=problem,
            prediction=self._prediction,
            deviations=deviations,
            landings=landings,
            command=ideal_cop + float(deviations[0]),
            ideal_cop=ideal_cop,
            escape=float(escape),
            is_solved=is_solved,
        )


@dataclass(frozen=True, slots=True)
class _Table:
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

    @property
    def bounds(self) -> tuple[Array, ...]:
        """Return what `_fill_bounds` takes."""
        return (
            self.by_input,
            self.by_state,
            self.by_soles,
            self.lower,
            self.upper,
            self.spread,
        )

    @classmethod
    def build(cls, structure: PreviewStructure, prediction: Prediction) -> _Table:
        """Write a row for each support and each separation.

        A sole that stands at s is at ``s + 2 (b - b_0)`` when the ball is at b, one
        that lands at the offset d while the ball is at b_j is then at
        ``d + b_j + 2 (b - b_j)``.
        """
        n, count = len(structure.is_double), len(structure.landing_cells)
        m = len(structure.rows) + len(structure.separations)
        ball_state = prediction.state_from_state[:, BALL]
        ball_input = prediction.state_from_input[:, BALL]
        start = ball_state[0]
        by_landings, by_soles = np.zeros((m, count)), np.zeros((m, 2))
        by_state, by_input = np.zeros((m, STATE_SIZE)), np.zeros((m, n))
        lower, upper = np.empty(m), np.empty(m)
        spread = np.zeros(m)
        for i, row in enumerate(structure.rows):
            k = row.cell  # the ball is taken at the middle of the cell
            by_state[i] = prediction.command_from_state[k]
            by_state[i] += 2.0 * sum(row.standing) * start
            by_state[i] -= ball_state[k] + ball_state[k + 1]
            by_input[i] = prediction.command_from_input[k]
            by_input[i] -= ball_input[k] + ball_input[k + 1]
            for j, weight in enumerate(row.landings):
                cell = structure.landing_cells[j]
                by_state[i] += weight * ball_state[cell]
                by_input[i] += weight * ball_input[cell]
                by_landings[i, j] = -weight
            by_soles[i] = row.standing
            lower[i], upper[i], spread[i] = row.lower, row.upper, row.spread
        for i, item in enumerate(structure.separations, len(structure.rows)):
            cell = structure.landing_cells[item.landing]
            by_state[i], by_input[i] = -ball_state[cell], -ball_input[cell]
            by_landings[i, item.landing] = 1.0
            if item.other < 0:
                by_state[i] += 2.0 * start
                by_soles[i, item.other_foot] = 1.0
            else:
                landed = structure.landing_cells[item.other]
                by_state[i] += ball_state[landed]
                by_input[i] += ball_input[landed]
                by_landings[i, item.other] = -1.0
            for matrix in (by_state, by_input, by_landings, by_soles):
                matrix[i] *= item.sign
            lower[i], upper[i] = item.minimum, _UNBOUNDED
        by_input = np.ascontiguousarray(by_input.T)
        return cls(by_landings, by_input, by_state, by_soles, lower, upper, spread)


@compiled
def _refer(gains: Array, states: Array, inputs: Array) -> Array:
    """Return r_k = u_ref_k + K_k z_ref_k, shape (N,)."""
    result = inputs.copy()
    for k in range(len(result)):
        for i in range(gains.shape[1]):
            result[k] += gains[k, i] * states[k, i]
    return result


@compiled
def _fill_bounds(
    new_lower: Array,
    new_upper: Array,
    by_input: Array,
    by_state: Array,
    by_soles: Array,
    lower: Array,
    upper: Array,
    spread: Array,
    first: Array,
    state: Array,
    reference: Array,
    soles: Array,
) -> float:
    """Write the bounds on the deviations; return the ideal CoP of the first cell."""
    apart = 0.5 * abs(soles[0] - soles[1])
    n_rows = len(lower)
    given = np.zeros(n_rows)
    for k in range(len(reference)):
        for i in range(n_rows):
            given[i] += by_input[k, i] * reference[k]
    for i in range(n_rows):
        for j in range(len(state)):
            given[i] += by_state[i, j] * state[j]
        given[i] -= by_soles[i, 0] * soles[0] + by_soles[i, 1] * soles[1]
        new_lower[i] = lower[i] - given[i] - spread[i] * apart
        new_upper[i] = upper[i] - given[i] + spread[i] * apart
    ideal: float = reference[0]
    for j in range(len(state)):
        ideal += first[j] * state[j]
    return ideal
