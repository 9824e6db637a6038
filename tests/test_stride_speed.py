"""Speed from stride to stride: sway within the steps is no unevenness."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.stride_speed import StrideSpeeds

PERIOD, STEP = 0.005, 60


def make_run(n: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and step count of a roll that sways, its strides uneven or not."""
    ticks = np.arange(n)
    time, counts = PERIOD * ticks, ticks // STEP
    speeds = 0.4 + spread * np.where((counts // 2) % 2, 1.0, -1.0)
    angles = np.concatenate(([0.0], np.cumsum(speeds[:-1]) * PERIOD))
    return angles + 0.1 * np.sin(2.0 * np.pi * time / (PERIOD * STEP)), counts


@pytest.mark.parametrize("size", [1, 47, 6000])
def test_only_whole_strides_count(size: int) -> None:
    """An even roll has no spread, however it sways within each step."""
    angles, counts = make_run(6000, 0.0)
    strides = StrideSpeeds()
    for first in range(0, 6000, size):
        rows = slice(first, first + size)
        strides.add(first, angles[rows], counts[rows])
    assert strides.compute_spread(3000, PERIOD) == pytest.approx(0.0, abs=1e-9)


def test_uneven_strides_are_seen() -> None:
    """Strides of 0.3 and 0.5 rad/s, and those half way, spread by 0.1 over root 2."""
    angles, counts = make_run(24000, 0.1)
    strides = StrideSpeeds()
    strides.add(0, angles, counts)
    expected = 0.1 * np.sqrt(0.5)
    assert strides.compute_spread(12000, PERIOD) == pytest.approx(expected, rel=0.02)


def test_without_strides_there_is_no_spread() -> None:
    """A robot that stands, or reports no steps, has none."""
    strides = StrideSpeeds()
    strides.add(0, np.zeros(100), np.zeros(100, dtype=int))
    assert np.isnan(strides.compute_spread(0, PERIOD))
