"""How evenly the ball rolls from stride to stride."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ballsim_controllers.messages import Array

__all__ = ["StrideSpeeds"]


class StrideSpeeds:
    """Mean speed of the ball over each stride, that is over two steps.

    Within each step the ball speeds up and slows down, because the swinging leg
    pushes the body, and through it the ball, the other way. What remains over whole
    strides is how evenly the robot keeps its speed.
    """

    def __init__(self) -> None:
        """Begin with no step."""
        self._ticks: list[int] = []
        self._angles: list[float] = []
        self._count = 0

    def add(
        self, first_tick: int, angles: Array, step_counts: npt.NDArray[Any]
    ) -> None:
        """Add a block of a run.

        Args:
            first_tick: Tick of the first row.
            angles: Ball angle at each tick, shape (n,), [rad].
            step_counts: Touchdowns so far, as the controller reports them, (n,).
        """
        before = np.concatenate(([self._count], step_counts[:-1]))
        for row in np.flatnonzero(step_counts != before).tolist():
            self._ticks.append(first_tick + row)
            self._angles.append(float(angles[row]))
        self._count = int(step_counts[-1])

    def compute_spread(self, first_tick: int, period: float) -> float:
        """Return the standard deviation over all strides from a tick on, [rad/s].

        Args:
            first_tick: Strides that begin earlier are left out.
            period: Control period, [s].

        Returns:
            The deviation, NaN for fewer than two strides.
        """
        ticks, angles = np.array(self._ticks), np.array(self._angles)
        angles, ticks = angles[ticks >= first_tick], ticks[ticks >= first_tick]
        if len(ticks) < 4:
            return math.nan
        speeds = (angles[2:] - angles[:-2]) / (period * (ticks[2:] - ticks[:-2]))
        return float(speeds.std())
