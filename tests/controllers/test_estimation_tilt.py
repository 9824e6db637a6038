"""Laws of the tilt filter: honest about its errors, not fooled by acceleration."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.stats

from ballsim_controllers.estimation.ball import BALL_STATE
from ballsim_controllers.estimation.corrections import LEVEL, TILT_STATE
from ballsim_controllers.estimation.error_covariance import (
    ACCELEROMETER_BIAS,
    COM_OFFSET,
    GYRO_BIAS,
    LEAD,
    N_ERRORS,
    TILT,
    VELOCITY,
    Levers,
    advance_covariance,
    make_covariance,
    weigh,
)
from ballsim_controllers.estimation.tilt import correct_tilt, predict_tilt
from ballsim_controllers.geometry import (
    integrate_rotation,
    rotation_from_vector,
    rotation_vector_between,
)
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.sensor_figures import SensorFigures

GRAVITY = 9.81
UP = np.array([0.0, 0.0, GRAVITY])
PERIOD = 0.01
LEVERS = Levers(
    imu_over_contact=1.0,
    imu_over_trunk=0.2,
    trunk_over_ball=1.3,
    com_over_contact=0.85,
    radius=0.5,
)
FIGURES = SensorFigures(
    encoder_noise=5e-4,
    gyro_noise=2e-3,
    gyro_bias=5e-3,
    accelerometer_noise=0.2,
    accelerometer_bias=0.1,
)


class Filter:
    """The tilt filter with all that it corrects."""

    def __init__(self, figures: SensorFigures = FIGURES) -> None:
        """Start upright and at rest."""
        self.tilt: Record = np.zeros(1, TILT_STATE)
        self.tilt["rotation"] = np.eye(3)
        self.level: Record = np.zeros(1, LEVEL)
        self.ball: Record = np.zeros(1, BALL_STATE)
        self.ball["rotation"] = np.eye(3)
        weight = 600.0
        self.covariance = make_covariance(PERIOD, GRAVITY, weight, LEVERS, figures)

    @property
    def rotation(self) -> Array:
        """Return the attitude, trunk to world, shape (3, 3)."""
        rotation: Array = self.tilt["rotation"][0]
        return rotation

    @property
    def covariances(self) -> Array:
        """Return the covariance, shape (9, 9)."""
        P: Array = self.covariance["P"][0]
        return P

    def predict(self, gyro: Array, force: Array) -> None:
        """Advance by a period."""
        state = self.tilt[0]
        omega, force = gyro - state["gyro_bias"], force - state["accelerometer_bias"]
        predict_tilt(self.tilt, omega, force, PERIOD, GRAVITY)
        advance_covariance(self.covariance)

    def correct(self, velocity: Array, confidence: float) -> None:
        """Correct with a mean velocity."""
        correct_tilt(
            self.tilt,
            self.level,
            self.ball,
            self.covariance,
            velocity,
            confidence,
            PERIOD,
        )


class Trunk:
    """A trunk that sways and accelerates, in step with the filter's integration."""

    def __init__(self, lean: Array, velocity: Array) -> None:
        """Start at a lean with a velocity."""
        self.rotation, self.velocity = rotation_from_vector(lean), velocity
        self.time = 0.0

    def motion(self) -> tuple[Array, Array]:
        """Return angular velocity in the trunk and acceleration in the world."""
        t = self.time
        omega = np.array([0.2 * math.cos(2.0 * t), 0.3 * math.sin(3.0 * t), 0.1])
        acceleration = np.array([0.4 * math.sin(2.5 * t), 0.3 * math.cos(t), 0.2])
        return omega, acceleration

    def advance(self) -> tuple[Array, Array, Array]:
        """Move on by a period; return exact gyro, specific force, mean velocity."""
        omega_before, acceleration_before = self.motion()
        self.time += PERIOD
        omega, acceleration = self.motion()
        self.rotation = integrate_rotation(
            self.rotation, 0.5 * (omega_before + omega), PERIOD
        )
        before = self.velocity
        self.velocity = before + 0.5 * PERIOD * (acceleration_before + acceleration)
        force = self.rotation.T @ (acceleration + UP)
        return omega, force, 0.5 * (before + self.velocity)


def run_filter(
    seed: int, seconds: tuple[float, ...], confidence: float, scale: float
) -> list[float]:
    """Return the normalised squared error of velocity and tilt, both axes, at times."""
    generator = np.random.default_rng(seed)
    found, F = Filter(), FIGURES
    P = found.covariances.copy()
    lean = math.sqrt(P[TILT, TILT]) * np.append(generator.normal(size=2), 0.0)
    velocity = math.sqrt(P[VELOCITY, VELOCITY]) * generator.normal(size=3)
    trunk = Trunk(lean, velocity * [1.0, 1.0, 0.0])
    gyro_bias = scale * F.gyro_bias * generator.normal(size=3)
    force_bias = scale * F.accelerometer_bias * generator.normal(size=3)
    gyro_std = scale * F.gyro_noise / math.sqrt(PERIOD)
    force_std = scale * F.accelerometer_noise / math.sqrt(PERIOD)
    leg_std = scale * math.sqrt(found.covariance["leg_variance"][0] / confidence)
    slip_std = scale * 7e-4 / math.sqrt(PERIOD)

    def draw(std: float) -> Array:
        return std * generator.normal(size=3)

    omega, _ = trunk.motion()
    force = trunk.rotation.T @ (trunk.motion()[1] + UP)
    found.predict(
        omega + gyro_bias + draw(gyro_std), force + force_bias + draw(force_std)
    )
    place_noise, result = draw(leg_std), []
    for tick in range(1, round(seconds[-1] / PERIOD) + 1):
        omega, force, mean = trunk.advance()
        noise = gyro_bias + draw(gyro_std)
        found.predict(omega + noise, force + force_bias + draw(force_std))
        # The legs' chain is turned by the gyro as the filter believes it.
        wrong = trunk.rotation @ (noise - found.tilt["gyro_bias"][0])
        swing = np.array([wrong[1], -wrong[0], 0.0]) * LEVERS.imu_over_contact
        before, place_noise = place_noise, draw(leg_std)
        moved = (place_noise - before) / PERIOD + draw(slip_std)
        found.correct(mean + swing + moved, confidence)
        if any(tick == round(second / PERIOD) for second in seconds):
            turn = rotation_vector_between(found.rotation, trunk.rotation)
            error = trunk.velocity - found.tilt["velocity"][0]
            own = found.covariances[VELOCITY : TILT + 1, VELOCITY : TILT + 1]
            pairs = ([error[0], turn[1]], [error[1], -turn[0]])
            result.append(
                float(sum(np.array(e) @ np.linalg.solve(own, e) for e in pairs))
            )
    return result


@pytest.mark.parametrize(
    ("confidence", "scale", "is_honest"),
    [(1.0, 1.0, True), (0.25, 1.0, True), (1.0, 1.7, False), (1.0, 0.5, False)],
)
def test_tilt_filter_knows_its_errors(
    confidence: float, scale: float, is_honest: bool
) -> None:
    """The normalised error of (velocity, tilt) is in its 99.9 % chi-square band.

    With noise as the data sheet says; with more or less it leaves the band, which
    shows that the band is narrow enough to tell.
    """
    times, seeds = (0.5, 1.0, 2.0), 40
    values = np.array([run_filter(s, times, confidence, scale) for s in range(seeds)])
    freedom = 4 * seeds
    low, high = scipy.stats.chi2.ppf([0.0005, 0.9995], freedom) / freedom
    means = values.mean(axis=0) / 4.0
    # What the filter allows for beside the noise widens its covariance.
    inside = (means > 0.9 * low) & (means < high)
    assert inside.all() if is_honest else not inside.any()


def test_covariance_is_that_of_the_textbook() -> None:
    """P obeys F P F' + Q and (I - K H) P, and stays positive."""
    found, P = Filter(), Filter().covariances.copy()
    F, Q = found.covariance["F"][0], found.covariance["Q"][0]
    variance = found.covariance["leg_variance"][0]
    H = np.zeros((1, N_ERRORS))
    H[0, LEAD] = 1.0
    for k in range(200):
        confidence = 0.3 + 0.7 * (k % 2)
        found.predict(np.zeros(3), UP)
        found.correct(np.zeros(3), confidence)
        P = F @ P @ F.T + Q
        S = H @ P @ H.T + variance / confidence
        P = P - P @ H.T @ np.linalg.solve(S, H @ P)
        np.testing.assert_allclose(found.covariances, P, rtol=1e-6, atol=1e-15)
        uncertain = np.delete(
            np.delete(found.covariances, COM_OFFSET, 0), COM_OFFSET, 1
        )
        assert np.linalg.eigvalsh(uncertain).min() > 0.0


def test_restrained_gain_keeps_the_form_of_joseph() -> None:
    """A gain that is not the optimal one leaves (I - K H) P (I - K H)' + K R K'."""
    found = Filter()
    for _ in range(20):
        advance_covariance(found.covariance)
    P, rows, R = (
        found.covariances.copy(),
        np.random.default_rng(1).normal(size=N_ERRORS),
        1e-5,
    )
    K = weigh(found.covariance, rows, R, True)
    assert np.count_nonzero(K) == 2
    left = np.eye(N_ERRORS) - np.outer(K, rows)
    expected = left @ P @ left.T + R * np.outer(K, K)
    np.testing.assert_allclose(found.covariances, expected, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("direction", [0, 1])
def test_tilt_is_found_from_a_wrong_start(direction: int) -> None:
    """A trunk that starts tilted, at rest, is known to be so after some seconds."""
    tilt = 0.03 * np.eye(3)[direction]
    attitude = rotation_from_vector(tilt)
    found = Filter(SensorFigures())
    force = attitude.T @ [0.0, 0.0, GRAVITY]
    errors = []
    for _ in range(600):
        found.predict(np.zeros(3), force)
        found.correct(np.zeros(3), 1.0)
        errors.append(np.abs(rotation_vector_between(found.rotation, attitude)).max())
    assert errors[0] == pytest.approx(0.03, rel=0.01)
    assert errors[100] < 0.018
    assert errors[-1] < 0.005
    assert np.abs(found.tilt["velocity"]).max() < 0.005


def test_acceleration_is_not_taken_for_tilt() -> None:
    """With exact sensors a hard acceleration leaves the attitude exact."""
    found, velocity, before = Filter(), np.zeros(3), np.zeros(3)
    found.predict(np.zeros(3), UP)
    for k in range(300):
        acceleration = np.array([3.0 if k < 150 else -3.0, -1.0, 0.0])
        last = velocity
        velocity = velocity + 0.5 * PERIOD * (before + acceleration)
        before = acceleration
        found.predict(np.zeros(3), acceleration + UP)
        found.correct(0.5 * (last + velocity), 1.0)
    np.testing.assert_allclose(found.rotation, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(found.tilt["velocity"][0], velocity, atol=1e-9)


def test_heading_is_the_integrated_gyro() -> None:
    """Odometry never touches the heading: it is what the gyro adds up to."""
    found = Filter()
    generator = np.random.default_rng(0)
    for _ in range(201):
        found.predict(np.array([0.0, 0.0, 0.25]), UP)
        found.correct(np.append(1e-3 * generator.normal(size=2), 0.0), 1.0)
    heading = math.atan2(found.rotation[1, 0], found.rotation[0, 0])
    assert heading == pytest.approx(0.5, abs=1e-3)


def test_lasting_bias_of_the_gyro_is_found() -> None:
    """A lasting gyro bias is found as one, with the accelerometer trusted."""
    found = Filter(SensorFigures(gyro_bias=5e-3, accelerometer_bias=1e-3))
    bias = np.array([4e-3, -6e-3, 0.0])
    for _ in range(1000):
        swing = LEVERS.imu_over_contact * (bias - found.tilt["gyro_bias"][0])
        found.predict(bias, UP)
        found.correct(np.array([swing[1], -swing[0], 0.0]), 1.0)
    np.testing.assert_allclose(found.tilt["gyro_bias"][0, :2], bias[:2], rtol=0.1)
    assert found.covariances[GYRO_BIAS, GYRO_BIAS] < 0.05 * 25e-6
    assert found.covariances[ACCELEROMETER_BIAS, ACCELEROMETER_BIAS] > 0.0


def test_confidence_scales_the_information() -> None:
    """No confidence changes nothing; half of it is twice the variance."""
    filters = [Filter() for _ in range(3)]
    filters[2].covariance["leg_variance"] *= 2.0
    measured = np.array([0.03, -0.02, 0.01])
    filters[0].correct(measured, 0.0)
    np.testing.assert_array_equal(filters[0].rotation, np.eye(3))
    np.testing.assert_array_equal(filters[0].tilt["velocity"][0], np.zeros(3))
    filters[1].correct(measured, 0.5)
    filters[2].correct(measured, 1.0)
    for name in ("velocity", "rotation", "gyro_bias"):
        np.testing.assert_allclose(
            filters[1].tilt[name], filters[2].tilt[name], rtol=1e-12
        )
    np.testing.assert_allclose(
        filters[1].covariances, filters[2].covariances, rtol=1e-12
    )
