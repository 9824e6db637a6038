"""Curves on the floor by arc length: what a commanded path looks like.

The curves are twice continuously differentiable, so that a ball can follow them
with a continuous acceleration.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from ballsim_controllers.commands import Circle, FigureEight, FloorPath, WayPoints
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import Array

__all__ = ["MIN_CURVE_RADIUS", "PathTrace", "trace_path"]

MIN_CURVE_RADIUS = 0.05
"""Least radius of curvature of a path, [m]: a sharper bend is a corner."""

_SPACING = 0.005
"""Distance of two samples on a path, about, [m]."""

_LEAST_SAMPLES, _MOST_SAMPLES = 200, 40000


@dataclass(frozen=True, slots=True)
class PathTrace:
    """Samples of a path at equal distances.

    Attributes:
        arc: Way along the path up to each sample, shape (n,), [m].
        points: Places on the floor, shape (n, 2), [m].
        directions: Unit tangents, shape (n, 2).
        curvatures: Curvature, positive where it bends to the left, (n,), [1/m].
    """

    arc: Array
    points: Array
    directions: Array
    curvatures: Array

    @property
    def length(self) -> float:
        """Return the length of the path, [m]."""
        return float(self.arc[-1])


class _Curve(NamedTuple):
    """A curve by some parameter: places and two derivatives, shapes (n, 2)."""

    evaluate: Callable[[Array], tuple[Array, Array, Array]]
    end: float
    size: float  # rough length, [m]


@functools.lru_cache(maxsize=8)
def trace_path(path: FloorPath) -> PathTrace:
    """Return a path by its arc length.

    Args:
        path: The path.

    Returns:
        Samples about 5 mm apart; arrays that are not to be changed.

    Raises:
        InvalidSettingError: The path bends too sharply, or two way-points that
            follow one another are the same, or there are fewer than two.

    Examples:
        >>> trace = trace_path(Circle(1.0))
        >>> round(trace.length, 9) == round(2.0 * np.pi, 9)
        True
        >>> bool(np.allclose(trace.points[-1], trace.points[0]))
        True
    """
    key, value, curve = _describe(path)
    count = int(np.clip(curve.size / _SPACING, _LEAST_SAMPLES, _MOST_SAMPLES))
    grid = np.linspace(0.0, curve.end, count)
    speed = np.hypot(*curve.evaluate(grid)[1].T)
    way = CubicSpline(grid, speed).antiderivative()(grid)
    arc = np.linspace(0.0, way[-1], count)
    if not np.all(np.diff(way) > 0.0):
        raise InvalidSettingError(key, value, _valid_bend())
    parameter = CubicSpline(way, grid)(arc)
    parameter[0], parameter[-1] = 0.0, curve.end
    points, rates, second = curve.evaluate(parameter)
    speed = np.hypot(*rates.T)
    cross = rates[:, 0] * second[:, 1] - rates[:, 1] * second[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        curvatures, directions = cross / speed**3, rates / speed[:, None]
    # A path that turns back on itself bends between two samples.
    turns = (directions[1:] * directions[:-1]).sum(axis=1)
    is_smooth = np.all(turns >= math.cos(2.0 * float(arc[1]) / MIN_CURVE_RADIUS))
    bends = np.abs(curvatures) * MIN_CURVE_RADIUS
    if not is_smooth or not np.all(bends <= 1.0 + 1e-9):
        raise InvalidSettingError(key, value, _valid_bend())
    for array in (arc, points, directions, curvatures):
        array.setflags(write=False)
    return PathTrace(arc, points, directions, curvatures)


def _valid_bend() -> str:
    return f"a path that bends with a radius of {MIN_CURVE_RADIUS:g} m or more"


def _describe(path: FloorPath) -> tuple[str, object, _Curve]:
    """Return what a path is called by, its value, and the curve."""
    match path:
        case Circle(radius):
            return "radius_m", radius, _draw_circle(radius)
        case FigureEight(length, width):
            size = {"width_m": width, "length_m": length}
            key = min(size, key=lambda name: abs(size[name]))
            return key, size[key], _draw_figure_eight(length, width)
        case WayPoints(points):
            return "waypoints_m", [list(p) for p in points], _draw_spline(points)


def _draw_circle(radius: float) -> _Curve:
    def evaluate(u: Array) -> tuple[Array, Array, Array]:
        s, c = np.sin(u), np.cos(u)
        r = abs(radius)
        return (
            np.column_stack((r * s, radius * (1.0 - c))),
            np.column_stack((r * c, radius * s)),
            np.column_stack((-r * s, radius * c)),
        )

    return _Curve(evaluate, 2.0 * np.pi, 2.0 * np.pi * abs(radius))


def _draw_figure_eight(length: float, width: float) -> _Curve:
    """Return the curve of Lissajous with frequencies of one to two."""
    a, b = 0.5 * length, 0.5 * width

    def evaluate(u: Array) -> tuple[Array, Array, Array]:
        s, c, s2, c2 = np.sin(u), np.cos(u), np.sin(2.0 * u), np.cos(2.0 * u)
        return (
            np.column_stack((a * s, b * s2)),
            np.column_stack((a * c, 2.0 * b * c2)),
            np.column_stack((-a * s, -4.0 * b * s2)),
        )

    return _Curve(evaluate, 2.0 * np.pi, 2.0 * (abs(length) + 2.0 * abs(width)))


def _draw_spline(points: tuple[tuple[float, float], ...]) -> _Curve:
    """Return the cubic spline over the chords' lengths."""
    places = np.array(points, dtype=np.float64).reshape(-1, 2)
    if len(places) < 2:
        valid = "at least two way-points [x, y]"
        raise InvalidSettingError("waypoints_m", [list(p) for p in points], valid)
    chords = np.hypot(*np.diff(places, axis=0).T)
    if not np.all(chords > 1e-3):
        i = int(np.argmin(chords))
        valid = f"a way-point more than 1 mm from the one before it ({points[i]})"
        raise InvalidSettingError(f"waypoints_m.{i + 1}", list(points[i + 1]), valid)
    is_closed = len(places) > 3 and np.array_equal(places[0], places[-1])
    knots = np.concatenate(([0.0], np.cumsum(chords)))
    spline = CubicSpline(knots, places, bc_type="periodic" if is_closed else "natural")

    def evaluate(u: Array) -> tuple[Array, Array, Array]:
        return spline(u), spline(u, 1), spline(u, 2)

    return _Curve(evaluate, float(knots[-1]), float(knots[-1]))
