"""Laws of the gait clock: order of the phases, touchdown early, in time and late."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim_controllers.footsteps.gait import LEFT, RIGHT, GaitClock, GaitTiming
from ballsim_controllers.messages import GaitPhase

DT = 0.002
TIMING = GaitTiming(
    single_support=0.22,
    double_support=0.12,
    earliest_touchdown=0.6,
    touchdown_force=15.0,
    latest_touchdown=0.15,
)
LOADED = (300.0, 300.0)
SUPPORTS = {RIGHT: GaitPhase.LEFT_SUPPORT, LEFT: GaitPhase.RIGHT_SUPPORT}


def run(
    clock: GaitClock, time: float, forces: tuple[float, float], hold: bool = False
) -> list[tuple[int, GaitPhase]]:
    """Advance the clock and return the ticks at which its phase changed."""
    changes = []
    for tick in range(1, round(time / DT) + 1):
        if clock.advance(DT, forces, hold):
            changes.append((tick, clock.phase))
    return changes


def in_the_air(foot: int) -> tuple[float, float]:
    """Return forces with one foot unloaded."""
    return (0.0, 600.0) if foot == LEFT else (600.0, 0.0)


def swinging(first: int = RIGHT) -> GaitClock:
    """Return a clock at the start of a swing."""
    clock = GaitClock(TIMING)
    clock.start(first, 0.12)
    assert [phase for _, phase in run(clock, 0.12, LOADED)] == [SUPPORTS[first]]
    return clock


def test_standing_goes_on() -> None:
    """Without a start the robot stands for ever, whatever its feet feel."""
    clock = GaitClock(TIMING)
    for forces in (LOADED, (0.0, 0.0), (600.0, 0.0)):
        assert run(clock, 5.0, forces) == []
    assert clock.phase == GaitPhase.STAND
    assert clock.stance == (True, True)
    assert clock.swing_foot is None
    assert clock.transfer == (0.0, 0.0)
    assert clock.remaining == 0.0


@pytest.mark.parametrize("first", [LEFT, RIGHT])
def test_phases_follow_one_another(first: int) -> None:
    """Double support, one swing, double support, the other swing, each in its time."""
    clock = GaitClock(TIMING)
    clock.start(first, 0.2)
    changes = []
    for tick in range(1, round(2.0 / DT) + 1):
        # The swinging foot touches as planned.
        foot = clock.swing_foot
        lands = foot is not None and clock.time_in_phase >= 0.22 - 1.5 * DT
        forces = LOADED if foot is None or lands else in_the_air(foot)
        if clock.advance(DT, forces, hold=False):
            changes.append((tick, clock.phase))
    one, other = SUPPORTS[first], SUPPORTS[1 - first]
    cycle = [one, GaitPhase.DOUBLE, other, GaitPhase.DOUBLE]
    assert [phase for _, phase in changes] == (cycle * 4)[: len(changes)]
    lengths = np.diff([0, *(tick for tick, _ in changes)]) * DT
    expected = [0.2, *([0.22, 0.12] * len(lengths))][: len(lengths)]
    np.testing.assert_allclose(lengths, expected, atol=1.001 * DT)
    assert clock.step_count == clock.steps_since_start == 5


@pytest.mark.parametrize("first", [LEFT, RIGHT])
def test_swinging_foot_does_not_stand(first: int) -> None:
    """Stance and swing foot complete each other, and the stance foot's name fits."""
    clock = swinging(first)
    assert clock.swing_foot == first
    assert clock.stance == (first != LEFT, first != RIGHT)
    assert clock.transfer == (1.0, 1.0)


def test_early_contact_is_ignored() -> None:
    """A foot that scrapes at the start of its swing has not landed."""
    clock = swinging()
    assert run(clock, 0.6 * 0.22 - 2.0 * DT, LOADED) == []
    changes = run(clock, 4.0 * DT, LOADED)
    assert [phase for _, phase in changes] == [GaitPhase.DOUBLE]


def test_touchdown_needs_its_force() -> None:
    """Contact counts from the touchdown force on, of the swinging foot alone."""
    clock = swinging(RIGHT)
    assert run(clock, 0.2, (600.0, 15.0)) == []
    assert run(clock, DT, (0.0, 15.1)) == [(1, GaitPhase.DOUBLE)]
    assert clock.next_swing == LEFT


def test_touchdown_may_be_late() -> None:
    """Without contact the swing goes on beyond its end, up to the latest touchdown."""
    clock = swinging(RIGHT)
    changes = run(clock, 1.0, in_the_air(RIGHT))
    tick, phase = changes[0]
    assert phase == GaitPhase.DOUBLE
    assert tick * DT == pytest.approx(0.22 + 0.15, abs=1.5 * DT)
    late = swinging(RIGHT)
    assert run(late, 0.30, in_the_air(RIGHT)) == []
    assert late.remaining == 0.0
    assert run(late, DT, LOADED) == [(1, GaitPhase.DOUBLE)]


def test_hold_keeps_double_support() -> None:
    """While held the robot stays on both feet, and lifts the foot right afterwards."""
    clock = GaitClock(TIMING)
    clock.start(LEFT, 0.12)
    assert run(clock, 1.0, LOADED, hold=True) == []
    assert clock.phase == GaitPhase.DOUBLE
    assert clock.remaining == 0.0
    assert run(clock, DT, LOADED) == [(1, GaitPhase.RIGHT_SUPPORT)]


def test_hold_does_not_keep_a_swing() -> None:
    """A swing ends at its touchdown even while held."""
    clock = swinging(RIGHT)
    changes = run(clock, 0.3, LOADED, hold=True)
    assert [phase for _, phase in changes] == [GaitPhase.DOUBLE]


def test_stop_stands_until_the_next_start() -> None:
    """After a stop nothing happens; a new start counts its own steps."""
    clock = swinging(RIGHT)
    run(clock, 0.22, LOADED)
    clock.stop()
    assert run(clock, 1.0, LOADED) == []
    assert clock.phase == GaitPhase.STAND
    assert (clock.step_count, clock.steps_since_start) == (1, 1)
    clock.start(LEFT, 0.12)
    assert (clock.step_count, clock.steps_since_start) == (1, 0)
    assert clock.next_swing == LEFT


def test_transfer_passes_from_foot_to_foot() -> None:
    """In double support the transfers add up to one and end at the next stance foot."""
    clock = swinging(RIGHT)
    run(clock, 0.6 * 0.22, LOADED)  # now the left foot is next to swing
    assert (clock.next_swing, clock.time_in_phase) == (LEFT, 0.0)
    before = clock.transfer
    assert before == pytest.approx((1.0, 0.0))
    for _ in range(round(0.12 / DT) - 2):
        clock.advance(DT, LOADED, hold=False)
        left, right = clock.transfer
        assert left + right == pytest.approx(1.0)
        assert right > before[1]
        before = (left, right)
    assert before[1] > 0.95
    clock.advance(DT, LOADED, hold=True)
    run(clock, 1.0, LOADED, hold=True)
    assert clock.transfer == (0.0, 1.0)


def test_first_transfer_starts_from_nothing() -> None:
    """Before the first step no foot has carried alone: only the heir's grows."""
    clock = GaitClock(TIMING)
    clock.start(RIGHT, 0.12)
    assert clock.transfer == (0.0, 0.0)
    run(clock, 0.06, LOADED)
    assert clock.transfer == pytest.approx((0.5, 0.0))


@pytest.mark.parametrize("next_swing", [LEFT, RIGHT])
@pytest.mark.parametrize("remaining", [0.02, 0.06, 0.12])
def test_rescheduled_foot_leaves_in_its_time(next_swing: int, remaining: float) -> None:
    """The chosen foot leaves after the chosen time, its heir then carries all."""
    clock = swinging(RIGHT)
    run(clock, 0.6 * 0.22, LOADED)
    run(clock, 0.05, LOADED)
    clock.reschedule(next_swing, remaining, 0.18)
    assert clock.remaining == pytest.approx(remaining)
    before, support = clock.transfer, 1 - next_swing
    ticks = round(remaining / DT)
    for _ in range(ticks - 1):
        assert not clock.advance(DT, LOADED, hold=False)
        # Neither jumps: the heir's grows, the other one's fades at its regular pace.
        assert clock.transfer[support] >= before[support]
        faded = before[next_swing] - clock.transfer[next_swing]
        assert -1e-12 <= faded <= DT / TIMING.double_support + 1e-12
        before = clock.transfer
    heir = 1.0 - before[support]
    assert heir <= 1.001 / ticks
    assert run(clock, 2 * DT, LOADED)[0][1] == SUPPORTS[next_swing]
    assert clock.duration == 0.18


def test_mirrored_forces_mirror_the_gait() -> None:
    """Exchanging left and right exchanges the phases, tick for tick."""
    generator = np.random.default_rng(0)
    one, other = GaitClock(TIMING), GaitClock(TIMING)
    one.start(RIGHT, 0.12)
    other.start(LEFT, 0.12)
    image = {
        GaitPhase.STAND: GaitPhase.STAND,
        GaitPhase.DOUBLE: GaitPhase.DOUBLE,
        GaitPhase.LEFT_SUPPORT: GaitPhase.RIGHT_SUPPORT,
        GaitPhase.RIGHT_SUPPORT: GaitPhase.LEFT_SUPPORT,
    }
    for left, right in generator.exponential(10.0, size=(3000, 2)):
        hold = bool(left > 20.0)
        changed = one.advance(DT, (left, right), hold)
        assert other.advance(DT, (right, left), hold) == changed
        assert other.phase == image[one.phase]
        assert other.transfer == one.transfer[::-1]
        assert other.stance == one.stance[::-1]
    assert one.step_count > 10
