"""Laws of the preview of CoP and footholds along one axis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import scipy.optimize

from ballsim_controllers.body_pendulum import BALL, STATE_SIZE
from ballsim_controllers.footsteps import preview as preview_module
from ballsim_controllers.footsteps.preview import (
    AxisModel,
    AxisPreview,
    PreviewProblem,
    PreviewSolution,
    SeparationRow,
    SupportRow,
)
from ballsim_controllers.messages import Array

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

AxisFactory = Callable[[float], "PlainAxis"]


def cell_of(model: AxisModel, is_double: bool) -> Any:
    """Return the cell's model for one kind of support."""
    return model.double if is_double else model.single


def simulate(model: AxisModel, problem: PreviewProblem, inputs: Array) -> Array:
    """Return the states step by step, without any prediction matrix."""
    states = [problem.state]
    for is_double, command in zip(problem.is_double, inputs, strict=True):
        cell = cell_of(model, is_double)
        states.append(cell.transition @ states[-1] + cell.input * command)
    return np.array(states)


def ideal_commands(model: AxisModel, problem: PreviewProblem, states: Array) -> Array:
    """Return the CoP that the feedback wants in each cell."""
    return np.array(
        [
            problem.input_reference[k]
            - cell_of(model, is_double).gain @ (states[k] - problem.state_reference[k])
            for k, is_double in enumerate(problem.is_double)
        ]
    )


def row_distance(
    row: SupportRow, problem: PreviewProblem, states: Array, inputs: Array, d: Array
) -> float:
    """Return the CoP's distance from a mean sole, the soles carried by the ball."""
    ball = states[:, BALL]
    middle = 0.5 * (ball[row.cell] + ball[row.cell + 1])
    place = row.standing + row.standing_weight * 2.0 * (middle - ball[0])
    for weight, cell, offset in zip(
        row.landings, problem.landing_cells, d, strict=True
    ):
        place += weight * (offset + ball[cell] + 2.0 * (middle - ball[cell]))
    return float(inputs[row.cell] - place)


def separation(
    row: SeparationRow, problem: PreviewProblem, states: Array, d: Array
) -> float:
    """Return the signed distance of a landing foot from the other one."""
    ball = states[:, BALL]
    cell = problem.landing_cells[row.landing]
    if row.other < 0:
        other = row.standing + 2.0 * (ball[cell] - ball[0])
    else:
        landed = problem.landing_cells[row.other]
        other = d[row.other] + ball[landed] + 2.0 * (ball[cell] - ball[landed])
    return float(row.sign * (d[row.landing] + ball[cell] - other))


def margins(
    model: AxisModel, problem: PreviewProblem, inputs: Array, d: Array
) -> Array:
    """Return how far every constraint is from being violated."""
    states = simulate(model, problem, inputs)
    values = []
    for row in problem.rows:
        distance = row_distance(row, problem, states, inputs, d)
        values += [distance - row.lower, row.upper - distance]
    for item in problem.separations:
        values.append(separation(item, problem, states, d) - item.minimum)
    lower, upper = np.array(problem.landing_lower), np.array(problem.landing_upper)
    return np.concatenate((values, d - lower, upper - d))


def walking_problem(
    half: float = 0.06, state: Array | None = None, size: int = 16, weight: float = 1.0
) -> PreviewProblem:
    """Return a horizon with both kinds of support, two landings and all rows.

    Cells 0-3 on both feet, 4-8 on the first, which stands, 9-11 on both, from
    12 on the landed foot alone while the first one swings, landing at 15.
    """
    is_double = tuple(k < 4 or 9 <= k < 12 or k == 15 for k in range(size))
    spans = (
        (range(4), 0.01, 1.0, (0.0, 0.0), half + 0.02),
        (range(4, 9), 0.03, 1.0, (0.0, 0.0), half),
        (range(9, 12), 0.015, 0.5, (0.5, 0.0), half),
        (range(12, 15), 0.0, 0.0, (1.0, 0.0), half),
        (range(15, size), 0.0, 0.0, (0.5, 0.5), half),
    )
    rows = [
        SupportRow(k, standing, weight_now, shares, -reach, reach)
        for cells, standing, weight_now, shares, reach in spans
        for k in cells
    ]
    if state is None:
        state = np.array([0.02, 0.05, 0.01, 0.04, 0.02, 0.005, -0.02])
    time = 0.02 * np.arange(size)
    reference = np.zeros((size, STATE_SIZE))
    reference[:, [0, 2, 4]] = (0.05 * time)[:, None]
    reference[:, [1, 3]] = 0.05
    return PreviewProblem(
        is_double=is_double,
        state=state,
        state_reference=reference,
        input_reference=0.05 * time + 0.001,
        rows=rows,
        landing_cells=(9, 15),
        landing_nominal=(0.02, -0.01),
        landing_lower=(-0.2, -0.2),
        landing_upper=(0.2, 0.2),
        landing_weights=(weight, weight),
    )


def solve(model: AxisModel, problem: PreviewProblem) -> PreviewSolution:
    """Return the preview's solution."""
    return AxisPreview(model, len(problem.is_double)).solve(problem)


@pytest.mark.parametrize("radius", [0.25, 0.5, 1.0])
def test_without_active_bound_the_feedback_remains(
    axis: AxisFactory, radius: float
) -> None:
    """Where no sole limits the CoP it is the placed feedback in every cell."""
    model = axis(radius).model
    problem = walking_problem(half=10.0)
    solution = solve(model, problem)
    states = simulate(model, problem, solution.inputs)
    assert solution.is_solved
    ideal = ideal_commands(model, problem, states)
    assert np.abs(ideal).max() > 0.02
    np.testing.assert_allclose(solution.inputs, ideal, atol=2e-5)
    np.testing.assert_allclose(solution.landings, problem.landing_nominal, atol=1e-9)


def test_first_command_is_the_ideal_cop(axis: AxisFactory) -> None:
    """The reported ideal CoP is u_ref - K (z - z_ref) of the first cell."""
    model, plain = axis(0.5).model, walking_problem()
    for first in (True, False):
        problem = replace(plain, is_double=(first, *plain.is_double[1:]))
        gain = cell_of(model, first).gain
        expected = 0.001 - gain @ (problem.state - problem.state_reference[0])
        found = AxisPreview(model, 16).ideal_cop(problem)
        assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("radius", [0.25, 0.5, 1.0])
def test_prediction_is_the_motion_step_by_step(
    axis: AxisFactory, radius: float
) -> None:
    """The predicted states are those of the two models cell after cell."""
    model = axis(radius).model
    for half in (10.0, 0.02):
        problem = walking_problem(half)
        solution = solve(model, problem)
        assert solution.states.shape == (17, STATE_SIZE)
        np.testing.assert_allclose(
            solution.states, simulate(model, problem, solution.inputs), atol=1e-9
        )


@pytest.mark.parametrize("half", [0.02, 0.035, 0.06])
def test_bounds_hold_at_the_solution(axis: AxisFactory, half: float) -> None:
    """The CoP stays in the soles and the landings within reach, to 0.1 mm."""
    model = axis(0.5).model
    for seed in range(10):
        state = np.random.default_rng(seed).normal(
            size=STATE_SIZE, scale=[0.01, 0.02, 0.01, 0.02, 0.01, 0.005, 0.01]
        )
        problem = walking_problem(half, state)
        solution = solve(model, problem)
        assert solution.is_solved
        margin = margins(model, problem, solution.inputs, solution.landings)
        assert margin.min() > -1e-4
    if half == 0.02:
        assert np.sum(np.abs(margin) < 1e-5) > 3  # some bounds are met


def separated(problem: PreviewProblem, minimum: float = 0.12) -> PreviewProblem:
    """Return the problem with distances that the nominal landings do not keep."""
    return replace(
        problem,
        separations=(
            SeparationRow(0, -1, 0.03, 1.0, minimum),
            SeparationRow(1, 0, 0.0, -1.0, minimum),
        ),
    )


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("half", [0.02, 0.06])
def test_solution_is_that_of_another_solver(
    axis: AxisFactory, half: float, apart: bool
) -> None:
    """Simulated cost and constraints, handed to SLSQP, have the same minimum."""
    model = axis(0.5).model
    problem = walking_problem(half)
    if apart:
        problem = separated(problem)
    solution = solve(model, problem)
    n = len(problem.is_double)

    # Everything is quadratic or affine: sample it exactly.
    def sampled(function: Callable[[Array, Array], Any]) -> tuple[Array, Array]:
        zero = np.zeros(n + 2)
        base = np.asarray(function(zero[:n], zero[n:]))
        columns = [
            np.asarray(function(unit[:n], unit[n:])) - base for unit in np.eye(n + 2)
        ]
        return base, np.array(columns).T

    def residual(inputs: Array, d: Array) -> Array:
        states = simulate(model, problem, inputs)
        shift = np.sqrt(problem.landing_weights) * (d - problem.landing_nominal)
        return np.concatenate((inputs - ideal_commands(model, problem, states), shift))

    offset, matrix = sampled(residual)
    limit, slope = sampled(lambda u, d: margins(model, problem, u, d))

    def cost(x: Array) -> float:
        return 0.5 * float(np.sum((offset + matrix @ x) ** 2))

    found = scipy.optimize.minimize(
        cost,
        np.zeros(n + 2),
        jac=lambda x: matrix.T @ (offset + matrix @ x),
        constraints={
            "type": "ineq",
            "fun": lambda x: limit + slope @ x,
            "jac": lambda _: slope,
        },
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert found.success
    ours = np.concatenate((solution.inputs, solution.landings))
    assert cost(ours) == pytest.approx(found.fun, rel=0.01, abs=1e-8)
    np.testing.assert_allclose(ours, found.x, atol=5e-4)
    if half == 0.02 or apart:
        assert np.abs(found.x[n:] - problem.landing_nominal).max() > 1e-3


@pytest.mark.parametrize("index", [0, 1])
def test_feet_keep_their_distance(axis: AxisFactory, index: int) -> None:
    """A landing foot keeps the least distance from the other, standing or landed."""
    model = axis(0.5).model
    plain = walking_problem(0.06)
    row = separated(plain).separations[index]
    problem = replace(plain, separations=(row,))
    free = solve(model, plain)
    assert separation(row, problem, free.states, free.landings) < 0.08
    solution = solve(model, problem)
    distance = separation(row, problem, solution.states, solution.landings)
    assert distance == pytest.approx(0.12, abs=1e-4)
    assert row.sign * (solution.landings[index] - free.landings[index]) > 0.01
    both = solve(model, separated(plain))
    for item in separated(plain).separations:
        assert separation(item, problem, both.states, both.landings) > 0.12 - 1e-4


def test_dear_landings_stay_nominal(axis: AxisFactory) -> None:
    """The dearer a landing offset, the nearer to nominal it stays, CoP aside."""
    model = axis(0.5).model
    shifts = []
    for weight in (1e-3, 1.0, 1e3, 1e6):
        problem = walking_problem(half=0.02, weight=weight)
        solution = solve(model, problem)
        shifts.append(np.abs(solution.landings - problem.landing_nominal).max())
    assert shifts[0] > shifts[1] > shifts[2] > shifts[3]
    assert shifts[0] > 0.005
    assert shifts[3] < 1e-5


def test_landing_bounds_are_hard(axis: AxisFactory) -> None:
    """A landing bound is kept exactly, even where a sole must then be left."""
    model = axis(0.5).model
    state = np.array([0.2, 0.8, 0.0, 0.5, 0.2, 0.0, 0.0])
    problem = replace(
        walking_problem(half=0.02, state=state),
        landing_lower=(-0.05, -0.05),
        landing_upper=(0.05, 0.05),
    )
    solution = solve(model, problem)
    assert solution.is_solved
    assert np.abs(solution.landings).max() <= 0.05 + 1e-9
    assert np.abs(solution.landings).max() > 0.05 - 1e-6


def moved(problem: PreviewProblem, shift: float) -> PreviewProblem:
    """Return the problem somewhere else on the floor."""
    direction = np.zeros(STATE_SIZE)
    direction[[0, BALL, 4]] = shift
    return replace(
        problem,
        state=problem.state + direction,
        state_reference=problem.state_reference + direction,
        input_reference=problem.input_reference + shift,
        rows=[
            replace(row, standing=row.standing + row.standing_weight * shift)
            for row in problem.rows
        ],
        separations=[
            replace(row, standing=row.standing + shift) for row in problem.separations
        ],
    )


def test_place_on_the_floor_does_not_matter(axis: AxisFactory) -> None:
    """Moving everything moves the CoP and leaves the landing offsets."""
    model = axis(0.5).model
    problem = separated(walking_problem(0.03))
    here, there = solve(model, problem), solve(model, moved(problem, 1.5))
    np.testing.assert_allclose(there.inputs, here.inputs + 1.5, atol=1e-5)
    np.testing.assert_allclose(there.landings, here.landings, atol=1e-5)


def test_solving_leaves_no_trace(axis: AxisFactory) -> None:
    """The same problem has the same bits, whatever was solved in between."""
    model = axis(0.5).model
    preview = AxisPreview(model, 16)
    first = preview.solve(walking_problem(0.03))
    preview.solve(separated(walking_problem(0.02)))
    preview.solve(replace(walking_problem(), is_double=(True,) * 16))
    again = preview.solve(walking_problem(0.03))
    assert again.inputs.tobytes() == first.inputs.tobytes()
    assert again.landings.tobytes() == first.landings.tobytes()


@pytest.mark.parametrize("answer", ["gives up", "not a number"])
def test_fallback_is_finite_feedback(
    axis: AxisFactory, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    """Without a solution the plan is the feedback itself and says so."""
    model = axis(0.5).model
    problem = walking_problem(half=0.02)

    def fail(hessian: Array, *_: Any) -> tuple[Array, float, int, dict[str, Any]]:
        gives_up = answer == "gives up"
        filler = 0.0 if gives_up else np.nan
        return np.full(len(hessian), filler), 0.0, -1 if gives_up else 1, {}

    monkeypatch.setattr(preview_module, "daqp", SimpleNamespace(solve=fail))
    solution = solve(model, problem)
    assert not solution.is_solved
    states = simulate(model, problem, solution.inputs)
    np.testing.assert_allclose(solution.states, states, atol=1e-9)
    np.testing.assert_allclose(
        solution.inputs, ideal_commands(model, problem, states), atol=1e-12
    )
    np.testing.assert_allclose(solution.landings, problem.landing_nominal)
    assert np.isfinite(solution.states).all()


def test_contradictory_bounds_fall_back(axis: AxisFactory) -> None:
    """Landing bounds that exclude each other end in the fallback, not in an error."""
    model = axis(0.5).model
    problem = replace(
        walking_problem(), landing_lower=(0.1, 0.1), landing_upper=(-0.1, -0.1)
    )
    solution = solve(model, problem)
    assert not solution.is_solved
    assert np.isfinite(solution.inputs).all()
    assert np.isfinite(solution.landings).all()


def test_impossible_support_is_left_at_a_price(axis: AxisFactory) -> None:
    """Soles that exclude each other are soft: the preview still has an answer."""
    problem = walking_problem(half=0.02)
    row = replace(problem.rows[0], lower=0.5, upper=0.6)
    problem = replace(problem, rows=[*problem.rows, row])
    solution = solve(axis(0.5).model, problem)
    assert solution.is_solved
    assert np.abs(solution.landings).max() <= 0.2 + 1e-9
