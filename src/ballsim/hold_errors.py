"""How near the ball is to each target of a run when its time is over."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ballsim.config import Config
from ballsim_controllers.messages import Array

__all__ = ["HoldErrors", "find_largest"]

_WINDOW = 1.0
"""Last part of a hold, over which the error is averaged, [s]: some steps, because
the ball sways with each of them while the robot steps."""


class HoldErrors:
    """Mean error of the ball angle over the last second of each hold.

    A hold lasts from one point of the command's timeline to the next one, the last
    hold to the end of the run. What comes before the first point is none.

    Args:
        config: The run.
    """

    def __init__(self, config: Config) -> None:
        """Find the ticks that count."""
        starts = [config.find_tick(point.time) for point in config.command.timeline]
        bounds = [min(tick, config.n_ticks) for tick in (*starts, config.n_ticks)]
        length = config.count_ticks(_WINDOW)
        self._windows = [
            (max(start, end - length), end)
            for start, end in itertools.pairwise(bounds)
            if start < end
        ]
        self._sums = [0.0] * len(self._windows)
        self._last_tick = 0

    def add(self, first_tick: int, angles: Array, targets: Array) -> None:
        """Add a block of a run.

        Args:
            first_tick: Tick of the first row.
            angles: Ball angle after each tick, shape (n,), [rad].
            targets: Target from each tick on, shape (n,), [rad].
        """
        errors, self._last_tick = angles - targets, first_tick + len(angles)
        for i, (start, end) in enumerate(self._windows):
            rows = slice(max(start - first_tick, 0), max(end - first_tick, 0))
            self._sums[i] += float(errors[rows].sum())

    def finish(self) -> list[float]:
        """Return the errors of all holds that were over before a fall, [rad].

        A hold without a target, where the command is a speed, has none.
        """
        return [
            total / (end - start)
            for total, (start, end) in zip(self._sums, self._windows, strict=True)
            if end <= self._last_tick and math.isfinite(total)
        ]


def find_largest(errors: list[float]) -> float:
    """Return the largest magnitude of some errors, NaN for none."""
    return float(np.abs(errors).max()) if errors else math.nan
