"""How near the robot's heading is to the commanded one at the end of a run."""

from __future__ import annotations

import math

import numpy as np

from ballsim.config import Config
from ballsim_controllers.messages import Array

__all__ = ["HeadingError", "compute_headings"]

_WINDOW = 1.0
"""Last part of a run, over which the error is averaged, [s]."""


def compute_headings(quaternions: Array) -> Array:
    """Return the directions of the x axes about the vertical, shape (n,), [rad].

    Args:
        quaternions: Attitudes (w, x, y, z), shape (n, 4).
    """
    w, x, y, z = quaternions.T
    headings: Array = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return headings


class HeadingError:
    """Mean error of the estimated heading over the last second of a run.

    The estimate's, because the true heading cannot be observed by the robot's sensors;
    how far it is from the true one stands among the errors of the estimate.

    Args:
        config: The run.
    """

    def __init__(self, config: Config) -> None:
        """Find out what is asked for."""
        self._length = config.count_ticks(_WINDOW)
        self._recent = np.empty(0)
        self._n_ticks = 0
        self.follow(config)

    def follow(self, config: Config) -> None:
        """Go on with a configuration that has other points from now on."""
        points = config.command.timeline
        self._is_asked = any(
            point.heading != 0.0 or point.path.is_faced for point in points
        )
        self._asked = [
            (config.find_tick(point.time), point.find_heading()) for point in points
        ]

    def add(self, quaternions: Array) -> None:
        """Add a block of a run.

        Args:
            quaternions: Estimated attitude of the trunk at each tick, shape (n, 4).
        """
        self._n_ticks += len(quaternions)
        if not self._is_asked:
            return
        headings = compute_headings(quaternions[-self._length :])
        self._recent = np.concatenate((self._recent, headings))[-self._length :]

    def finish(self) -> float:
        """Return the error, NaN where no heading was asked for, [rad]."""
        targets = [asked for tick, asked in self._asked if tick < self._n_ticks]
        if not targets or not len(self._recent):
            return math.nan
        errors = self._recent - targets[-1]
        return float(((errors + np.pi) % (2.0 * np.pi) - np.pi).mean())
