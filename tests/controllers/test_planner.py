"""Laws of the footstep planner: which CoP and footholds it looks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ballsim_controllers.body_pendulum import BALL, STATE_SIZE, SettledMotion
from ballsim_controllers.footsteps.axis_model import AxisModel
from ballsim_controllers.footsteps.gait import LEFT, RIGHT
from ballsim_controllers.footsteps.planner import FootstepPlanner, Plan
from ballsim_controllers.footsteps.planner_limits import PlannerLimits
from ballsim_controllers.footsteps.side_steps import LateralMotion
from ballsim_controllers.footsteps.stride import compute_stride
from ballsim_controllers.footsteps.timeline import Cell, Landing, Timeline
from ballsim_controllers.messages import Array

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

AxisFactory = Callable[..., "PlainAxis"]

LIMITS = PlannerLimits(
    half_length=0.085,
    half_width=0.035,
    sagittal_reserve=0.6,
    lateral_reserve=0.6,
    reserve_cells=4,
    nominal_lateral=0.06,
    sagittal_reach=0.2,
    lateral_inward=0.01,
    lateral_outward=0.05,
    separation=0.1,
    sagittal_weight=0.3,
    lateral_weight=1.0,
)
CELLS = 34


def walking_timeline(first: int = RIGHT, double: int = 6, single: int = 11) -> Timeline:
    """Return double support, a swing of one foot, double support, the other's swing."""
    other = 1 - first

    def cell(places: dict[int, int | None]) -> Cell:
        return Cell(left=places[LEFT], right=places[RIGHT])

    places: dict[int, int | None] = {LEFT: -1, RIGHT: -1}
    cells = [cell(places)] * double
    places[first] = None
    cells += [cell(places)] * single
    places[first] = 0
    cells += [cell(places)] * double
    places[other] = None
    cells += [cell(places)] * single
    return Timeline(
        cells=tuple(cells),
        landings=(Landing(first, double + single),),
        sway_states=np.zeros((CELLS, STATE_SIZE)),
        sway_inputs=np.zeros(CELLS),
        phases=np.tile(np.arange(double + single), 2)[:CELLS],
    )


def make_planner(model: AxisModel, limits: PlannerLimits = LIMITS) -> FootstepPlanner:
    """Return a planner with one model for both axes; feet are not lifted."""
    stride = compute_stride(model, 6, (0.0,) * 11)
    return FootstepPlanner(model, model, limits, stride)


def make_plan(
    axis: AxisFactory,
    timeline: Timeline,
    states: Array,
    soles: Array,
    velocity: float = 0.0,
    limits: PlannerLimits = LIMITS,
) -> Plan:
    """Return a plan about a reference that rolls at a constant velocity."""
    plain = axis(0.5)
    planner = make_planner(plain.model, limits)
    time = 0.02 * np.arange(CELLS)
    motion = np.column_stack(
        (velocity * time, np.full(CELLS, velocity), np.zeros(CELLS))
    )
    reference, inputs = SettledMotion(plain.params, 0.02).follow(motion)
    return planner.plan(timeline, states, soles, reference, inputs, 0.23)


SOLES = np.array([[0.01, 0.06], [-0.01, -0.06]])


def test_reserve_grows_with_the_time_ahead() -> None:
    """The first cell has the whole sole, a distant one what the reserve leaves."""
    limits = replace(LIMITS, lateral_reserve=0.8)
    halves = np.array([limits.usable(k) for k in range(8)])
    shares = np.array([1.0, 0.85, 0.7, 0.55, 0.4, 0.4, 0.4, 0.4])
    assert halves[:, 0] == pytest.approx(0.085 * shares)
    assert halves[:, 1] == pytest.approx(0.035 * (1.0 - (1.0 - shares) / 0.6 * 0.8))
    assert replace(limits, reserve_cells=0).usable(0) == pytest.approx((0.034, 0.007))
    assert replace(limits, sagittal_reserve=0.0).usable(7)[0] == 0.085


def test_without_a_reserve_the_plan_costs_less(axis: AxisFactory) -> None:
    """A tighter sole leaves a smaller choice, so what is minimised cannot fall."""
    generator = np.random.default_rng(2)
    timeline = walking_timeline()
    dearer = 0
    for _ in range(10):
        states = generator.normal(size=(2, STATE_SIZE), scale=0.02)
        efforts = [
            make_plan(
                axis,
                timeline,
                states,
                SOLES,
                limits=replace(LIMITS, sagittal_reserve=share, lateral_reserve=share),
            ).effort
            for share in (0.0, 0.3, 0.6)
        ]
        assert efforts[0] <= efforts[1] + 1e-9
        assert efforts[1] <= efforts[2] + 1e-9
        dearer += efforts[2] > efforts[0] + 1e-6
    assert dearer > 0


def test_planned_cop_stays_in_the_standing_soles(axis: AxisFactory) -> None:
    """In every cell the CoP keeps to the hull of the soles, less the reserve."""
    generator = np.random.default_rng(0)
    timeline = walking_timeline()
    for _ in range(5):
        states = generator.normal(size=(2, STATE_SIZE), scale=0.01)
        states[:, [1, 3]] *= 2.0
        plan = make_plan(axis, timeline, states, SOLES)
        assert plan.landing is not None
        for axis_index, solution in enumerate((plan.sagittal, plan.lateral)):
            assert solution.is_solved
            ball = solution.states[:, BALL]
            landed = solution.landings[0] + ball[17]
            for k, cell in enumerate(timeline.cells):
                middle = 0.5 * (ball[k] + ball[k + 1])
                feet = []
                for foot, place in ((LEFT, cell.left), (RIGHT, cell.right)):
                    if place == -1:
                        sole = SOLES[foot, axis_index]
                        feet.append(sole + 2.0 * (middle - ball[0]))
                    elif place == 0:
                        feet.append(landed + 2.0 * (middle - ball[17]))
                usable = LIMITS.usable(k)[axis_index] + 1e-4
                command = solution.inputs[k]
                assert min(feet) - usable <= command <= max(feet) + usable


def test_planned_feet_land_within_reach(axis: AxisFactory) -> None:
    """A landing foot stays on its side, within reach and clear of the other one."""
    generator = np.random.default_rng(1)
    for first, sign in ((RIGHT, -1.0), (LEFT, 1.0)):
        timeline = walking_timeline(first)
        for _ in range(5):
            states = generator.normal(size=(2, STATE_SIZE), scale=0.02)
            states[:, [1, 3]] *= 3.0
            plan = make_plan(axis, timeline, states, SOLES)
            assert plan.landing is not None
            sagittal, lateral = plan.landing
            assert abs(sagittal) <= LIMITS.sagittal_reach + 1e-9
            assert 0.05 - 1e-9 <= sign * lateral <= 0.11 + 1e-9
            ball = plan.lateral.states[:, BALL]
            other = SOLES[1 - first, 1] + 2.0 * (ball[17] - ball[0])
            assert sign * (lateral + ball[17] - other) > LIMITS.separation - 1e-3


@pytest.mark.parametrize("first", [LEFT, RIGHT])
@pytest.mark.parametrize(("push", "expected"), [(0.3, 0.05), (-0.3, 0.11)])
def test_lateral_landing_is_bounded_both_ways(
    axis: AxisFactory, first: int, push: float, expected: float
) -> None:
    """A roll to either side moves the landing back, to its bound and no farther.

    The ball will carry the sole on, so it lands behind.
    """
    side = 1.0 if first == LEFT else -1.0
    states = np.zeros((2, STATE_SIZE))
    states[1, [1, 3]] = side * push
    free = replace(LIMITS, separation=0.0, lateral_weight=1e-3)
    plan = make_plan(axis, walking_timeline(first), states, SOLES, limits=free)
    assert plan.landing is not None
    assert side * plan.landing[1] == pytest.approx(expected, abs=1e-6)


def test_sagittal_landing_leads_by_half_a_stance(axis: AxisFactory) -> None:
    """At constant speed a foot lands so that the reference CoP passes its middle.

    The sole is carried at the ball's speed relative to the ball: half a single
    support and a double support later it is below the CoP.
    """
    for velocity in (0.1, -0.1):
        timeline = walking_timeline()
        states = np.zeros((2, STATE_SIZE))
        states[0, [1, 3]] = velocity
        dear = replace(LIMITS, sagittal_weight=1e6)
        plan = make_plan(axis, timeline, states, SOLES, velocity, dear)
        assert plan.landing is not None
        # The command leads the CoP by its lag.
        expected = (0.02 - 0.23) * velocity
        assert plan.landing[0] == pytest.approx(expected, abs=1e-4)


def test_mirrored_plan(axis: AxisFactory) -> None:
    """Exchanging left and right reflects CoP and landing, and leaves the sagittal."""
    generator = np.random.default_rng(2)
    states = generator.normal(size=(2, STATE_SIZE), scale=0.02)
    plan = make_plan(axis, walking_timeline(RIGHT), states, SOLES)
    image = make_plan(
        axis,
        walking_timeline(LEFT),
        np.vstack((states[0], -states[1])),
        (SOLES * [1.0, -1.0])[::-1],
    )
    assert plan.landing is not None
    assert image.landing is not None
    np.testing.assert_allclose(image.lateral.inputs, -plan.lateral.inputs, atol=1e-7)
    np.testing.assert_allclose(image.sagittal.inputs, plan.sagittal.inputs, atol=1e-7)
    np.testing.assert_allclose(image.landing, plan.landing * [1.0, -1.0], atol=1e-7)
    np.testing.assert_allclose(image.ideal_cop, plan.ideal_cop * [1.0, -1.0], atol=1e-9)


def test_standing_plan_has_no_landing(axis: AxisFactory) -> None:
    """While the robot stands no foot lands, and a centred CoP is the feedback's."""
    timeline = Timeline(
        (Cell(-1, -1),) * CELLS,
        (),
        np.zeros((CELLS, STATE_SIZE)),
        np.zeros(CELLS),
        np.full(CELLS, -1),
    )
    states = np.zeros((2, STATE_SIZE))
    states[:, 0] = 0.003
    plan = make_plan(axis, timeline, states, SOLES)
    assert plan.landing is None
    first = [plan.sagittal.inputs[0], plan.lateral.inputs[0]]
    np.testing.assert_allclose(first, plan.ideal_cop, atol=1e-5)


def test_reference_motion_is_left_alone(axis: AxisFactory) -> None:
    """Standing feet aside, a robot on its reference goes on along it.

    The legs have no mass here; commands that are held over each cell cost 1 mm.
    """
    speed = 0.1
    limits = replace(LIMITS, half_length=10.0)
    states = np.zeros((2, STATE_SIZE))
    states[0, [1, 3]] = speed
    massless = partial(axis, leg=0.0)
    plan = make_plan(massless, walking_timeline(), states, SOLES, speed, limits)
    time = 0.02 * np.arange(CELLS)
    for place in (0, BALL, 4):
        found = plan.sagittal.states[:CELLS, place]
        np.testing.assert_allclose(found, speed * time, atol=1e-3)


@pytest.mark.parametrize("place", [0.0, -0.4, 2.0])
def test_lateral_plan_knows_no_place(axis: AxisFactory, place: float) -> None:
    """Robot, ball and a resting reference elsewhere give the plan in place, there."""
    plain, timeline = axis(0.5), walking_timeline()
    planner = make_planner(plain.model)
    rest = np.zeros((CELLS, STATE_SIZE)), np.zeros(CELLS)
    states = np.random.default_rng(5).normal(size=(2, STATE_SIZE), scale=0.02)
    in_place = planner.plan(timeline, states, SOLES, *rest, 0.23)
    moved = np.zeros(STATE_SIZE)
    moved[[0, BALL, 4]] = place
    there = states.copy()
    there[1] += moved
    motion = LateralMotion(rest[0] + moved, rest[1] + place, 0.34)
    soles = SOLES + np.array([0.0, place])
    plan = planner.plan(timeline, there, soles, *rest, 0.23, lateral_motion=motion)
    assert plan.command[1] - place == pytest.approx(in_place.command[1], abs=1e-6)
    assert plan.landing is not None
    assert in_place.landing is not None
    np.testing.assert_allclose(plan.landing, in_place.landing, atol=1e-6)
    again = planner.plan(timeline, states, SOLES, *rest, 0.23)
    assert again.lateral.command == in_place.lateral.command
