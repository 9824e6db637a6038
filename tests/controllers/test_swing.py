"""Laws of a swinging foot's path over the ball."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballsim_controllers.footsteps.swing import (
    SwingFoot,
    SwingReference,
    mean_lifting,
)
from ballsim_controllers.messages import Array

RADII = (0.25, 0.5, 1.0)
DT, DURATION, LIFT, FREEZE, DESCENT = 0.002, 0.22, 0.03, 0.06, 0.1
START = np.array([0.03, -0.07])
START_VELOCITY = np.array([0.1, 0.02])
TARGET = np.array([-0.03, -0.06])
TICKS = round(DURATION / DT)


def rolling(velocity: Array, radius: float) -> Callable[[float], tuple[Array, Array]]:
    """Return the motion of a ball at constant velocity."""
    speed = np.append(velocity, 0.0)
    return lambda time: (np.array([0.0, 0.0, radius]) + time * speed, speed)


def swing(
    radius: float,
    velocity: Array | None = None,
    target: Callable[[int], Array] | None = None,
    ticks: int = TICKS + 1,
    height: float = 0.0,
) -> tuple[SwingFoot, list[SwingReference]]:
    """Return a swing's references, one per tick from lift-off on."""
    foot = SwingFoot(radius, LIFT, FREEZE, DESCENT)
    foot.lift_off(START, START_VELOCITY, height, DURATION)
    ball = rolling(np.zeros(2) if velocity is None else velocity, radius)
    references = []
    for tick in range(ticks):
        time = tick * DT
        foot.aim(TARGET if target is None else target(tick), time)
        references.append(foot.advance(time, DT, *ball(time)))
    return foot, references


def heights(references: list[SwingReference], radius: float, velocity: Array) -> Array:
    """Return the soles' distances from the ball's surface."""
    ball = rolling(velocity, radius)
    places = [r.position - ball(k * DT)[0] for k, r in enumerate(references)]
    return np.linalg.norm(places, axis=1) - radius


@pytest.mark.parametrize("radius", RADII)
def test_swing_starts_where_the_foot_is(radius: float) -> None:
    """The first reference is the lift-off state, but for one tick of its motion."""
    for height in (0.0, 0.002):
        _, references = swing(radius, height=height)
        first = references[0]
        place = first.position - [0.0, 0.0, radius]
        assert np.linalg.norm(place) == pytest.approx(radius + height, abs=1e-9)
        expected = START * (radius + height) / radius
        slack = 1.5 * DT * np.abs(START_VELOCITY).max()
        np.testing.assert_allclose(place[:2], expected, atol=slack)
        np.testing.assert_allclose(first.linear_velocity[:2], START_VELOCITY, atol=0.02)


def test_first_reference_is_the_lift_off_state() -> None:
    """The reference at time 0 is exactly the state that was handed over at lift-off."""
    _, references = swing(0.5)
    np.testing.assert_allclose(references[0].position[:2], START, atol=1e-9)


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (0.15, 0.0), (-0.1, 0.05)])
@pytest.mark.parametrize("radius", RADII)
def test_swing_ends_on_its_target(radius: float, velocity: tuple[float, float]) -> None:
    """At the end of the swing the sole touches the ball at the target's offset."""
    speed = np.array(velocity)
    _, references = swing(radius, speed)
    last = references[TICKS]
    centre, _ = rolling(speed, radius)(DURATION)
    place = last.position - centre
    slack = 1e-9 + 1.5 * DT * np.abs(speed).max()
    np.testing.assert_allclose(place[:2], TARGET, atol=slack)
    assert np.linalg.norm(place) == pytest.approx(radius, abs=1e-9)


@pytest.mark.parametrize("radius", RADII)
def test_sole_lands_with_the_balls_surface(radius: float) -> None:
    """The sole meets the surface of the rolling ball at the descent speed alone.

    On the top, where the surface moves at twice the speed of the centre.
    """
    speed = np.array([0.2, -0.1])
    _, references = swing(radius, speed, target=lambda _: np.zeros(2))
    last = references[TICKS]
    expected = np.array([*(2.0 * speed), -DESCENT])
    np.testing.assert_allclose(last.linear_velocity, expected, atol=5e-3)


def test_sole_lands_with_the_surface_off_the_top() -> None:
    """Beside the top the surface moves at omega x r: less forwards, and downwards."""
    radius, speed = 0.25, np.array([0.2, 0.0])
    target = np.array([0.1, 0.06])
    _, references = swing(radius, speed, target=lambda _: target)
    last = references[TICKS]
    normal = np.append(target, np.sqrt(radius**2 - target @ target)) / radius
    spin = np.array([-speed[1], speed[0], 0.0]) / radius
    surface = np.append(speed, 0.0) + np.cross(spin, radius * normal)
    expected = surface - DESCENT * normal
    np.testing.assert_allclose(last.linear_velocity, expected, atol=5e-3)


@pytest.mark.parametrize("radius", RADII)
def test_sole_is_tangent_all_the_way(radius: float) -> None:
    """The sole's normal is the ball's radius through the sole's centre."""
    speed = np.array([0.1, 0.05])
    _, references = swing(radius, speed)
    ball = rolling(speed, radius)
    for tick, reference in enumerate(references):
        normal = reference.position - ball(tick * DT)[0]
        normal /= np.linalg.norm(normal)
        np.testing.assert_allclose(reference.rotation[:, 2], normal, atol=1e-9)
        assert reference.rotation[1, 0] == pytest.approx(0.0, abs=1e-12)
        assert reference.rotation[0, 0] > 0.0


@pytest.mark.parametrize("height", [0.0, 0.003])
@pytest.mark.parametrize("radius", RADII)
def test_sole_clears_the_ball(radius: float, height: float) -> None:
    """Until its end the sole is never below the surface; it rises to the lift once."""
    speed = np.array([0.1, 0.0])
    _, references = swing(radius, speed, height=height)
    found = heights(references, radius, speed)
    assert found.min() > -1e-12
    assert found[1:TICKS].min() > 0.0
    assert LIFT < found.max() < LIFT + 0.004
    turns = np.diff(np.sign(np.diff(found)))
    assert np.count_nonzero(turns) == 1


def test_late_sole_goes_on_down() -> None:
    """Beyond its end the sole presses on at the descent speed and follows the ball."""
    speed = np.array([0.1, 0.0])
    _, references = swing(0.5, speed, ticks=TICKS + 26)
    found = heights(references, 0.5, speed)
    late = DT * np.arange(26)
    np.testing.assert_allclose(found[TICKS:], -DESCENT * late, atol=1e-9)
    ball = rolling(speed, 0.5)
    offsets = [r.position[0] - ball(k * DT)[0][0] for k, r in enumerate(references)]
    rate = (offsets[-1] - offsets[TICKS]) / (25 * DT)
    assert rate == pytest.approx(speed[0], abs=0.01)


def jumps(references: list[SwingReference]) -> tuple[Array, Array]:
    """Return the largest steps of velocity and acceleration from tick to tick."""
    velocities = np.array([r.linear_velocity for r in references])
    # What is to be from this tick on is that of the next one.
    accelerations = np.array([r.linear_acceleration for r in references])[:-2]
    return (
        np.abs(np.diff(velocities, axis=0)).max(axis=0),
        np.abs(np.diff(accelerations, axis=0)).max(axis=0),
    )


def test_moving_target_makes_no_jumps() -> None:
    """Place and velocity stay continuous while the target moves at .5 m/s."""

    def target(tick: int) -> Array:
        return TARGET + np.array([0.5 * tick * DT, 0.0])

    _, plain = swing(0.5)
    _, moving = swing(0.5, target=target)
    places = np.array([r.position for r in moving])
    assert np.abs(np.diff(places, axis=0)).max() < 1.5 * DT
    velocity_steps, _ = jumps(moving[: TICKS - 1])
    plain_steps, _ = jumps(plain[: TICKS - 1])
    assert velocity_steps.max() < 2.5 * plain_steps.max()
    assert velocity_steps.max() < 0.1


def test_jump_of_the_target_leaves_place_and_velocity() -> None:
    """When the target jumps, place and velocity go on; the new target is met."""
    jump = np.array([0.04, -0.02])

    def target(tick: int) -> Array:
        return TARGET if tick < 40 else TARGET + jump

    _, plain = swing(0.5)
    _, moved = swing(0.5, target=target)
    for tick in range(40):
        np.testing.assert_array_equal(moved[tick].position, plain[tick].position)
    np.testing.assert_allclose(moved[40].position, plain[40].position, atol=1e-4)
    np.testing.assert_allclose(
        moved[40].linear_velocity, plain[40].linear_velocity, atol=0.03
    )
    np.testing.assert_allclose(moved[TICKS].position[:2], TARGET + jump, atol=1e-9)


def test_target_freezes_before_landing() -> None:
    """A target that comes within the freeze time of the landing is not taken."""
    before = round((DURATION - FREEZE) / DT) - 2
    other = TARGET + np.array([0.05, 0.0])
    for tick, expected in ((before, other), (before + 4, TARGET)):

        def target(k: int, start: int = tick) -> Array:
            return TARGET if k < start else other if k == start else TARGET * np.nan

        foot = SwingFoot(0.5, LIFT, FREEZE, DESCENT)
        foot.lift_off(START, START_VELOCITY, 0.0, DURATION)
        foot.aim(TARGET, 0.0)
        foot.aim(target(tick), tick * DT)
        np.testing.assert_array_equal(foot.target, expected)


def test_target_is_a_copy() -> None:
    """Changing the array that was aimed at does not move the target."""
    foot = SwingFoot(0.5, LIFT, FREEZE, DESCENT)
    start, target = START.copy(), TARGET.copy()
    foot.lift_off(start, START_VELOCITY, 0.0, DURATION)
    start[:] = 9.0
    np.testing.assert_array_equal(foot.target, START)
    foot.aim(target, 0.0)
    target[:] = 9.0
    np.testing.assert_array_equal(foot.target, TARGET)


def test_without_aim_the_foot_lands_where_it_lifted() -> None:
    """The first target of a swing is the place that the foot comes from."""
    foot = SwingFoot(0.5, LIFT, FREEZE, DESCENT)
    foot.aim(TARGET, 0.0)
    foot.lift_off(START, np.zeros(2), 0.0, DURATION)
    reference = None
    for tick in range(TICKS + 1):
        reference = foot.advance(tick * DT, DT, np.array([0.0, 0.0, 0.5]), np.zeros(3))
    assert reference is not None
    np.testing.assert_allclose(reference.position[:2], START, atol=1e-9)


@pytest.mark.parametrize("height", [0.0, 0.003])
def test_path_may_end_below_the_ball(height: float) -> None:
    """A depth moves the end of the path, and nothing of its start."""
    depth, ball = 0.006, np.array([0.0, 0.0, 0.5])
    paths = []
    for value in (0.0, depth):
        foot = SwingFoot(0.5, LIFT, FREEZE, DESCENT)
        foot.lift_off(np.zeros(2), np.zeros(2), height, DURATION, value)
        path = [foot.advance(k * DT, DT, ball, np.zeros(3)) for k in range(TICKS + 9)]
        paths.append(path)
    plain, deep = paths
    lower = [a.position[2] - b.position[2] for a, b in zip(plain, deep, strict=True)]
    assert lower[0] == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(lower) >= -1e-12).all()
    np.testing.assert_allclose(lower[TICKS:], depth, atol=1e-12)
    for path in paths:
        heights = np.array([r.position[2] for r in path])
        rates = np.array([r.linear_velocity[2] for r in path])
        by_difference = (heights[2:] - heights[:-2]) / (2.0 * DT)
        np.testing.assert_allclose(rates[1:-1], by_difference, atol=3e-3)


def derivative_errors(radius: float, velocity: Array) -> tuple[float, float]:
    """Return the largest error of velocity and acceleration against differences.

    In the middle of the swing; differences of a reference that is one tick long.
    """
    _, references = swing(radius, velocity)
    places = np.array([r.position for r in references])
    velocities = np.array([r.linear_velocity for r in references])
    # What is to be from this tick on is that of the next one.
    accelerations = np.array([r.linear_acceleration for r in references])[:-2]
    inside = slice(5, TICKS - 5)
    by_difference = (places[2:] - places[:-2]) / (2.0 * DT)
    second = (velocities[2:] - velocities[:-2]) / (2.0 * DT)
    return (
        float(np.abs(by_difference - velocities[1:-1])[inside].max()),
        float(np.abs(second - accelerations)[inside].max()),
    )


@pytest.mark.parametrize("radius", RADII)
def test_velocity_is_nearly_the_rate_of_the_place(radius: float) -> None:
    """Velocity and place of the reference agree to lift over radius of the speed."""
    _, references = swing(radius)
    speed = max(np.abs(r.linear_velocity).max() for r in references)
    velocity_error, _ = derivative_errors(radius, np.zeros(2))
    assert velocity_error < 1.2 * speed * LIFT / radius


@pytest.mark.parametrize("radius", RADII)
def test_velocity_is_the_rate_of_the_place(radius: float) -> None:
    """The reference's velocity and acceleration are derivatives of its place."""
    velocity_error, acceleration_error = derivative_errors(radius, np.zeros(2))
    assert velocity_error < 2e-3
    assert acceleration_error < 0.1


@pytest.mark.parametrize("radius", RADII)
def test_angular_motion_is_the_rate_of_the_attitude(radius: float) -> None:
    """Angular velocity and acceleration are derivatives of the sole's attitude.

    But for the turn about the normal, which nothing asks for.
    """
    _, references = swing(radius)
    normals = np.array([r.rotation[:, 2] for r in references])
    velocities = np.array([r.angular_velocity for r in references])
    accelerations = np.array([r.angular_acceleration for r in references])[:-2]
    inside = slice(5, TICKS - 5)
    by_difference = (normals[2:] - normals[:-2]) / (2.0 * DT)
    rates = np.cross(velocities, normals)[1:-1]
    np.testing.assert_allclose(rates[inside], by_difference[inside], atol=5e-3)
    second = (velocities[2:] - velocities[:-2]) / (2.0 * DT)
    np.testing.assert_allclose(accelerations[inside], second[inside], atol=0.5)
    assert np.abs(rates).max() > 0.5
    assert np.abs(second).max() > 5.0
    np.testing.assert_allclose((velocities * normals).sum(axis=1), 0.0, atol=1e-12)


def test_mean_lifting_is_the_rise_of_the_path() -> None:
    """Means over the cells add up to the speed of the path that ends at rest."""
    count, cell = 11, 0.02
    lifting = np.array(mean_lifting(LIFT, count, cell))
    assert lifting.sum() == pytest.approx(0.0, abs=1e-9)
    foot = SwingFoot(0.5, LIFT, FREEZE, 0.0)
    foot.lift_off(np.zeros(2), np.zeros(2), 0.0, count * cell)
    ball, dt = np.array([0.0, 0.0, 0.5]), 0.005
    path = [foot.advance(k * dt, dt, ball, np.zeros(3)) for k in range(45)]
    speeds = np.array([reference.linear_velocity[2] for reference in path])
    expected = np.diff(speeds[::4][:count])
    np.testing.assert_allclose(lifting[: count - 1] * cell, expected, atol=1e-9)
    assert np.abs(lifting).max() > 5.0


def test_unreachable_target_stays_on_the_ball() -> None:
    """A target beyond the ball is followed to nine tenths of its radius at most."""
    _, references = swing(0.25, target=lambda _: np.array([0.4, 0.0]))
    for reference in references:
        assert np.isfinite(reference.position).all()
        normal = reference.rotation[:, 2]
        assert np.linalg.norm(normal[:2]) <= 0.9 + 1e-9


def test_mirrored_swing() -> None:
    """Exchanging left and right reflects the whole path."""
    image = np.array([1.0, -1.0])
    paths = []
    for sign in (np.ones(2), image):
        foot = SwingFoot(0.5, LIFT, FREEZE, DESCENT)
        foot.lift_off(START * sign, START_VELOCITY * sign, 0.0, DURATION)
        path = []
        for tick in range(TICKS):
            foot.aim(TARGET * sign, tick * DT)
            ball = np.array([0.0, 0.0, 0.5])
            path.append(foot.advance(tick * DT, DT, ball, np.zeros(3)))
        paths.append(path)
    reflection = np.diag([1.0, -1.0, 1.0])
    for one, other in zip(*paths, strict=True):
        np.testing.assert_allclose(
            other.position, reflection @ one.position, atol=1e-12
        )
        np.testing.assert_allclose(
            other.linear_acceleration, reflection @ one.linear_acceleration, atol=1e-9
        )
        np.testing.assert_allclose(
            other.rotation, reflection @ one.rotation @ reflection, atol=1e-12
        )
