"""How near the ball is to each target of a run when its time is over."""

from __future__ import annotations

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
        """Begin before the first hold."""
        self._length = config.count_ticks(_WINDOW)
        self._recent = np.empty(0)
        self._means: list[float] = []
        self._is_holding = False
        self._last_tick = 0
        self.follow(config)

    def follow(self, config: Config) -> None:
        """Go on with a configuration that has other points from now on."""
        points = config.command.timeline
        self._starts = sorted({config.find_tick(point.time) for point in points})
        self._n_ticks = config.n_ticks

    def add(self, first_tick: int, angles: Array, targets: Array) -> None:
        """Add a block of a run.

        Args:
            first_tick: Tick of the first row.
            angles: Ball angle after each tick, shape (n,), [rad].
            targets: Target from each tick on, shape (n,), [rad].
        """
        errors, row = angles - targets, 0
        self._last_tick = first_tick + len(errors)
        for tick in self._starts:
            if first_tick <= tick < self._last_tick:
                self._extend(errors[row : tick - first_tick])
                self._end_hold()
                row, self._is_holding = tick - first_tick, True
        self._extend(errors[row:])

    def finish(self) -> list[float]:
        """Return the errors of all holds that were over before a fall, [rad].

        A hold without a target, where the command is a speed, has none.
        """
        if self._last_tick >= self._n_ticks:
            self._end_hold()
        return list(self._means)

    def _extend(self, errors: Array) -> None:
        recent = np.concatenate((self._recent, errors[-self._length :]))
        self._recent = recent[-self._length :]

    def _end_hold(self) -> None:
        mean = float(self._recent.mean()) if len(self._recent) else math.nan
        if self._is_holding and math.isfinite(mean):
            self._means.append(mean)
        self._recent, self._is_holding = np.empty(0), False


def find_largest(errors: list[float]) -> float:
    """Return the largest magnitude of some errors, NaN for none."""
    return float(np.abs(errors).max()) if errors else math.nan
