"""How near the ball keeps to a commanded path."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ballsim.config import Config
from ballsim_controllers.messages import Array

if TYPE_CHECKING:
    from ballsim_controllers.floor_path import PathTrace

__all__ = ["PathErrors", "compute_cross_track"]

_BEGIN = 0.1  # a path begins once the ball is this near to its first point, [m]


def compute_cross_track(trace: PathTrace, places: Array) -> Array:
    """Return the distance of places from a path, shape (n,), [m].

    Args:
        trace: The path.
        places: Shape (n, 2), [m].
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415 - runs without a path need none

    nearest = cKDTree(trace.points).query(places)[1]
    offsets = places - trace.points[nearest]
    half = 0.5 * float(trace.arc[1])
    directions = trace.directions[nearest]
    along = np.clip((offsets * directions).sum(axis=1), -half, half)
    distances: Array = np.hypot(*(offsets - along[:, None] * directions).T)
    return distances


class PathErrors:
    """Distance of the true ball's centre from the path while the robot follows it.

    It counts from the first to the last touchdown under the command, once the ball
    has come within 0.1 m of the path's first point: what the robot stands before and
    after does not make it smaller, what it does on its way to the path not larger.

    Args:
        config: The run.
    """

    def __init__(self, config: Config) -> None:
        """Find the paths and the ticks from which they are in force."""
        self._has_begun: list[bool] = []
        self._squares: list[Array] = []  # counted for good
        self._pending: list[Array] = []  # since the last touchdown
        self._is_counting = False
        self._count = 0
        self.follow(config)

    def follow(self, config: Config) -> None:
        """Go on with a configuration that has other points from now on."""
        points = config.command.timeline
        self._traces = [point.path.trace() for point in points]
        self._starts = [config.find_tick(point.time) for point in points]
        self._ends = [*self._starts, config.n_ticks][1:]
        self._has_begun += [False] * (len(points) - len(self._has_begun))

    @property
    def has_path(self) -> bool:
        """Return whether the run has a path at all."""
        return any(trace is not None for trace in self._traces)

    def add(
        self, first_tick: int, places: Array, step_counts: npt.NDArray[Any]
    ) -> None:
        """Add a block of a run.

        Args:
            first_tick: Tick of the first row.
            places: Ball's centre at each tick in the robot's world, (n, 2), [m].
            step_counts: Touchdowns so far, as the controller reports them, (n,).
        """
        if not self.has_path:
            return
        for i, trace in enumerate(self._traces):
            low = max(self._starts[i] - first_tick, 0)
            high = min(self._ends[i] - first_tick, len(places))
            if trace is not None and low < high:
                self._add_rows(i, trace, places[low:high], step_counts[low:high])

    def _add_rows(
        self, index: int, trace: PathTrace, places: Array, counts: npt.NDArray[Any]
    ) -> None:
        """Add rows in which one path is in force."""
        if not self._has_begun[index]:
            near = np.hypot(*(places - trace.points[0]).T) < _BEGIN
            if not near.any():
                return
            first = int(np.argmax(near))
            places, counts = places[first:], counts[first:]
            self._has_begun[index], self._is_counting = True, False
            self._pending, self._count = [], int(counts[0])
        squares = np.square(compute_cross_track(trace, places))
        before = np.concatenate(([self._count], counts[:-1]))
        self._count = int(counts[-1])
        start = 0
        for row in np.flatnonzero(counts != before).tolist():
            if self._is_counting:
                self._squares += [*self._pending, squares[start:row]]
            self._is_counting, self._pending, start = True, [], row
        self._pending.append(squares[start:])

    def finish(self) -> tuple[float, float]:
        """Return root of the mean square and maximum, NaN without a path, [m]."""
        squares = np.concatenate([np.empty(0), *self._squares])
        if not len(squares):
            return math.nan, math.nan
        return math.sqrt(float(squares.mean())), math.sqrt(float(squares.max()))
