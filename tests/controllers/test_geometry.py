"""Laws of rotations and of a flat sole on a sphere."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ballsim_controllers.geometry import (
    cross,
    integrate_rotation,
    quaternion_to_rotation,
    rotation_from_vector,
    rotation_to_quaternion,
    rotation_vector_between,
    skew,
    sole_rotation_on_ball,
)
from ballsim_controllers.messages import Array

REFLECTION = np.diag([1.0, -1.0, 1.0])


def random_rotations(count: int, seed: int = 0) -> list[Array]:
    """Return attitudes that are uniform over all rotations."""
    generator = np.random.default_rng(seed)
    return list(Rotation.random(count, rng=generator).as_matrix())


def half_turns() -> list[Array]:
    """Return rotations by pi about axes in every octant: the worst for quaternions."""
    axes = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1).T
    axes = axes[np.abs(axes).sum(axis=1) > 0.0]
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    return [2.0 * np.outer(axis, axis) - np.eye(3) for axis in axes]


def assert_rotation(rotation: Array, tolerance: float = 1e-12) -> None:
    """Check that a matrix is a proper rotation."""
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=tolerance)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=tolerance)


def test_skew_is_the_cross_product() -> None:
    """S(a) b = a x b = -b x a, for our own cross product and for numpy's."""
    for a, b in np.random.default_rng(1).normal(size=(50, 2, 3)):
        np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-14)
        np.testing.assert_allclose(cross(a, b), np.cross(a, b), atol=1e-14)
        np.testing.assert_array_equal(skew(a), -skew(a).T)
        np.testing.assert_array_equal(cross(a, a), np.zeros(3))


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-7, 0.999e-6, 1.001e-6, 1e-3, 1.0, 7.0])
def test_exponential_is_a_rotation_about_its_vector(size: float) -> None:
    """exp(v) is proper, leaves v alone, and equals scipy's on every scale."""
    for direction in np.random.default_rng(2).normal(size=(20, 3)):
        vector = size * direction / np.linalg.norm(direction)
        rotation = rotation_from_vector(vector)
        assert_rotation(rotation)
        np.testing.assert_allclose(rotation @ vector, vector, atol=1e-14)
        expected = Rotation.from_rotvec(vector).as_matrix()
        np.testing.assert_allclose(rotation, expected, atol=1e-14)


def test_exponential_is_a_group_along_one_axis() -> None:
    """exp(a v) exp(b v) = exp((a + b) v), and exp(-v) is the inverse of exp(v)."""
    generator = np.random.default_rng(3)
    for vector in generator.normal(size=(20, 3)):
        a, b = generator.normal(size=2)
        product = rotation_from_vector(a * vector) @ rotation_from_vector(b * vector)
        np.testing.assert_allclose(
            product, rotation_from_vector((a + b) * vector), atol=1e-13
        )
        np.testing.assert_allclose(
            rotation_from_vector(-vector), rotation_from_vector(vector).T, atol=1e-15
        )


def test_exponential_turns_with_its_axis() -> None:
    """R exp(v) R' = exp(R v): the map knows no preferred direction."""
    vectors = np.random.default_rng(4).normal(size=(20, 3))
    for rotation, vector in zip(random_rotations(20, 4), vectors, strict=True):
        turned = rotation @ rotation_from_vector(vector) @ rotation.T
        np.testing.assert_allclose(
            turned, rotation_from_vector(rotation @ vector), atol=1e-13
        )


def test_quaternion_round_trip() -> None:
    """Matrix -> quaternion -> matrix is the identity, half turns included."""
    for rotation in (*random_rotations(200, 5), *half_turns(), np.eye(3)):
        quaternion = rotation_to_quaternion(rotation)
        assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-15)
        assert quaternion[0] >= 0.0
        np.testing.assert_allclose(
            quaternion_to_rotation(quaternion), rotation, atol=1e-14
        )


def test_quaternions_cover_rotations_twice() -> None:
    """q and -q are one rotation, and the one with w >= 0 is returned."""
    for quaternion in np.random.default_rng(6).normal(size=(50, 4)):
        unit = quaternion / np.linalg.norm(quaternion)
        rotation = quaternion_to_rotation(unit)
        assert_rotation(rotation)
        np.testing.assert_allclose(rotation, quaternion_to_rotation(-unit), atol=1e-15)
        np.testing.assert_allclose(
            rotation_to_quaternion(rotation), unit * np.sign(unit[0]), atol=1e-14
        )


def test_quaternion_is_w_first_and_body_to_world() -> None:
    """A quarter turn about z takes x to y."""
    half = math.pi / 4.0
    rotation = quaternion_to_rotation(
        np.array([math.cos(half), 0.0, 0.0, math.sin(half)])
    )
    np.testing.assert_allclose(rotation @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    "angle", [0.0, 1e-12, 1e-9, 3e-9, 1e-6, 0.1, 2.0, 3.1, 3.14159]
)
def test_vector_between_leads_to_the_target(angle: float) -> None:
    """exp(r) R = target exactly, with an angle below pi, on every scale."""
    generator = np.random.default_rng(7)
    for rotation in random_rotations(20, 8):
        axis = generator.normal(size=3)
        vector = angle * axis / np.linalg.norm(axis)
        target = rotation_from_vector(vector) @ rotation
        found = rotation_vector_between(rotation, target)
        np.testing.assert_allclose(
            rotation_from_vector(found) @ rotation, target, atol=1e-14
        )
        assert np.linalg.norm(found) <= math.pi
        # The angle of a rotation by almost pi is known to the root of rounding.
        np.testing.assert_allclose(found, vector, atol=1e-13 if angle < 3.1 else 1e-9)


def test_vector_between_is_in_the_world() -> None:
    """A common turn of both attitudes turns the vector; swapping them negates it."""
    rotations = random_rotations(60, 9)
    for start, end, turn in zip(
        rotations[:20], rotations[20:40], rotations[40:], strict=True
    ):
        vector = rotation_vector_between(start, end)
        np.testing.assert_allclose(
            rotation_vector_between(turn @ start, turn @ end), turn @ vector, atol=1e-12
        )
        np.testing.assert_allclose(
            rotation_vector_between(end, start), -vector, atol=1e-12
        )
        # The same change of the body's own frame changes nothing.
        np.testing.assert_allclose(
            rotation_vector_between(start @ turn, end @ turn), vector, atol=1e-12
        )


def test_integration_keeps_rotations_orthonormal() -> None:
    """After 10 000 steps of a wild motion the attitude is still a rotation."""
    generator = np.random.default_rng(10)
    rotation = np.eye(3)
    for omega in generator.normal(scale=20.0, size=(10_000, 3)):
        rotation = integrate_rotation(rotation, omega, 0.002)
    assert_rotation(rotation, 1e-14)


def test_integration_mends_a_bad_rotation() -> None:
    """Rounding errors shrink: the distance from the rotations is squared."""
    rotation = random_rotations(1, 11)[0] + 1e-5 * np.random.default_rng(11).normal(
        size=(3, 3)
    )
    before = np.abs(rotation.T @ rotation - np.eye(3)).max()
    after = integrate_rotation(rotation, np.zeros(3), 0.002)
    assert np.abs(after.T @ after - np.eye(3)).max() < 3.0 * before**2


def test_constant_velocity_is_integrated_exactly() -> None:
    """N steps at one velocity equal a single rotation about the body's axis."""
    start = random_rotations(1, 12)[0]
    omega = np.array([0.4, -1.1, 2.3])
    rotation = start
    for _ in range(1000):
        rotation = integrate_rotation(rotation, omega, 0.002)
    np.testing.assert_allclose(
        rotation, start @ rotation_from_vector(2.0 * omega), atol=1e-12
    )
    np.testing.assert_allclose(
        integrate_rotation(rotation, omega, -2.0), start, atol=1e-12
    )


def random_normals(count: int, seed: int) -> Array:
    """Return contact normals up to 50 degrees off the vertical."""
    generator = np.random.default_rng(seed)
    tilt = generator.uniform(0.0, 0.9, count)
    azimuth = generator.uniform(-math.pi, math.pi, count)
    return np.column_stack(
        (np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt))
    )


def test_sole_is_tangent_and_keeps_its_heading() -> None:
    """The sole's z is the normal, its toes point along the heading, seen from above."""
    generator = np.random.default_rng(13)
    for normal in random_normals(50, 13):
        heading = generator.uniform(-math.pi, math.pi)
        rotation = sole_rotation_on_ball(normal, heading)
        assert_rotation(rotation, 1e-14)
        np.testing.assert_allclose(rotation[:, 2], normal, atol=1e-15)
        toes = rotation[:2, 0]
        found = math.atan2(toes[1], toes[0])
        assert math.remainder(found - heading, 2.0 * math.pi) == pytest.approx(
            0.0, abs=1e-14
        )


def test_sole_on_top_is_level() -> None:
    """At the ball's top the sole is turned by its heading alone."""
    for heading in (-2.0, 0.0, 0.3):
        np.testing.assert_allclose(
            sole_rotation_on_ball(np.array([0.0, 0.0, 1.0]), heading),
            rotation_from_vector(np.array([0.0, 0.0, heading])),
            atol=1e-15,
        )


def test_sole_turns_and_mirrors_with_the_ball() -> None:
    """Turning normal and heading turns the sole; mirroring them mirrors it."""
    for normal in random_normals(20, 14):
        rotation = sole_rotation_on_ball(normal, 0.4)
        turn = rotation_from_vector(np.array([0.0, 0.0, 1.3]))
        np.testing.assert_allclose(
            sole_rotation_on_ball(turn @ normal, 1.7), turn @ rotation, atol=1e-14
        )
        np.testing.assert_allclose(
            sole_rotation_on_ball(REFLECTION @ normal, -0.4),
            REFLECTION @ rotation @ REFLECTION,
            atol=1e-14,
        )
