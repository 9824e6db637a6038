"""Laws of curves on the floor: length, closure, symmetry, what cannot be followed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from ballsim_controllers.commands import Circle, FigureEight, FloorPath, WayPoints
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.floor_path import trace_path

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0))
BEND = ((0.0, 0.0), (1.0, 0.2), (1.5, 1.0), (1.2, 2.0))
PATHS = [
    Circle(1.0),
    Circle(-0.3),
    FigureEight(2.0, 1.0),
    WayPoints(BEND),
    WayPoints(SQUARE),
]
MIRRORED = np.array([1.0, -1.0])


def mirror(path: FloorPath) -> FloorPath:
    """Return the path with left and right exchanged."""
    match path:
        case Circle(radius):
            return Circle(-radius)
        case FigureEight(length, width):
            return FigureEight(length, -width)
        case WayPoints(points):
            return WayPoints(tuple((x, -y) for x, y in points))


@pytest.mark.parametrize("radius", [0.05, 0.5, -1.0, 20.0])
def test_circle_is_round(radius: float) -> None:
    """Length, distance from the centre and curvature are those of a circle."""
    trace = trace_path(Circle(radius))
    assert trace.length == pytest.approx(2.0 * np.pi * abs(radius), rel=1e-9)
    from_centre = trace.points - np.array([0.0, radius])
    np.testing.assert_allclose(np.hypot(*from_centre.T), abs(radius), rtol=1e-12)
    np.testing.assert_allclose(trace.curvatures, 1.0 / radius, rtol=1e-9)
    np.testing.assert_allclose(trace.directions[0], [1.0, 0.0], atol=1e-12)


def test_figure_eight_has_its_size_and_length() -> None:
    """It is as long and wide as asked, and its length is that of the integral."""
    trace = trace_path(FigureEight(2.0, 1.0))
    assert np.ptp(trace.points, axis=0) == pytest.approx([2.0, 1.0], abs=1e-4)
    length = quad(lambda u: np.hypot(np.cos(u), np.cos(2.0 * u)), 0.0, 2.0 * np.pi)[0]
    assert trace.length == pytest.approx(length, rel=1e-7)
    half = len(trace.arc) // 2
    assert np.hypot(*trace.points[half]) < 0.006  # the crossing, within a sample


@pytest.mark.parametrize("path", PATHS)
def test_samples_are_equally_far_apart(path: FloorPath) -> None:
    """Arc lengths, tangents and curvatures are those of the places."""
    trace = trace_path(path)
    spacing = trace.arc[1]
    steps = np.diff(trace.points, axis=0)
    np.testing.assert_allclose(np.hypot(*steps.T), spacing, rtol=2e-3)
    middle = 0.5 * (trace.directions[1:] + trace.directions[:-1])
    np.testing.assert_allclose(steps / spacing, middle, atol=2e-3)
    turns = np.unwrap(np.arctan2(*trace.directions.T[::-1]))
    mean = 0.5 * (trace.curvatures[1:] + trace.curvatures[:-1])
    np.testing.assert_allclose(np.diff(turns) / spacing, mean, atol=0.05)


@pytest.mark.parametrize("path", [p for p in PATHS if p != WayPoints(BEND)])
def test_closed_curves_close_smoothly(path: FloorPath) -> None:
    """They end where they began, in the same direction, with the same bend."""
    trace = trace_path(path)
    for values in (trace.points, trace.directions, trace.curvatures):
        np.testing.assert_allclose(values[-1], values[0], atol=1e-9)


@pytest.mark.parametrize("path", PATHS)
def test_mirrored_path_is_the_mirror_image(path: FloorPath) -> None:
    """Left and right are alike."""
    here, there = trace_path(path), trace_path(mirror(path))
    np.testing.assert_allclose(there.points, here.points * MIRRORED, atol=1e-12)
    np.testing.assert_allclose(there.curvatures, -here.curvatures, atol=1e-9)


def test_path_goes_through_its_way_points() -> None:
    """Each way-point lies on the path, the first and the last at its ends."""
    trace = trace_path(WayPoints(BEND))
    for point in np.array(BEND):
        assert np.hypot(*(trace.points - point).T).min() < 0.5 * trace.arc[1] + 1e-9
    ends = np.array(BEND)[[0, -1]]
    np.testing.assert_allclose(trace.points[[0, -1]], ends, atol=1e-12)


def test_two_way_points_are_a_straight_line() -> None:
    """No bend, the shortest length."""
    trace = trace_path(WayPoints(((0.0, 0.0), (-1.2, 0.9))))
    assert trace.length == pytest.approx(1.5, rel=1e-12)
    np.testing.assert_allclose(trace.directions, [[-0.8, 0.6]] * len(trace.arc))
    np.testing.assert_allclose(trace.curvatures, 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("path", "key"),
    [
        (Circle(0.0), "radius_m"),
        (Circle(0.049), "radius_m"),
        (FigureEight(2.0, 0.0), "width_m"),
        (FigureEight(0.0, 1.0), "length_m"),
        (WayPoints(()), "waypoints_m"),
        (WayPoints(((0.0, 0.0),)), "waypoints_m"),
        (WayPoints(((0.0, 0.0), (1.0, 0.0), (1.0, 0.0))), "waypoints_m.2"),
        (WayPoints(((0.0, 0.0), (1.0, 0.0), (0.0, 0.0))), "waypoints_m"),
        (WayPoints(((0.0, 0.0), (1.0, 0.0), (0.0, 0.001))), "waypoints_m"),
    ],
)
def test_paths_that_nobody_can_follow_are_refused(path: FloorPath, key: str) -> None:
    """Corners, ways back and places named twice are named."""
    with pytest.raises(InvalidSettingError) as caught:
        trace_path(path)
    assert caught.value.key == key
