"""Lets a run go on no faster than the clock on the wall, and tells if it is slower."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

__all__ = ["Pacer"]

_PATIENCE = 0.2  # behind the clock; what is more is given up, [s]
_PAUSE = 5.0  # between two complaints, [s]


class Pacer:
    """Sleeps until a tick is due.

    A run that is a little late catches up. One that is later than 0.2 s (it was
    suspended, or the machine is too slow) goes on from there: time that is lost is
    counted, and never made good by a run that is faster than real.

    Args:
        period: Time between two ticks, [s].
        notify: Called with a line when the run cannot keep up.
        clock: Returns the time on the wall, [s].
        sleep: Waits for a time in [s].

    Attributes:
        largest_lag: Latest beginning of a tick, [s].
        lost_time: Time that was given up, [s].
    """

    def __init__(
        self,
        period: float,
        notify: Callable[[str], None],
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Begin before the first tick."""
        self._period, self._notify = period, notify
        self._clock, self._sleep = clock, sleep
        self._start = math.nan
        self._complained = -math.inf
        self.largest_lag = self.lost_time = 0.0

    def wait(self, tick: int) -> None:
        """Return when a tick is due; the first one is due at once.

        Args:
            tick: Its number.
        """
        now = self._clock()
        if math.isnan(self._start):
            self._start = now - tick * self._period
        lag = now - (self._start + tick * self._period)
        if lag < 0.0:
            self._sleep(-lag)
            return
        self.largest_lag = max(self.largest_lag, lag)
        if lag <= _PATIENCE:
            return
        self._start += lag
        self.lost_time += lag
        if now - self._complained > _PAUSE:
            self._complained = now
            self._notify(
                f"cannot keep up with real time: {lag:.2f} s behind, "
                f"{self.lost_time:.2f} s lost so far"
            )

    def describe(self) -> str:
        """Return how well real time was kept, in words."""
        if self.lost_time > 0.0:
            return f"real time was not kept: {self.lost_time:.2f} s lost"
        return f"real time was kept, to within {1e3 * self.largest_lag:.0f} ms"
