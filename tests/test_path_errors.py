"""Laws of the distance from a path: what counts, and how much."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.path_errors import PathErrors, compute_cross_track
from ballsim_controllers.commands import Circle, FigureEight, WayPoints
from ballsim_controllers.floor_path import trace_path
from ballsim_controllers.messages import Array


def walk(errors: PathErrors, places: Array, counts: Array, block: int) -> None:
    """Hand a course over in blocks, from the tick of the command on."""
    first = 200
    for start in range(0, len(places), block):
        rows = slice(start, start + block)
        errors.add(first + start, places[rows], counts[rows])


def around(offset: float, n: int = 5000) -> Array:
    """Return places on the circle of the scenario, offset to its outside."""
    angle = np.linspace(0.0, 2.0 * np.pi, n)
    radius = 1.0 + offset
    return np.column_stack((radius * np.sin(angle), 1.0 - radius * np.cos(angle)))


def test_distance_from_curves_is_that_of_geometry() -> None:
    """Inside and outside of a circle, beside and beyond a line, at any place."""
    places = np.random.default_rng(0).uniform((-0.6, 0.4), (0.6, 1.6), (500, 2))
    distances = compute_cross_track(trace_path(Circle(1.0)), places)
    expected = np.abs(np.hypot(*(places - [0.0, 1.0]).T) - 1.0)
    np.testing.assert_allclose(distances, expected, atol=1e-5)
    line = trace_path(WayPoints(((0.0, 0.0), (2.0, 0.0))))
    found = compute_cross_track(line, np.array([[1.0, 0.3], [-0.3, 0.4], [2.5, 0.0]]))
    np.testing.assert_allclose(found, [0.3, 0.5, 0.5], atol=5e-3)


def test_places_on_the_path_have_no_distance() -> None:
    """The crossing of a figure eight is on both of its branches."""
    trace = trace_path(FigureEight(2.0, 1.0))
    between = 0.5 * (trace.points[1:] + trace.points[:-1])
    assert compute_cross_track(trace, between).max() < 1e-4


@pytest.mark.parametrize("offset", [0.05, -0.08])
@pytest.mark.parametrize("block", [7, 1000, 100000])
def test_constant_offset_is_rms_and_maximum(offset: float, block: int) -> None:
    """However the course is cut into blocks."""
    errors = PathErrors(load_config("path").config)
    places = around(offset)
    walk(errors, places, np.arange(len(places)) // 60, block)
    assert errors.finish() == pytest.approx((abs(offset), abs(offset)), abs=1e-5)


def test_only_what_lies_between_touchdowns_counts() -> None:
    """Standing beside the path before and after makes the error no other."""
    errors = PathErrors(load_config("path").config)
    counts = np.repeat([0, 1, 2, 3], [400, 50, 100, 500])
    places = np.zeros((len(counts), 2))
    places[:, 0], places[450:550, 1] = 0.0, -0.02
    places[550:, 1], places[:400, 1] = -0.5, -0.05
    walk(errors, places, counts, 128)
    rms, largest = errors.finish()
    assert rms == pytest.approx(0.02 * math.sqrt(100 / 150), rel=1e-6)
    assert largest == pytest.approx(0.02)


def test_way_to_the_first_point_does_not_count() -> None:
    """A path that begins elsewhere is measured from there on."""
    overrides = ["curve=way-points", "waypoints=[[1, 1], [2, 1]]"]
    errors = PathErrors(load_config("path", overrides).config)
    approach = np.linspace([0.0, 0.0], [0.9, 1.0], 900)
    path = np.linspace([0.95, 1.01], [2.0, 1.01], 1000)
    places = np.concatenate((approach, path))
    walk(errors, places, np.arange(len(places)) // 10, 64)
    assert errors.finish()[1] == pytest.approx(0.05, abs=0.06)
    assert errors.finish()[0] == pytest.approx(0.01, abs=0.005)


def test_nothing_is_defined_without_a_path() -> None:
    """Neither for a run without a path nor for a robot that never stepped."""
    places, counts = np.zeros((50, 2)), np.zeros(50, dtype=int)
    for scenario in ("stand", "floor-target", "path"):
        errors = PathErrors(load_config(scenario).config)
        walk(errors, places, counts, 20)
        assert all(math.isnan(value) for value in errors.finish())
        assert errors.has_path == (scenario == "path")
