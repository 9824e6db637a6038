"""Laws of the preview of CoP and footholds along one axis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import daqp
import numpy as np
import pytest
import scipy.optimize
from tests.controllers.preview_cases import (
    Case,
    cell_of,
    ideal_commands,
    margins,
    separated,
    separation,
    simulate,
    solve,
    walking_problem,
)

from ballsim_controllers.body_pendulum import BALL, STATE_SIZE
from ballsim_controllers.footsteps.preview import AxisPreview, PreviewProblem
from ballsim_controllers.messages import Array

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

AxisFactory = Callable[[float], "PlainAxis"]


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
        problem = plain.restructured(is_double=(first, *plain.is_double[1:]))
        gain = cell_of(model, first).gain
        expected = 0.001 - gain @ (problem.state - problem.state_reference[0])
        found = solve(model, problem)
        assert found.ideal_cop == pytest.approx(expected, abs=1e-12)


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
        shift = np.sqrt(problem.structure.landing_weights) * (
            d - problem.landing_nominal
        )
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
    row = separated(plain).structure.separations[index]
    problem = plain.restructured(separations=(row,))
    free = solve(model, plain)
    assert separation(row, problem, free.states, free.landings) < 0.08
    solution = solve(model, problem)
    distance = separation(row, problem, solution.states, solution.landings)
    assert distance == pytest.approx(0.12, abs=1e-4)
    assert row.sign * (solution.landings[index] - free.landings[index]) > 0.01
    both = solve(model, separated(plain))
    for item in separated(plain).structure.separations:
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
    problem = walking_problem(half=0.02, state=state).restructured(
        landing_lower=(-0.05, -0.05),
        landing_upper=(0.05, 0.05),
    )
    solution = solve(model, problem)
    assert solution.is_solved
    assert np.abs(solution.landings).max() <= 0.05 + 1e-9
    assert np.abs(solution.landings).max() > 0.05 - 1e-6


def moved(problem: Case, shift: float) -> Case:
    """Return the problem somewhere else on the floor."""
    direction = np.zeros(STATE_SIZE)
    direction[[0, BALL, 4]] = shift
    return replace(
        problem,
        state=problem.state + direction,
        state_reference=problem.state_reference + direction,
        input_reference=problem.input_reference + shift,
        soles=problem.soles + shift,
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
    plain = separated(walking_problem(0.03))
    preview = AxisPreview(axis(0.5).model, plain.structure)
    first = plain.solve(preview)
    for seed in range(5):
        state = 0.05 * np.random.default_rng(seed).normal(size=STATE_SIZE)
        replace(plain, state=state).solve(preview)
    again = plain.solve(preview)
    assert again.inputs.tobytes() == first.inputs.tobytes()
    assert again.landings.tobytes() == first.landings.tobytes()
    assert again.command == first.command


def test_summary_numbers_are_those_of_the_motion(axis: AxisFactory) -> None:
    """The command is the first CoP; the effort is the cost at the solution."""
    for half in (0.02, 0.06):
        problem = walking_problem(half)
        found = solve(axis(0.5).model, problem)
        assert found.command == pytest.approx(found.inputs[0], abs=1e-12)
        assert found.inputs[0] - found.ideal_cop == pytest.approx(
            found.deviations[0], abs=1e-12
        )
        ideal = ideal_commands(axis(0.5).model, problem, found.states)
        apart = found.landings - problem.landing_nominal
        expected = np.sum((found.inputs - ideal) ** 2) + np.sum(apart**2)
        assert found.effort == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_harder_push_takes_more_effort(axis: AxisFactory) -> None:
    """The effort tells which of two situations is the worse one."""
    efforts = []
    for push in (0.0, 0.2, 0.4, 0.8):
        state = np.array([0.05, push, 0.0, 0.0, 0.0, 0.0, 0.0])
        efforts.append(solve(axis(0.5).model, walking_problem(0.03, state)).effort)
    assert efforts == sorted(efforts)
    assert efforts[-1] > 2.0 * efforts[0] > 0.0


def test_next_landing_keeps_its_range(axis: AxisFactory) -> None:
    """Where the swinging foot can still go bounds the next landing, and no other."""
    model, plain = axis(0.5).model, walking_problem(0.02)
    preview = AxisPreview(model, plain.structure)
    free = plain.solve(preview).landings
    for low, high in ((free[0] + 0.02, free[0] + 0.03), (-1.0, free[0] - 0.01)):
        problem = PreviewProblem(
            state=plain.state,
            reference=preview.refer(plain.state_reference, plain.input_reference),
            soles=plain.soles,
            swing=np.zeros(3),
            landing_nominal=plain.landing_nominal,
            landing_range=(low, high),
        )
        landings = preview.solve(problem).landings
        assert low - 1e-9 <= landings[0] <= high + 1e-9
        assert abs(landings[0] - free[0]) < 0.04
    np.testing.assert_array_equal(plain.solve(preview).landings, free)


@pytest.mark.parametrize("answer", ["gives up", "not a number"])
def test_fallback_is_finite_feedback(
    axis: AxisFactory, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    """Without a solution the plan is the feedback itself and says so."""

    class Failing(daqp.Model):
        def solve(self) -> tuple[Array, float, int, dict[str, Any]]:
            gives_up = answer == "gives up"
            return np.full(18, 0.0 if gives_up else np.nan), 0.0, 1 - 2 * gives_up, {}

    monkeypatch.setattr(daqp, "Model", Failing)
    model = axis(0.5).model
    problem = walking_problem(half=0.02)
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
    problem = walking_problem().restructured(
        landing_lower=(0.1, 0.1), landing_upper=(-0.1, -0.1)
    )
    solution = solve(model, problem)
    assert not solution.is_solved
    assert np.isfinite(solution.inputs).all()
    assert np.isfinite(solution.landings).all()


def test_impossible_support_is_left_at_a_price(axis: AxisFactory) -> None:
    """Soles that exclude each other are soft: the preview still has an answer."""
    problem = walking_problem(half=0.02)
    row = replace(problem.structure.rows[0], lower=0.5, upper=0.6)
    problem = problem.restructured(rows=(*problem.structure.rows, row))
    solution = solve(axis(0.5).model, problem)
    assert solution.is_solved
    assert np.abs(solution.landings).max() <= 0.2 + 1e-9
