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
The swinging leg pushes the robot off: a foothold far from where the foot lifts off
moves CoM and ball, and the search knows it.

Which feet stand when, and with it every matrix of this quadratic program, depends on
the phase of the gait alone (`PreviewStructure`); the matrices are computed once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import daqp
import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.axis_model import (
    KNOWN_SIZE,
    ONE,
    SOLES,
    SWING,
    AxisModel,
    Prediction,
    predict,
)
from ballsim_controllers.footsteps.bounds import (
    UNBOUNDED,
    PreviewStructure,
    build_bound_table,
)
from ballsim_controllers.messages import Array

__all__ = [
    "AxisPreview",
    "PreviewProblem",
    "PreviewSolution",
]

#: DAQP's code of a constraint that may be violated at a price.
_SOFT = 8


@dataclass(frozen=True, slots=True)
class PreviewProblem:
    """Where the robot is and where it shall be.

    Attributes:
        state: Present state, shape (7,), see `body_pendulum`.
        reference: r_k = u_ref_k + K_k z_ref_k of each cell, shape (N,), [m]; see
            `AxisPreview.refer`.
        soles: Where the soles stand now along the axis (left, right), (2,), [m].
        swing: Offset of the swinging sole from the ball's centre, its velocity and
            its acceleration, shape (3,); without meaning if both feet stand.
        landing_nominal: Nominal landing offsets from the ball's centre, [m].
        landing_range: Least and greatest offset of the next landing, [m]; within the
            bounds of the structure.
        landing_play: How far the bounds of the landings move with the ball's speed,
            lower and upper, shape (2, n_landings), [m]; None where they stay.
    """

    state: Array
    reference: Array
    soles: Array
    swing: Array
    landing_nominal: Array
    landing_range: tuple[float, float] = (-math.inf, math.inf)
    landing_play: Array | None = None


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
        is_solved: False where the solver gave up; the CoP is then the ideal one,
            not limited to the soles, and the landings are the nominal ones.
        weights: Of the landings' deviations from nominal.
    """

    problem: PreviewProblem
    prediction: Prediction
    deviations: Array
    landings: Array
    command: float
    ideal_cop: float
    is_solved: bool
    weights: Array

    @property
    def effort(self) -> float:
        """Return what is minimised, [m^2]."""
        apart = self.landings - self.problem.landing_nominal
        deviation = float(self.deviations @ self.deviations)
        return deviation + float(self.weights @ (apart * apart))

    @property
    def inputs(self) -> Array:
        """Return the commanded CoP of each cell, shape (N,), [m]."""
        commands: Array = self.prediction.commands @ self._variables
        return commands

    @property
    def states(self) -> Array:
        """Return the states at the start of each cell and the end, (N + 1, 7)."""
        states: Array = self.prediction.states @ self._variables
        return states

    @property
    def _variables(self) -> Array:
        """Return all that the prediction is linear in."""
        problem = self.problem
        inputs = problem.reference + self.deviations
        known = (problem.state, problem.soles, problem.swing, [1.0])
        return np.concatenate((*known, self.landings, inputs))


class AxisPreview:
    """Solves the preview of one axis for one structure.

    Args:
        model: Model and feedback of the axis.
        structure: What is known beforehand.
    """

    def __init__(self, model: AxisModel, structure: PreviewStructure) -> None:
        """Compute all matrices of the quadratic program."""
        self._prediction = prediction = predict(
            model,
            structure.is_double,
            structure.landing_cells,
            structure.swings,
            structure.lifting,
            structure.lift_cells,
        )
        self._n_landings = count = len(structure.landing_cells)
        table = build_bound_table(structure, prediction)
        n, m = len(structure.is_double), len(table.rows)
        self._by_input, self._rows = table.by_input, table.rows
        self._first = prediction.commands[0, :KNOWN_SIZE].copy()
        self._weights = np.array(structure.landing_weights)
        # Variables: landings, deviations. Bounds: landings, rows.
        self._bounds = np.empty((2, count + m))
        self._lower, self._upper = self._bounds
        self._reach = np.array([structure.landing_lower, structure.landing_upper])
        self._gradient = np.zeros(count + n)
        self._no_deviations = np.zeros(n)
        self._no_deviations.setflags(write=False)
        self._sense = np.zeros(count + m, dtype=np.intc)
        self._sense[count:] = _SOFT
        self._solver = daqp.Model()
        self._solver.setup(
            np.diag(np.concatenate((self._weights, np.ones(n)))),
            self._gradient,
            np.hstack((table.by_landings, table.by_input.T)),
            np.full(count + m, UNBOUNDED),
            np.full(count + m, -UNBOUNDED),
            self._sense,
        )

    def refer(self, states: Array, inputs: Array) -> Array:
        """Return the reference as the feedback takes it, r = u_ref + K z_ref.

        Args:
            states: Reference at the start of each cell, shape (N, 7).
            inputs: CoP that belongs to it, shape (N,), [m].
        """
        reference = inputs.copy()
        _refer(reference, self._prediction.gains, states)
        return reference

    def respond(self, reference: Array) -> Array:
        """Return what a reference adds to each bound, shape (m,), [m].

        Args:
            reference: r of each cell, shape (N,), [m].
        """
        response = np.zeros(len(self._by_input[0]))
        _respond(response, self._by_input, reference)
        return response

    def solve(
        self, problem: PreviewProblem, response: Array | None = None
    ) -> PreviewSolution:
        """Return CoP and footholds for one problem.

        The solver starts afresh: the solution does not depend on earlier ones.

        Args:
            problem: The problem.
            response: What `respond` returned for its reference, if that is known.
        """
        if response is None:
            response = self.respond(problem.reference)
        nominal, reach = problem.landing_nominal, self._reach
        if problem.landing_play is not None:
            reach = reach + problem.landing_play
        ideal_cop, is_free = _fill_bounds(
            self._bounds,
            nominal,
            reach,
            *problem.landing_range,
            self._rows,
            self._first,
            response,
            problem.reference,
            problem.state,
            problem.soles,
            problem.swing,
        )
        landings, deviations, is_solved = nominal, self._no_deviations, True
        if not is_free:
            landings, deviations, is_solved = self._search(nominal)
        return PreviewSolution(
            problem=problem,
            prediction=self._prediction,
            deviations=deviations,
            landings=landings,
            command=ideal_cop + float(deviations[0]),
            ideal_cop=ideal_cop,
            is_solved=is_solved,
            weights=self._weights,
        )

    def _search(self, nominal: Array) -> tuple[Array, Array, bool]:
        """Return landings, deviations and whether they were found by the solver."""
        count = self._n_landings
        self._gradient[:count] = -self._weights * nominal
        refused = self._solver.update(
            f=self._gradient,
            bupper=self._upper,
            blower=self._lower,
            sense=self._sense,
        )
        solution, _, flag, _ = self._solver.solve()
        if refused == 0 and flag >= 1 and np.isfinite(solution).all():
            return solution[:count].copy(), solution[count:].copy(), True
        landings = np.clip(nominal, self._lower[:count], self._upper[:count])
        return landings, self._no_deviations, False


@compiled
def _refer(inputs: Array, gains: Array, states: Array) -> None:
    """Turn u_ref_k into r_k = u_ref_k + K_k z_ref_k (in place), shape (N,)."""
    for k in range(len(inputs)):
        for i in range(gains.shape[1]):
            inputs[k] += gains[k, i] * states[k, i]


@compiled
def _respond(response: Array, by_input: Array, reference: Array) -> None:
    """Add up what the reference of each cell does, shape (m,)."""
    for k in range(len(reference)):
        for i in range(len(response)):
            response[i] += by_input[k, i] * reference[k]


@compiled
def _fill_bounds(
    bounds: Array,
    nominal: Array,
    reach: Array,
    least: float,
    greatest: float,
    rows: Array,
    first: Array,
    response: Array,
    reference: Array,
    state: Array,
    soles: Array,
    swing: Array,
) -> tuple[float, bool]:
    """Write the bounds on the landings, and those on the deviations behind them.

    Args:
        bounds: The result, lower and upper, shape (2, n_landings + m), [m].
        nominal: Nominal landing offsets, shape (n_landings,), [m].
        reach: Bounds of the landings, lower and upper, shape (2, n_landings), [m].
        least: Least offset of the next landing, [m].
        greatest: Its greatest one, [m].
        rows: See `BoundTable`.
        first: Commanded CoP of the first cell by what is known, shape (KNOWN_SIZE,).
        response: What the reference adds to each row, shape (m,), [m].
        reference: r of each cell, shape (N,), [m].
        state: Present state, shape (7,).
        soles: Where the soles stand, shape (2,), [m].
        swing: Swinging sole, shape (3,).

    Returns:
        Ideal CoP of the first cell, [m], and whether the feedback itself, with the
        nominal landings, keeps all bounds: it is the solution then.
    """
    count, size = len(nominal), len(state)
    known = np.empty(KNOWN_SIZE)
    known[:size] = state
    known[SOLES:SWING] = soles
    known[SWING:ONE] = swing
    known[ONE] = 1.0
    apart = 0.5 * abs(soles[0] - soles[1])
    is_free = True
    for i in range(count):
        low, high = reach[0, i], reach[1, i]
        if i == 0:
            low = min(max(low, least), high)
            high = max(min(high, greatest), low)
        bounds[0, i], bounds[1, i] = low, high
        is_free = is_free and low <= nominal[i] <= high
    for i in range(len(rows)):
        row = rows[i]
        given, landed = response[i], 0.0
        for j in range(KNOWN_SIZE):
            given += row[j] * known[j]
        for j in range(count):
            landed += row[KNOWN_SIZE + j] * nominal[j]
        lower, upper, spread = row[-3], row[-2], row[-1] * apart
        low, high = lower - given - spread, upper - given + spread
        bounds[0, count + i], bounds[1, count + i] = low, high
        is_free = is_free and low <= landed <= high
    ideal = reference[0]
    for j in range(KNOWN_SIZE):
        ideal += first[j] * known[j]
    return ideal, is_free
