"""Laws of the timeline: what the gait clock foresees is what it will do."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ballsim_controllers.footsteps.gait import LEFT, RIGHT, GaitClock, GaitTiming
from ballsim_controllers.footsteps.timeline import Timeline, Timelines
from ballsim_controllers.frontal.sway import SwayReference, compute_sway
from ballsim_controllers.messages import GaitPhase

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

CELL, COUNT = 0.02, 40
DOUBLE, SINGLE = 6, 11
TIMING = GaitTiming(
    single_support=SINGLE * CELL,
    double_support=DOUBLE * CELL,
    earliest_touchdown=0.6,
    touchdown_force=15.0,
    latest_touchdown=0.15,
)
LOADED = (300.0, 300.0)
AxisFactory = Callable[[float], "PlainAxis"]


@pytest.fixture
def sway(axis: AxisFactory) -> SwayReference:
    """Return the periodic lateral reference of this gait."""
    return compute_sway(axis(0.5).model, 0.06, DOUBLE, SINGLE)


def foresee(clock: GaitClock, sway: SwayReference, count: int, cell: float) -> Timeline:
    """Return the timeline of a clock, made for it alone."""
    return Timelines(sway, count, cell).look_up(clock)


def in_the_air(clock: GaitClock) -> tuple[float, float]:
    """Return forces with the swinging foot unloaded until its swing is over."""
    foot = clock.swing_foot
    if foot is None or clock.remaining < 1.5 * CELL:
        return LOADED
    return (0.0, 600.0) if foot == LEFT else (600.0, 0.0)


def clock_after(cells: int, first: int = RIGHT) -> GaitClock:
    """Return a clock that has walked for a number of cells."""
    clock = GaitClock(TIMING)
    clock.start(first, DOUBLE * CELL)
    for _ in range(cells):
        clock.advance(CELL, in_the_air(clock), hold=False)
    return clock


def phase_of(timeline: Timeline, cell: int) -> GaitPhase:
    """Return the phase of a cell."""
    support = timeline.cells[cell]
    if support.left is None:
        return GaitPhase.RIGHT_SUPPORT
    return GaitPhase.LEFT_SUPPORT if support.right is None else GaitPhase.DOUBLE


def test_standing_foresees_standing(sway: SwayReference) -> None:
    """A robot that stands has both feet down, no landings, and a reference at rest."""
    timeline = foresee(GaitClock(TIMING), sway, COUNT, CELL)
    assert timeline.is_double == (True,) * COUNT
    assert {(cell.left, cell.right) for cell in timeline.cells} == {(-1, -1)}
    assert timeline.landings == ()
    assert not timeline.sway_states.any()
    assert not timeline.sway_inputs.any()


@pytest.mark.parametrize("first", [LEFT, RIGHT])
@pytest.mark.parametrize("cells", range(0, 40, 3))
def test_clock_does_what_the_timeline_foresees(
    sway: SwayReference, cells: int, first: int
) -> None:
    """Cell by cell the clock, its feet landing in time, has the foreseen support."""
    clock = clock_after(cells, first)
    timeline = foresee(clock, sway, COUNT, CELL)
    assert len(timeline.cells) == len(timeline.is_double) == COUNT
    for cell in range(COUNT):
        assert phase_of(timeline, cell) == clock.phase
        assert timeline.is_double[cell] == (clock.swing_foot is None)
        clock.advance(CELL, in_the_air(clock), hold=False)


@pytest.mark.parametrize("cells", range(0, 40, 3))
def test_landings_are_where_a_swing_ends(sway: SwayReference, cells: int) -> None:
    """Each foot swings before its landing, stands on it afterwards, in turns."""
    timeline = foresee(clock_after(cells), sway, COUNT, CELL)
    assert len(timeline.landings) >= 2
    feet = [landing.foot for landing in timeline.landings]
    assert feet == [feet[0] if i % 2 == 0 else 1 - feet[0] for i in range(len(feet))]
    for index, landing in enumerate(timeline.landings):
        before, after = timeline.cells[landing.cell - 1], timeline.cells[landing.cell]
        places = (before.left, after.left), (before.right, after.right)
        assert places[landing.foot] == (None, index)
        other = places[1 - landing.foot]
        assert other[0] == other[1] is not None
    gaps = np.diff([landing.cell for landing in timeline.landings])
    assert (gaps == DOUBLE + SINGLE).all()


@pytest.mark.parametrize("cells", range(0, 40, 3))
def test_first_phase_lasts_what_remains(sway: SwayReference, cells: int) -> None:
    """The present phase takes the cells that the clock has left, at least one."""
    clock = clock_after(cells)
    timeline = foresee(clock, sway, COUNT, CELL)
    length = 0
    while phase_of(timeline, length) == clock.phase:
        length += 1
    assert length == max(round(clock.remaining / CELL), 1)


@pytest.mark.parametrize("cells", range(40))
def test_feet_leave_the_ball_where_a_swing_begins(
    sway: SwayReference, cells: int
) -> None:
    """After a cell on both feet, or now if the clock has just lifted one."""
    clock = clock_after(cells)
    timeline = foresee(clock, sway, COUNT, CELL)
    single = [not both for both in timeline.is_double]
    begins = [k for k in range(1, COUNT) if single[k] and not single[k - 1]]
    is_now = clock.swing_foot is not None and clock.time_in_phase == 0.0
    assert list(timeline.lift_cells) == [0] * is_now + begins


def test_late_foot_is_foreseen_to_land_at_once(sway: SwayReference) -> None:
    """A swing that is overdue ends after one cell of the timeline."""
    clock = clock_after(DOUBLE)
    assert clock.swing_foot == RIGHT
    for _ in range(SINGLE + 3):
        clock.advance(CELL, (600.0, 0.0), hold=False)
    assert clock.phase == GaitPhase.LEFT_SUPPORT
    timeline = foresee(clock, sway, COUNT, CELL)
    assert timeline.landings[0].cell == 1
    assert timeline.landings[0].foot == RIGHT


def test_held_foot_is_foreseen_to_lift_at_once(sway: SwayReference) -> None:
    """A double support that is held beyond its end ends after one cell."""
    clock = GaitClock(TIMING)
    clock.start(LEFT, DOUBLE * CELL)
    for _ in range(2 * DOUBLE):
        clock.advance(CELL, LOADED, hold=True)
    timeline = foresee(clock, sway, COUNT, CELL)
    assert timeline.is_double[:2] == (True, False)
    assert timeline.cells[1].left is None


@pytest.mark.parametrize("cells", [0, 3, 6, 10, 17, 20, 25, 33])
@pytest.mark.parametrize("first", [LEFT, RIGHT])
def test_lateral_reference_is_one_motion_of_the_model(
    axis: AxisFactory, sway: SwayReference, cells: int, first: int
) -> None:
    """The foreseen sway is a trajectory of the model under the foreseen inputs.

    In single support some acceleration of the swinging leg takes part in it.
    """
    clock = clock_after(cells, first)
    timeline = foresee(clock, sway, COUNT, CELL)
    model = axis(0.5).model
    for k in range(COUNT - 1):
        cell = model.double if timeline.is_double[k] else model.single
        state = cell.transition @ timeline.sway_states[k]
        state = state + cell.input * timeline.sway_inputs[k]
        rest = timeline.sway_states[k + 1] - state
        if not timeline.is_double[k]:
            rest -= cell.swing * (cell.swing @ rest) / (cell.swing @ cell.swing)
        np.testing.assert_allclose(rest, 0.0, atol=1e-9)


def test_lateral_reference_has_the_cop_in_the_standing_foot(
    sway: SwayReference,
) -> None:
    """In single support the reference CoP is on the side of the foot that stands."""
    for cells in range(0, 40, 3):
        timeline = foresee(clock_after(cells), sway, COUNT, CELL)
        for cell, command in zip(timeline.cells, timeline.sway_inputs, strict=True):
            if cell.left is None:
                assert command < -0.01
            if cell.right is None:
                assert command > 0.01


def test_long_first_double_support_waits_at_its_start(sway: SwayReference) -> None:
    """A longer double support keeps the reference still, then runs as usual."""
    clock = GaitClock(TIMING)
    clock.start(RIGHT, (DOUBLE + 4) * CELL)
    timeline = foresee(clock, sway, COUNT, CELL)
    expected = [0] * 4 + list(range(DOUBLE + SINGLE))
    for k, index in enumerate(expected):
        np.testing.assert_array_equal(timeline.sway_states[k], sway.states[index])
        assert timeline.sway_inputs[k] == sway.inputs[index]
    assert timeline.landings[0].cell == len(expected)


@pytest.mark.parametrize("cells", [0, 4, 8, 19, 30])
def test_mirrored_clock_mirrors_the_timeline(sway: SwayReference, cells: int) -> None:
    """Exchanging left and right exchanges the feet and negates the sway."""
    one = foresee(clock_after(cells, RIGHT), sway, COUNT, CELL)
    other = foresee(clock_after(cells, LEFT), sway, COUNT, CELL)
    for a, b in zip(one.cells, other.cells, strict=True):
        assert (a.left, a.right) == (b.right, b.left)
    assert [(1 - a.foot, a.cell) for a in one.landings] == [
        (b.foot, b.cell) for b in other.landings
    ]
    np.testing.assert_array_equal(other.sway_states, -one.sway_states)
    np.testing.assert_array_equal(other.sway_inputs, -one.sway_inputs)


@pytest.mark.parametrize("count", [1, 5, 17, 60])
def test_timeline_has_the_asked_for_length(sway: SwayReference, count: int) -> None:
    """Every part has one entry per cell, and no landing lies beyond the horizon."""
    timeline = foresee(clock_after(4), sway, count, CELL)
    assert len(timeline.cells) == count
    assert timeline.sway_states.shape[0] == timeline.sway_inputs.shape[0] == count
    assert all(landing.cell < count for landing in timeline.landings)
    used = {place for cell in timeline.cells for place in (cell.left, cell.right)}
    assert used - {None, -1} == set(range(len(timeline.landings)))


def test_timeline_is_made_once(sway: SwayReference) -> None:
    """The same rest of a phase has the same timeline, another one has another."""
    timelines = Timelines(sway, COUNT, CELL)
    seen: dict[tuple[int, int, int], Timeline] = {}
    for cells in range(80):
        clock = clock_after(cells)
        remaining = max(round(clock.remaining / CELL), 1)
        key = (int(clock.phase), clock.next_swing, remaining)
        assert timelines.look_up(clock) is seen.setdefault(
            key, timelines.look_up(clock)
        )
    assert len(set(map(id, seen.values()))) == len(seen)


def test_regular_gait_is_foreseen_as_a_whole(sway: SwayReference) -> None:
    """A clock that steps in time meets only timelines that have been foreseen."""
    timelines = Timelines(sway, COUNT, CELL)
    foreseen = set(timelines.foresee_all())
    assert len(foreseen) == 1 + 2 * (DOUBLE + SINGLE)
    assert timelines.look_up(GaitClock(TIMING)) in foreseen
    for first in (LEFT, RIGHT):
        for cells in range(80):
            assert timelines.look_up(clock_after(cells, first)) in foreseen
