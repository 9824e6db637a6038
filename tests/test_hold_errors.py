"""Errors at the ends of holds: which ticks count, whatever the blocks are."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.config import CommandConfig, CommandPoint, Config
from ballsim.hold_errors import HoldErrors, find_largest

PERIOD = 0.005


def config_of(*times: float, duration: float = 10.0) -> Config:
    """Return a run whose target moves by 1 rad at each of some times."""
    points = tuple(CommandPoint(time, i + 1.0) for i, time in enumerate(times))
    return Config(duration=duration, command=CommandConfig(points))


def make_rows(config: Config, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return random ball angles and the targets of all ticks."""
    ticks = np.arange(config.n_ticks)
    starts = [config.find_tick(point.time) for point in config.command.timeline]
    targets = np.searchsorted(starts, ticks, side="right").astype(float)
    return np.random.default_rng(seed).normal(size=config.n_ticks), targets


@pytest.mark.parametrize("size", [1, 7, 1000, 2000])
def test_last_second_of_each_hold_counts(size: int) -> None:
    """The mean over each last second comes out however the run is cut."""
    config = config_of(1.0, 4.0, 4.5)
    angles, targets = make_rows(config, 3)
    errors = HoldErrors(config)
    for first in range(0, config.n_ticks, size):
        rows = slice(first, first + size)
        errors.add(first, angles[rows], targets[rows])
    # The second hold is over after half a second.
    expected = [
        (angles - targets)[round(start / PERIOD) : round(end / PERIOD)].mean()
        for start, end in ((3.0, 4.0), (4.0, 4.5), (9.0, 10.0))
    ]
    assert errors.finish() == pytest.approx(expected)


def test_fall_leaves_the_holds_before_it() -> None:
    """A hold that a fall breaks off has no error."""
    config = config_of(1.0, 4.0)
    angles, targets = make_rows(config, 4)
    errors = HoldErrors(config)
    errors.add(0, angles[:1000], targets[:1000])
    assert len(errors.finish()) == 1


def test_points_behind_the_end_hold_nothing() -> None:
    """The run ends the hold under way; later points begin none."""
    config = config_of(1.0, 4.0, duration=2.0)
    errors = HoldErrors(config)
    errors.add(0, np.full(400, 1.5), np.ones(400))
    assert errors.finish() == pytest.approx([0.5])
    assert HoldErrors(config_of(duration=2.0)).finish() == []


def test_largest_error_has_no_sign() -> None:
    """The worst hold counts, whichever way it is off; without one there is none."""
    assert find_largest([0.1, -0.3, 0.2]) == pytest.approx(0.3)
    assert np.isnan(find_largest([]))
