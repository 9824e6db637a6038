"""Laws of the tilt filter: honest about its errors, not fooled by acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.stats

from ballsim_controllers.estimation.tilt import TiltFilter, TiltNoise
from ballsim_controllers.geometry import (
    integrate_rotation,
    rotation_from_vector,
    rotation_vector_between,
)
from ballsim_controllers.messages import Array

GRAVITY = 9.81
UP = np.array([0.0, 0.0, GRAVITY])
NOISE = TiltNoise()
PERIOD = 0.01


@dataclass
class Trunk:
    """A trunk that sways and accelerates, in step with the filter's integration."""

    rotation: Array
    velocity: Array
    time: float = 0.0

    def motion(self) -> tuple[Array, Array]:
        """Return angular velocity in the trunk and acceleration in the world."""
        t = self.time
        omega = np.array([0.2 * math.cos(2.0 * t), 0.3 * math.sin(3.0 * t), 0.1])
        acceleration = np.array([0.4 * math.sin(2.5 * t), 0.3 * math.cos(t), 0.2])
        return omega, acceleration

    def advance(self) -> tuple[Array, Array]:
        """Move on by one period; return exact gyro and specific force there."""
        before, _ = self.motion()
        self.time += PERIOD
        omega, acceleration = self.motion()
        self.rotation = integrate_rotation(
            self.rotation, 0.5 * (before + omega), PERIOD
        )
        self.velocity = self.velocity + PERIOD * acceleration
        force = self.rotation.T @ (acceleration + UP)
        return omega, force


def tilt_error(found: TiltFilter, trunk: Trunk) -> Array:
    """Return (velocity, tilt) errors along both axes, shape (2, 2)."""
    velocity = trunk.velocity - found.velocity
    turn = rotation_vector_between(found.rotation, trunk.rotation)
    return np.array([[velocity[0], turn[1]], [velocity[1], -turn[0]]])


def run_filter(
    seed: int, seconds: tuple[float, ...], confidence: float, scale: float
) -> list[float]:
    """Return the filter's normalised squared error, both axes, at some times."""
    generator = np.random.default_rng(seed)
    start = NOISE.initial_tilt * np.append(generator.normal(size=2), 0.0)
    velocity = np.append(NOISE.initial_velocity * generator.normal(size=2), 0.0)
    trunk = Trunk(rotation_from_vector(start), velocity)
    found = TiltFilter(PERIOD, GRAVITY, NOISE)
    gyro_std = scale * NOISE.gyro / math.sqrt(PERIOD)
    force_std = scale * NOISE.accelerometer / math.sqrt(PERIOD)
    leg_std = scale * NOISE.odometry / math.sqrt(confidence)
    omega, _ = trunk.motion()
    found.predict(omega + gyro_std * generator.normal(size=3), np.zeros(3))
    result = []
    for tick in range(1, round(seconds[-1] / PERIOD) + 1):
        omega, force = trunk.advance()
        found.predict(
            omega + gyro_std * generator.normal(size=3),
            force + force_std * generator.normal(size=3),
        )
        found.correct(trunk.velocity + leg_std * generator.normal(size=3), confidence)
        if any(tick == round(second / PERIOD) for second in seconds):
            errors = tilt_error(found, trunk)
            result.append(
                float(sum(e @ np.linalg.solve(found.covariance, e) for e in errors))
            )
    return result


@pytest.mark.parametrize(
    ("confidence", "scale", "is_honest"),
    [(1.0, 1.0, True), (0.25, 1.0, True), (1.0, 1.6, False), (1.0, 0.6, False)],
)
def test_tilt_filter_knows_its_errors(
    confidence: float, scale: float, is_honest: bool
) -> None:
    """The normalised error of (velocity, tilt) is in its 99.9 % chi-square band.

    With noise as the filter believes; with more or less it leaves the band, which
    shows that the band is narrow enough to tell.
    """
    times, seeds = (0.2, 1.0, 2.0), 40
    values = np.array([run_filter(s, times, confidence, scale) for s in range(seeds)])
    freedom = 4 * seeds
    low, high = scipy.stats.chi2.ppf([0.0005, 0.9995], freedom) / freedom
    means = values.mean(axis=0) / 4.0
    inside = (means > low) & (means < high)
    assert inside.all() if is_honest else not inside.any()


def test_covariance_is_that_of_the_textbook() -> None:
    """P obeys prediction F P F' + Q and Joseph's form, and stays positive."""
    found = TiltFilter(PERIOD, GRAVITY, NOISE)
    found.predict(np.zeros(3), UP)
    P = found.covariance.copy()
    F = np.array([[1.0, GRAVITY * PERIOD], [0.0, 1.0]])
    Q = np.diag([NOISE.accelerometer**2, NOISE.gyro**2]) * PERIOD
    H = np.array([[1.0, 0.0]])
    for k in range(200):
        confidence = 0.3 + 0.7 * (k % 2)
        found.predict(np.zeros(3), UP)
        found.correct(np.zeros(3), confidence)
        P = F @ P @ F.T + Q
        S = H @ P @ H.T + NOISE.odometry**2 / confidence
        P = P - P @ H.T @ np.linalg.solve(S, H @ P)
        np.testing.assert_allclose(found.covariance, P, rtol=1e-9)
        assert np.linalg.eigvalsh(found.covariance).min() > 0.0


@pytest.mark.parametrize("direction", [0, 1])
def test_tilt_is_found_from_a_wrong_start(direction: int) -> None:
    """A trunk that starts tilted, at rest, is known to be so after some seconds."""
    tilt = 0.03 * np.eye(3)[direction]
    attitude = rotation_from_vector(tilt)
    found = TiltFilter(PERIOD, GRAVITY, NOISE)
    force = attitude.T @ [0.0, 0.0, GRAVITY]
    errors = []
    for _ in range(600):
        found.predict(np.zeros(3), force)
        found.correct(np.zeros(3), 1.0)
        errors.append(np.abs(rotation_vector_between(found.rotation, attitude)).max())
    assert errors[0] == pytest.approx(0.03, rel=0.01)
    assert errors[100] < 0.018
    assert errors[-1] < 0.005
    assert np.abs(found.velocity).max() < 0.005


def test_acceleration_is_not_taken_for_tilt() -> None:
    """With exact sensors a hard acceleration leaves the attitude exact."""
    found = TiltFilter(PERIOD, GRAVITY, NOISE)
    velocity = np.zeros(3)
    found.predict(np.zeros(3), UP)
    for k in range(300):
        acceleration = np.array([3.0 if k < 150 else -3.0, -1.0, 0.0])
        velocity = velocity + PERIOD * acceleration
        found.predict(np.zeros(3), acceleration + UP)
        found.correct(velocity, 1.0)
    np.testing.assert_allclose(found.rotation, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(found.velocity, velocity, atol=1e-9)


def test_heading_is_the_integrated_gyro() -> None:
    """Odometry never touches the heading: it is what the gyro adds up to."""
    found = TiltFilter(PERIOD, GRAVITY, NOISE)
    generator = np.random.default_rng(0)
    force = UP
    for _ in range(201):
        found.predict(np.array([0.0, 0.0, 0.25]), force)
        found.correct(np.append(1e-3 * generator.normal(size=2), 0.0), 1.0)
    heading = math.atan2(found.rotation[1, 0], found.rotation[0, 0])
    assert heading == pytest.approx(0.5, abs=1e-4)


def test_confidence_scales_the_information() -> None:
    """No confidence changes nothing; half of it is twice the variance."""
    filters = [TiltFilter(PERIOD, GRAVITY, NOISE) for _ in range(2)]
    filters.append(
        TiltFilter(PERIOD, GRAVITY, replace(NOISE, odometry=NOISE.odometry * 2**0.5))
    )
    measured = np.array([0.03, -0.02, 0.01])
    filters[0].correct(measured, 0.0)
    np.testing.assert_array_equal(filters[0].rotation, np.eye(3))
    np.testing.assert_array_equal(filters[0].velocity, np.zeros(3))
    filters[1].correct(measured, 0.5)
    filters[2].correct(measured, 1.0)
    np.testing.assert_allclose(filters[1].velocity, filters[2].velocity, rtol=1e-12)
    np.testing.assert_allclose(filters[1].covariance, filters[2].covariance, rtol=1e-12)
    np.testing.assert_allclose(filters[1].rotation, filters[2].rotation, rtol=1e-12)
