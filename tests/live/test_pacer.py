"""The clock of a live run: never faster than real, and honest where it is slower."""

from __future__ import annotations

import pytest

from ballsim.live.pacer import Pacer

PERIOD = 0.005


class _Time:
    """A clock that moves when somebody sleeps or works."""

    def __init__(self) -> None:
        self.now = 100.0
        self.lines: list[str] = []

    def clock(self) -> float:
        return self.now

    def work(self, duration: float) -> None:
        self.now += duration


def _make() -> tuple[_Time, Pacer]:
    time = _Time()
    return time, Pacer(PERIOD, time.lines.append, time.clock, time.work)


def test_ticks_begin_when_they_are_due() -> None:
    """Work that takes a part of the period does not add up."""
    time, pacer = _make()
    starts = []
    for tick in range(400):
        pacer.wait(tick)
        starts.append(time.now)
        time.work(0.4 * PERIOD)
    assert starts == pytest.approx([100.0 + PERIOD * tick for tick in range(400)])
    assert pacer.lost_time == pacer.largest_lag == 0.0
    assert pacer.describe() == "real time was kept, to within 0 ms"


def test_short_delay_is_made_good() -> None:
    """After some late ticks the run is on time again."""
    time, pacer = _make()
    for tick in range(100):
        pacer.wait(tick)
        time.work(0.1 if tick == 10 else 0.1 * PERIOD)
    assert time.now == pytest.approx(100.0 + 99.1 * PERIOD)
    assert pacer.largest_lag == pytest.approx(0.1 - PERIOD)
    assert pacer.lost_time == 0.0
    assert time.lines == []


def test_long_delay_is_told_and_given_up() -> None:
    """A run that was suspended goes on at real time, not faster."""
    time, pacer = _make()
    for tick in range(100):
        pacer.wait(tick)
        time.work(30.0 if tick == 10 else 0.1 * PERIOD)
    assert time.now == pytest.approx(100.0 + 30.0 + (99 - 11 + 10 + 0.1) * PERIOD)
    assert pacer.lost_time == pytest.approx(30.0 - PERIOD)
    assert len(time.lines) == 1
    assert "behind" in time.lines[0]
    assert pacer.describe().startswith("real time was not kept")


def test_slow_machine_is_told_now_and_then() -> None:
    """Where every tick takes too long there is a line each five seconds, not each tick.

    All the time above that of the ticks is lost, but for what is not given up yet.
    """
    time, pacer = _make()
    n_ticks, duration = 3000, 2.0 * PERIOD
    for tick in range(n_ticks):
        pacer.wait(tick)
        time.work(duration)
    lost = (n_ticks - 1) * (duration - PERIOD)
    assert lost - 0.25 < pacer.lost_time <= lost + 1e-6
    assert 5 <= len(time.lines) <= 7
