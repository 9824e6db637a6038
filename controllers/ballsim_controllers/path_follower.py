"""From a path on the floor to the reference of both axes along it.

How fast the path may be followed depends on its direction at each place, because
the robot keeps its heading: it walks faster forwards than sideways. So the path is
measured by the time that it takes at these speeds, sigma, in which it is a spline
with continuous second derivatives; and sigma is moved on by the same shaper that
makes all other references, from rest at 0 to rest at its end, at a rate of 1 at
most.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import uniform_filter1d

from ballsim_controllers.commands import FloorPath
from ballsim_controllers.compilation import compiled
from ballsim_controllers.floor_path import PathTrace, trace_path
from ballsim_controllers.messages import Array
from ballsim_controllers.motion_limits import PathLimits
from ballsim_controllers.reference import RampReference

__all__ = ["PathAxis", "PathFollower", "limit_speeds"]

_KNOT_TIME = 0.05
"""Distance of the spline's knots, about, [s]."""

_SLOWEST = 1e-3
"""Least speed on a path, [m/s]: a limit must not be 0."""


def limit_speeds(trace: PathTrace, limits: PathLimits) -> tuple[Array, Array]:
    """Return how fast a path may be followed at each of its samples.

    Args:
        trace: The path.
        limits: Limits of speed and acceleration.

    Returns:
        Speeds, shape (n,), [m/s], smooth over the way that the largest of them covers
        in the smoothing time, so that narrow minima are exceeded by some per cent; and
        what bends leave of the acceleration for a change of speed, (n,), [m/s^2].
    """
    speeds = np.full(len(trace.arc), max(limits.top, _SLOWEST))
    bend = np.abs(trace.curvatures)
    if limits.heading is None:
        with np.errstate(divide="ignore"):
            turned = limits.turn_rate / bend
        speeds = np.minimum(speeds, np.minimum(limits.speeds[0], turned))
    else:
        cosine, sine = math.cos(limits.heading), math.sin(limits.heading)
        x, y = trace.directions.T
        along = (cosine * x + sine * y) / limits.speeds[0]
        across = (cosine * y - sine * x) / limits.speeds[1]
        speeds = np.minimum(speeds, 1.0 / np.hypot(along, across))
    with np.errstate(divide="ignore"):
        slowed = np.sqrt(math.sqrt(0.5) * limits.acceleration / bend)
    speeds = np.minimum(speeds, slowed)
    squares = np.square(speeds)
    left = np.sqrt(limits.acceleration**2 - np.square(squares * bend))
    # v dv/ds <= a, both ways: the square grows by 2 a for each metre at most.
    spacing = float(trace.arc[1])
    slope = 2.0 * spacing * np.cumsum(left)
    for sign in (1.0, -1.0):
        order = slice(None, None, int(sign))
        lowest = np.minimum.accumulate((squares - sign * slope)[order])[order]
        squares = lowest + sign * slope
    width = limits.smoothing_time * float(speeds.max()) / spacing
    window = 2 * math.ceil(0.5 * width) + 1
    smooth = np.sqrt(squares)
    for _ in range(2):
        smooth = uniform_filter1d(smooth, window, mode="nearest")
    return np.maximum(smooth, _SLOWEST), left


class PathFollower:
    """Reference on a path, from rest at its start to rest at its end.

    Position, speed and acceleration are continuous. The ball's centre shall be on
    the path exactly at every instant.

    Args:
        path: The path.
        limits: Limits of speed and acceleration.
        radius: Radius of the ball, [m].

    Attributes:
        axes: The reference along the world's axes, and the direction of the path.
        is_faced: Whether the robot shall face along the path.

    Raises:
        InvalidSettingError: The path cannot be followed, see `trace_path`.
    """

    def __init__(self, path: FloorPath, limits: PathLimits, radius: float) -> None:
        """Measure the path by the time that it takes."""
        trace = trace_path(path)
        speeds, left = limit_speeds(trace, limits)
        times = CubicSpline(trace.arc, 1.0 / speeds).antiderivative()(trace.arc)
        count = max(math.ceil(float(times[-1]) / _KNOT_TIME), 3)
        knots = np.linspace(0.0, times[-1], count + 1)
        angles = np.unwrap(np.arctan2(*trace.directions.T[::-1]))
        rows = np.column_stack((trace.points / radius, angles))
        at_knots = CubicSpline(trace.arc, rows)(CubicSpline(times, trace.arc)(knots))
        at_knots[0], at_knots[-1] = rows[0], rows[-1]
        ends = [
            speeds[i] * np.append(trace.directions[i] / radius, trace.curvatures[i])
            for i in (0, -1)
        ]
        spline = CubicSpline(knots, at_knots, bc_type=((1, ends[0]), (1, ends[1])))
        #: Coefficients of each piece, highest power first, shape (n, 4, 3), [rad].
        self._pieces = np.ascontiguousarray(spline.c.transpose(1, 0, 2))
        self.is_faced = limits.heading is None
        self._step = float(knots[1])
        rate = min(float(left[i] / speeds[i]) for i in (0, -1))
        self._phase = RampReference(1.0, rate, limits.smoothing_time)
        self._phase.target = float(times[-1])
        #: Position, velocity, acceleration and jerk of each axis, (3, 4), [rad].
        self._samples = np.zeros((3, 4))
        end = np.array([times[-1], 0.0, 0.0, 0.0])
        _follow(self._samples, self._pieces, self._step, end)
        self._rest = self._samples[:, 0].copy()
        along, across, direction = rows[0].tolist()
        self._start: tuple[float, float, float] = (along, across, direction)
        self._samples[:, 0] = self._start
        self.axes = tuple(PathAxis(self, i) for i in range(3))

    @property
    def samples(self) -> Array:
        """Return the reference of ball and direction at this instant, (3, 4), [rad]."""
        return self._samples

    @property
    def is_at_rest(self) -> bool:
        """Return whether the ball's reference has come to rest for good."""
        return self._phase.is_at_rest

    @property
    def start(self) -> tuple[float, float, float]:
        """Return place and direction at the beginning of the path, [rad]."""
        return self._start

    @property
    def rest(self) -> Array:
        """Return place and direction at the end of the path, shape (3,), [rad]."""
        return self._rest

    def stop(self) -> None:
        """Come to rest on the path as soon as the limits allow."""
        self._phase.stop()

    def advance(self, dt: float) -> None:
        """Move on by one control period, [s]."""
        self._phase.advance(dt)
        _follow(self._samples, self._pieces, self._step, np.array(self._phase.sample))


class PathAxis:
    """One axis of a follower, as a source of a reference window.

    Args:
        follower: The follower; it is advanced by its owner.
        axis: 0 and 1 for the axes of the world, 2 for the direction of the path.
    """

    def __init__(self, follower: PathFollower, axis: int) -> None:
        """Begin at the follower's present place."""
        self._follower = follower
        self._axis = axis

    @property
    def is_at_rest(self) -> bool:
        """Return whether the reference has come to rest for good."""
        return self._follower.is_at_rest

    @property
    def target(self) -> float:
        """Return where the path ends, [rad]."""
        return float(self._follower.rest[self._axis])

    def advance_into(self, samples: Array, first: int, second: int, dt: float) -> None:
        """Write the present reference into two rows, see `RampReference`."""
        samples[first] = samples[second] = self._follower.samples[self._axis]


@compiled
def _follow(samples: Array, pieces: Array, step: float, phase: Array) -> None:
    """Write the reference at some phase.

    Args:
        samples: Position, velocity, acceleration and jerk by time, shape (m, 4).
        pieces: Cubic pieces, highest power first, shape (n, 4, m).
        step: Length of each piece, [s].
        phase: Phase and its three derivatives by time, shape (4,).
    """
    index = max(0, min(int(phase[0] / step), len(pieces) - 1))
    t, (rate, acceleration, jerk) = phase[0] - index * step, phase[1:]
    for axis in range(len(samples)):
        c3, c2, c1, c0 = pieces[index, :, axis]
        first, second = c1 + (2.0 * c2 + 3.0 * c3 * t) * t, 2.0 * c2 + 6.0 * c3 * t
        row = samples[axis]
        row[0] = c0 + (c1 + (c2 + c3 * t) * t) * t
        row[1] = first * rate
        row[2] = second * rate**2 + first * acceleration
        row[3] = 6.0 * c3 * rate**3 + 3.0 * second * rate * acceleration + first * jerk
