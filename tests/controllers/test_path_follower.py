"""Laws of the reference on a path: on it, smooth, within limits, from rest to rest."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from ballsim_controllers.commands import Circle, FigureEight, FloorPath, WayPoints
from ballsim_controllers.floor_path import trace_path
from ballsim_controllers.messages import Array
from ballsim_controllers.motion_limits import PathLimits
from ballsim_controllers.path_follower import PathFollower, limit_speeds

DT = 0.005
LIMITS = PathLimits((0.2, 0.08), 0.2, 0.04, 0.6)
CURVE = WayPoints(((0.2, 0.1), (1.0, 0.2), (1.5, 1.0), (1.2, 2.0)))
PATHS = [Circle(1.0), Circle(-0.4), FigureEight(2.0, 1.0), CURVE]


def follow(path: FloorPath, limits: PathLimits = LIMITS, radius: float = 0.5) -> Array:
    """Return the ball's reference at each tick, shape (n, 2, 4), [m]."""
    return radius * follow_all(path, limits, radius)[:, :2]


def follow_all(path: FloorPath, limits: PathLimits, radius: float = 0.5) -> Array:
    """Return the reference of ball and direction at each tick, (n, 3, 4), [rad]."""
    follower = PathFollower(path, limits, radius)
    samples = [follower.samples.copy()]
    while not follower.is_at_rest:
        follower.advance(DT)
        samples.append(follower.samples.copy())
    return np.array(samples)


@pytest.mark.parametrize("path", PATHS)
def test_reference_keeps_to_the_path(path: FloorPath) -> None:
    """From its first to its last point, at rest at both, never off it."""
    motion, trace = follow(path), trace_path(path)
    places = motion[:, :, 0]
    distance, _ = cKDTree(trace.points).query(places)
    assert distance.max() < 0.5 * trace.arc[1] + 1e-4
    np.testing.assert_allclose(places[[0, -1]], trace.points[[0, -1]], atol=1e-12)
    np.testing.assert_allclose(motion[[0, -1], :, 1:], 0.0, atol=1e-12)
    way = np.hypot(*np.diff(places, axis=0).T).sum()
    assert way == pytest.approx(trace.length, rel=1e-4)


@pytest.mark.parametrize("path", PATHS)
def test_derivatives_belong_together(path: FloorPath) -> None:
    """Velocity and acceleration are rates; the acceleration never jumps."""
    motion = follow(path)
    for order in (0, 1):
        rate = np.diff(motion[:, :, order], axis=0) / DT
        mean = 0.5 * (motion[1:, :, order + 1] + motion[:-1, :, order + 1])
        np.testing.assert_allclose(rate, mean, atol=1e-3 if order else 1e-5)
    jumps = np.abs(np.diff(motion[:, :, 2], axis=0))
    assert jumps.max() < 2.5 * LIMITS.acceleration * DT / LIMITS.smoothing_time


@pytest.mark.parametrize("path", PATHS)
def test_limits_hold_in_every_direction(path: FloorPath) -> None:
    """Speeds lie within the ellipse; accelerations are what the floor allows."""
    motion = follow(path)
    share = np.hypot(*(motion[:, :, 1] / np.array(LIMITS.speeds)).T)
    assert share.max() < 1.03
    assert np.hypot(*motion[:, :, 2].T).max() < 1.1 * LIMITS.acceleration


def test_straight_line_is_cruised_at_the_speed_of_its_direction() -> None:
    """Forwards, sideways, and slower where the command says so."""
    for place, top, speed in (
        ((2.0, 0.0), 0.2, 0.2),
        ((0.0, -2.0), 0.2, 0.08),
        ((-2.0, 0.0), 0.05, 0.05),
    ):
        limits = PathLimits(LIMITS.speeds, top, 0.04, 0.6)
        motion = follow(WayPoints(((0.0, 0.0), place)), limits)
        speeds = np.hypot(*motion[:, :, 1].T)
        assert speeds.max() == pytest.approx(speed, rel=1e-6)


def test_tight_bends_are_taken_slowly() -> None:
    """The way across the path takes no more than its share of the acceleration."""
    trace = trace_path(Circle(0.2))
    speeds, left = limit_speeds(trace, LIMITS)
    across = np.square(speeds) / 0.2
    np.testing.assert_allclose(np.hypot(across, left), LIMITS.acceleration, rtol=0.3)
    assert (across <= np.sqrt(0.5) * LIMITS.acceleration * (1.0 + 1e-9)).all()


def test_mirrored_path_has_the_mirrored_reference() -> None:
    """Left and right are alike, at every instant."""
    left, right = follow(FigureEight(2.0, 1.0)), follow(FigureEight(2.0, -1.0))
    np.testing.assert_allclose(right[:, 0], left[:, 0], atol=1e-9)
    np.testing.assert_allclose(right[:, 1], -left[:, 1], atol=1e-9)


def test_ball_of_another_radius_rolls_the_same_way_on_the_floor() -> None:
    """Angles are ways over the radius."""
    large, small = follow(CURVE, radius=1.0), follow(CURVE, radius=0.25)
    np.testing.assert_allclose(large, small, atol=1e-9)


def test_stop_comes_to_rest_on_the_path() -> None:
    """Where it stops is on the path, before its end, without a jump."""
    follower, trace = PathFollower(Circle(1.0), LIMITS, 0.5), trace_path(Circle(1.0))
    for _ in range(2000):
        follower.advance(DT)
    speed = 0.5 * np.hypot(*follower.samples[:2, 1])
    before = 0.5 * follower.samples[:2, 0]
    follower.stop()
    ticks = 0
    while not follower.is_at_rest:
        follower.advance(DT)
        ticks += 1
    place = 0.5 * follower.samples[:2, 0]
    assert np.hypot(*(place - before)) > 0.3 * speed**2 / LIMITS.acceleration
    assert ticks * DT < 3.0 * speed / LIMITS.acceleration + LIMITS.smoothing_time
    assert cKDTree(trace.points).query(place)[0] < 0.5 * trace.arc[1] + 1e-4
    np.testing.assert_allclose(follower.samples[:, 1:], 0.0, atol=1e-12)


@pytest.mark.parametrize("path", PATHS)
def test_direction_is_that_of_the_way(path: FloorPath) -> None:
    """Who faces along the path walks forwards only; its turns have a limit."""
    limits = PathLimits(LIMITS.speeds, 0.2, 0.04, 0.6, None, 0.3)
    motion = follow_all(path, limits)
    velocity, direction = 0.5 * motion[:, :2, 1], motion[:, 2]
    sine, cosine = np.sin(direction[:, 0]), np.cos(direction[:, 0])
    across = cosine * velocity[:, 1] - sine * velocity[:, 0]
    along = cosine * velocity[:, 0] + sine * velocity[:, 1]
    assert np.abs(across).max() < 1e-3
    assert along.min() > -1e-9
    assert along.max() > 1.2 * LIMITS.speeds[1]
    assert np.abs(direction[:, 1]).max() < 1.1 * limits.turn_rate
    rates = np.diff(direction[:, 0]) / DT
    mean = 0.5 * (direction[1:, 1] + direction[:-1, 1])
    np.testing.assert_allclose(rates, mean, atol=1e-3)
