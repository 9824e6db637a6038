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

from ballsim_controllers.body_pendulum import BALL, STATE_SIZE
from ballsim_controllers.messages import Array

__all__ = [
    "AxisModel",
    "AxisPreview",
    "CellModel",
    "PreviewProblem",
    "PreviewSolution",
    "SeparationRow",
    "SupportRow",
]

#: DAQP's code of a constraint that may be violated at a price.
_SOFT = 8


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
        is_double: Whether both feet stand, per cell.
        state: Present state, shape (7,), see `body_pendulum`.
        state_reference: Reference at the start of each cell, shape (N, 7).
        input_reference: CoP that belongs to the reference, shape (N,), [m].
        rows: Bounds on the CoP.
        landing_cells: Cell at whose start each foot lands.
        landing_nominal: Nominal landing offset from the ball's centre, [m].
        landing_lower: Lower bounds of the landing offsets, [m].
        landing_upper: Upper bounds of the landing offsets, [m].
        landing_weights: Weight of the deviation from nominal per landing.
        separations: Distances that the feet keep at landing.
    """

    is_double: tuple[bool, ...]
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
        states: State at the start of each cell and after the last, (N + 1, 7).
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
        model: Models and feedback.
        cells: Number of cells N of the horizon.
    """

    def __init__(self, model: AxisModel, cells: int) -> None:
        """Keep the model; predictions are made where they are first needed."""
        self.model = model
        self.cells = cells
        self._predictions: dict[tuple[bool, ...], _Prediction] = {}

    def solve(self, problem: PreviewProblem) -> PreviewSolution:
        """Return CoP and footholds for one problem."""
        n, z0 = self.cells, problem.state
        prediction = self._prediction(problem.is_double)
        landings = len(problem.landing_cells)
        wanted = problem.input_reference + np.einsum(
            "ki,ki->k", problem.state_reference, prediction.gains
        )
        free = prediction.deviation0 @ z0 - wanted
        size = n + landings
        hessian = np.zeros((size, size))
        hessian[:n, :n] = prediction.hessian
        gradient = np.zeros(size)
        gradient[:n] = prediction.deviation.T @ free
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
        matrix[:, :n] = prediction.distance[cell] + shares @ prediction.ball[at]
        matrix[:, n:] = -shares
        centre = (
            standing
            - 2.0 * carried * z0[BALL]
            + 2.0 * prediction.middle0[cell] @ z0
            - shares @ (prediction.ball0[at] @ z0)
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
            apart, least = self._separation_rows(problem, prediction)
            matrix = np.vstack((matrix, apart))
            lower = np.concatenate((lower, least))
            upper = np.concatenate((upper, np.full(len(least), 1e3)))
        sense = np.zeros(len(upper), dtype=np.intc)
        sense[size:] = _SOFT
        solution, _, flag, _ = daqp.solve(
            hessian, gradient, matrix, upper, lower, sense
        )
        if flag < 1 or not np.all(np.isfinite(solution)):
            return self._fallback(problem, prediction)
        inputs = solution[:n]
        states = prediction.free @ z0 + prediction.forced @ inputs
        return PreviewSolution(inputs, states, solution[n:], True)

    def _separation_rows(
        self, problem: PreviewProblem, prediction: _Prediction
    ) -> tuple[Array, Array]:
        """Return matrix and lower bounds of the distances between the feet.

        With s the other sole, carried to ``s - 2 b_0 + 2 b`` (or
        ``d_i - b_i + 2 b``) by the time of the landing at ``d_j + b``.
        """
        n, z0 = self.cells, problem.state
        matrix = np.zeros((len(problem.separations), n + len(problem.landing_cells)))
        least = np.empty(len(problem.separations))
        for row, item in enumerate(problem.separations):
            cell = problem.landing_cells[item.landing]
            matrix[row, :n] = -prediction.ball[cell]
            matrix[row, n + item.landing] = 1.0
            constant = -prediction.ball0[cell] @ z0
            if item.other < 0:
                constant += 2.0 * z0[BALL] - item.standing
            else:
                other_cell = problem.landing_cells[item.other]
                matrix[row, :n] += prediction.ball[other_cell]
                matrix[row, n + item.other] = -1.0
                constant += prediction.ball0[other_cell] @ z0
            matrix[row] *= item.sign
            least[row] = item.minimum - item.sign * constant
        return matrix, least

    def _fallback(
        self, problem: PreviewProblem, prediction: _Prediction
    ) -> PreviewSolution:
        """Follow the ideal CoP and land at the nominal places."""
        inputs = np.empty(self.cells)
        states = np.empty((self.cells + 1, STATE_SIZE))
        states[0] = problem.state
        for k, is_double in enumerate(problem.is_double):
            model = self.model.double if is_double else self.model.single
            error = states[k] - problem.state_reference[k]
            inputs[k] = problem.input_reference[k] - prediction.gains[k] @ error
            states[k + 1] = model.transition @ states[k] + model.input * inputs[k]
        nominal = np.clip(
            problem.landing_nominal, problem.landing_lower, problem.landing_upper
        )
        return PreviewSolution(inputs, states, np.asarray(nominal, float), False)

    def ideal_cop(self, problem: PreviewProblem) -> float:
        """Return the CoP of the feedback, not limited to the soles, [m]."""
        model = self.model.double if problem.is_double[0] else self.model.single
        error = problem.state - problem.state_reference[0]
        return float(problem.input_reference[0] - model.gain @ error)

    def _prediction(self, is_double: tuple[bool, ...]) -> _Prediction:
        """Return the prediction matrices of a sequence of supports, cached."""
        prediction = self._predictions.get(is_double)
        if prediction is None:
            models = [self.model.double if d else self.model.single for d in is_double]
            prediction = _predict(models)
            self._predictions[is_double] = prediction
        return prediction


@dataclass(frozen=True, slots=True)
class _Prediction:
    """Prediction over the cells: ``free @ z0 + forced @ U`` and what follows."""

    free: Array  # (n + 1, 7, 7)
    forced: Array  # (n + 1, 7, n)
    gains: Array  # (n, 7)
    deviation: Array  # u + K z = deviation @ U + deviation0 @ z0
    deviation0: Array
    hessian: Array
    ball: Array
    ball0: Array
    middle0: Array
    distance: Array  # u - 2 b in the middle of each cell


def _predict(models: Sequence[CellModel]) -> _Prediction:
    n = len(models)
    free = np.empty((n + 1, STATE_SIZE, STATE_SIZE))
    forced = np.zeros((n + 1, STATE_SIZE, n))
    free[0] = np.eye(STATE_SIZE)
    for k, model in enumerate(models):
        free[k + 1] = model.transition @ free[k]
        forced[k + 1] = model.transition @ forced[k]
        forced[k + 1][:, k] = model.input
    gains = np.array([model.gain for model in models])
    deviation = np.eye(n) + np.einsum("ki,kij->kj", gains, forced[:n])
    ball, ball0 = forced[:, BALL], free[:, BALL]
    return _Prediction(
        free=free,
        forced=forced,
        gains=gains,
        deviation=deviation,
        deviation0=np.einsum("ki,kij->kj", gains, free[:n]),
        hessian=deviation.T @ deviation + 1e-6 * np.eye(n),
        ball=ball,
        ball0=ball0,
        middle0=0.5 * (ball0[:-1] + ball0[1:]),
        distance=np.eye(n) - (ball[:-1] + ball[1:]),
    )
