"""Laws of the schedule: the cheapest choice wins, a good plan is kept, none waits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import pytest

from ballsim_controllers.footsteps.gait import LEFT, RIGHT, GaitClock, GaitTiming
from ballsim_controllers.footsteps.schedule import StepSchedule
from ballsim_controllers.footsteps.timeline import Timeline, Timelines
from ballsim_controllers.frontal.sway import compute_sway
from ballsim_controllers.settings import WheeledLipSettings, load_settings

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

CELL, DOUBLE, SINGLE = 0.02, 6, 11
OPEN_EFFORT, FAST_EFFORT = 0.005, 0.04
SLOW, FAST = 0.3, 0.31
DT = 0.005
TIMING = GaitTiming(
    single_support=SINGLE * CELL,
    double_support=DOUBLE * CELL,
    earliest_touchdown=0.6,
    touchdown_force=15.0,
    latest_touchdown=0.15,
)
LOADED = (300.0, 300.0)
SETTINGS = replace(
    load_settings(WheeledLipSettings, "wheeled-lip", {}).gait,
    reschedule_effort_m2=OPEN_EFFORT,
    reschedule_time_s=DOUBLE * CELL,
    reschedule_swing_s=2 * CELL,
    fast_speed_m_s=SLOW,
    fast_effort_m2=FAST_EFFORT,
)


@dataclass(frozen=True)
class Price:
    """A plan of which only the effort is known."""

    effort: float
    timeline: Timeline


@pytest.fixture
def timelines(axis: Callable[[float], PlainAxis]) -> Timelines:
    """Return the timelines of this gait."""
    return Timelines(compute_sway(axis(0.5).model, 0.06, DOUBLE, SINGLE), 40, CELL)


def make_schedule(timelines: Timelines) -> StepSchedule:
    """Return the schedule."""
    return StepSchedule(timelines, TIMING, SETTINGS, CELL)


def first_swing(timeline: Timeline) -> tuple[int, int]:
    """Return which foot swings first, and after how many cells of double support."""
    cells = list(timeline.is_double).index(False)
    return (LEFT if timeline.cells[cells].left is None else RIGHT), cells


def first_landing(timeline: Timeline) -> int:
    """Return for how many cells the first foot swings."""
    return timeline.landings[0].cell - first_swing(timeline)[1]


def pricing(prices: dict[tuple[int, int], float]) -> Callable[[Timeline], Any]:
    """Return a planner that asks 1 m^2 but for some choices."""
    return lambda timeline: Price(prices.get(first_swing(timeline), 1.0), timeline)


def started(first: int = RIGHT) -> GaitClock:
    """Return a clock at the start of its first double support."""
    clock = GaitClock(TIMING)
    clock.start(first, DOUBLE * CELL)
    return clock


def revise(
    clock: GaitClock,
    timelines: Timelines,
    make_plan: Callable[[Timeline], Any],
    speed: float = SLOW,
) -> tuple[Any, Timeline]:
    """Revise the schedule of a clock."""
    timeline = timelines.look_up(clock)
    plan = make_plan(timeline)
    return make_schedule(timelines).revise(clock, plan, timeline, make_plan, speed)


@pytest.mark.parametrize("foot", [LEFT, RIGHT])
@pytest.mark.parametrize("cells", [1, 3, 6])
def test_cheapest_choice_wins(timelines: Timelines, foot: int, cells: int) -> None:
    """Clock, plan and timeline are those of the cheapest foot and time."""
    clock = started()
    make_plan = pricing({(foot, cells): 0.01, (LEFT, 2): 0.02})
    plan, timeline = revise(clock, timelines, make_plan)
    assert first_swing(timeline) == (foot, cells)
    assert plan.timeline is timeline is timelines.look_up(clock)
    assert clock.next_swing == foot
    assert clock.remaining == pytest.approx(cells * CELL)


@pytest.mark.parametrize("swing", [SINGLE, SINGLE - 1, SINGLE - 2])
def test_shorter_swing_is_taken_where_it_costs_less(
    timelines: Timelines, swing: int
) -> None:
    """Once: the foot lands in its time, and the next swing lasts as long as ever."""

    def make_plan(timeline: Timeline) -> Any:
        is_cheap = first_landing(timeline) == swing
        return Price(0.01 if is_cheap else 0.02, timeline)

    clock = started()
    _, timeline = revise(clock, timelines, make_plan)
    assert first_landing(timeline) == swing
    assert timeline is timelines.look_up(clock)
    while not clock.advance(DT, LOADED, hold=False):
        pass
    assert clock.duration == pytest.approx(swing * CELL)
    assert timelines.look_up(clock).landings[0].cell == swing
    assert timelines.look_up(clock).lift_cells[0] == 0
    assert clock.swing_duration == TIMING.single_support


def test_no_swing_is_shorter_than_allowed(timelines: Timelines) -> None:
    """Plans are asked for swings from the shortest to that of the regular gait."""
    seen: set[int] = set()

    def make_plan(timeline: Timeline) -> Any:
        seen.add(first_landing(timeline))
        return Price(1.0, timeline)

    revise(started(), timelines, make_plan)
    assert seen == {SINGLE - 2, SINGLE - 1, SINGLE}


@pytest.mark.parametrize(
    ("speed", "effort"), [(SLOW, OPEN_EFFORT), (FAST, FAST_EFFORT)]
)
def test_good_plan_is_kept(timelines: Timelines, speed: float, effort: float) -> None:
    """The regular gait goes on up to the effort of its speed, and not beyond."""
    clock = started()
    before = clock.duration
    make_plan = pricing({(RIGHT, DOUBLE): effort, (LEFT, 1): 0.0})
    plan, timeline = revise(clock, timelines, make_plan, speed)
    assert plan.effort == effort
    assert first_swing(timeline) == (RIGHT, DOUBLE)
    assert (clock.next_swing, clock.duration) == (RIGHT, before)
    make_plan = pricing({(RIGHT, DOUBLE): 1.01 * effort, (LEFT, 1): 0.0})
    revise(clock, timelines, make_plan, speed)
    assert clock.next_swing == LEFT


def test_equal_price_changes_nothing(timelines: Timelines) -> None:
    """Where all choices cost the same the present one stays."""
    clock = started(LEFT)
    _, timeline = revise(clock, timelines, pricing({}))
    assert first_swing(timeline) == (LEFT, DOUBLE)


def test_double_support_ends(timelines: Timelines) -> None:
    """Where waiting always looks best the foot leaves after twice the regular time."""
    clock, time = started(), 0.0
    waiting = pricing({(RIGHT, DOUBLE): 0.01})
    while clock.swing_foot is None:
        assert time <= 2.0 * DOUBLE * CELL + 0.5 * DT
        revise(clock, timelines, waiting)
        clock.advance(DT, LOADED, hold=False)
        time += DT
    assert time > 1.5 * DOUBLE * CELL


@pytest.mark.parametrize("foot", [LEFT, RIGHT])
def test_standing_robot_swings_the_cheaper_foot_first(
    timelines: Timelines, foot: int
) -> None:
    """Whatever its best time is, the foot with the cheapest plan goes."""
    make_plan = pricing({(foot, 2): 0.1, (1 - foot, 5): 0.2})
    assert make_schedule(timelines).begin(make_plan) == foot
