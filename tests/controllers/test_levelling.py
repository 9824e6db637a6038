"""Tilt from the balance of the whole body: what it finds, and what it leaves alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ballsim.config_io import load_config
from ballsim.metrics import run_and_summarise
from ballsim.preparation import prepare
from ballsim.simulation import run_prepared
from ballsim_controllers.estimation.ball import BALL_STATE
from ballsim_controllers.estimation.contacts import CONTACT
from ballsim_controllers.estimation.corrections import TILT_STATE
from ballsim_controllers.estimation.error_covariance import (
    FORCE_VELOCITY,
    Levers,
    advance_covariance,
    make_covariance,
)
from ballsim_controllers.estimation.levelling import level
from ballsim_controllers.estimation.rolling import make_level
from ballsim_controllers.messages import ESTIMATE, Array, Record
from ballsim_controllers.pipeline import WheeledLipController
from ballsim_controllers.sensor_figures import SensorFigures

_DT, _MASS, _GRAVITY = 0.005, 60.0, 9.81
_COM = np.array([0.02, -0.01, 1.3])
_POINTS = np.array([[0.03, 0.06, 0.49], [0.01, -0.05, 0.48]])


def _make_stance(rotation: Rotation, forces: Array) -> tuple[Record, Record]:
    """Return estimate and contacts of a robot whose world is turned by an error."""
    estimates, contacts = np.zeros(1, ESTIMATE), np.zeros(2, CONTACT)
    estimates["position_com_in_world"][0] = rotation.apply(_COM)
    estimates["contacts_in_world"][0] = rotation.apply(_POINTS)
    contacts["force"] = rotation.apply(forces)
    return estimates, contacts


def _balanced_forces() -> Array:
    """Return contact forces at rest: the weight, no moment about the CoM."""
    # Unknown: both forces. Sum, moments about x and y; least norm of the rest.
    rows, right = [], []
    for axis in range(3):
        row = np.zeros(6)
        row[[axis, 3 + axis]] = 1.0
        rows.append(row)
        right.append(_MASS * _GRAVITY if axis == 2 else 0.0)
    for axis in (0, 1):
        row = np.zeros(6)
        for i, arm in enumerate(_POINTS - _COM):
            for j in range(3):
                row[3 * i + j] = np.cross(arm, np.eye(3)[j])[axis]
        rows.append(row)
        right.append(0.0)
    forces: Array = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    return forces.reshape(2, 3)


class _Level:
    """The levelling with all that it corrects."""

    def __init__(
        self, attitude: Rotation, bias: float = 0.1, encoder_bias: float = 0.0
    ) -> None:
        """Start with a wrong attitude."""
        figures = SensorFigures(accelerometer_bias=bias, encoder_bias=encoder_bias)
        levers = Levers(1.0, 0.2, 1.3, 0.82, 0.5)
        self.levels = make_level(_DT, figures, levers)
        self.tilts = np.zeros(1, TILT_STATE)
        self.tilts["rotation"] = attitude.as_matrix()
        self.balls = np.zeros(1, BALL_STATE)
        self.balls["rotation"] = np.eye(3)
        weight = _MASS * _GRAVITY
        self.covariances = make_covariance(_DT, _GRAVITY, weight, levers, figures)

    def run(
        self, stance: tuple[Record, Record], velocity: Array, kernel: Any = level
    ) -> None:
        """Advance by a period."""
        advance_covariance(self.covariances)
        kernel(
            self.levels,
            self.tilts,
            self.balls,
            self.covariances,
            *stance,
            velocity,
            np.zeros(3),
            1.0,
            _MASS,
            _GRAVITY,
        )


def test_level_robot_at_rest_is_left_alone() -> None:
    """Forces that balance it exactly, feet at different heights: nothing moves."""
    stance = _make_stance(Rotation.identity(), _balanced_forces())
    found = _Level(Rotation.identity())
    for _ in range(1000):
        found.run(stance, np.zeros(3))
    for name in ("gyro_bias", "accelerometer_bias", "velocity"):
        np.testing.assert_allclose(found.tilts[name], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.tilts["rotation"][0], np.eye(3), atol=1e-9)


@pytest.mark.parametrize("tilt", [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [-0.01, 0.02, 0]])
def test_correction_goes_against_the_tilt(tilt: list[float]) -> None:
    """The attitude turns back along the error, and most of it is gone in a second."""
    error = Rotation.from_rotvec(tilt)
    found = _Level(error)
    for _ in range(200):
        attitude = Rotation.from_matrix(found.tilts["rotation"][0])
        found.run(_make_stance(attitude, _balanced_forces()), np.zeros(3))
    left = Rotation.from_matrix(found.tilts["rotation"][0]).as_rotvec()
    turned = (left - tilt)[:2]
    cosine = turned @ -np.array(tilt[:2])
    cosine /= np.linalg.norm(turned) * np.linalg.norm(tilt[:2])
    assert cosine > 0.999
    assert np.linalg.norm(left[:2]) < 0.1 * np.linalg.norm(tilt)


def test_angular_momentum_is_no_tilt() -> None:
    """A CoM that moves because the body swings, as its forces say: no correction."""
    found, stance = (
        _Level(Rotation.identity()),
        _make_stance(Rotation.identity(), _balanced_forces()),
    )
    height = _COM[2] - np.average(
        _POINTS[:, 2], weights=_balanced_forces().reshape(2, 3)[:, 2]
    )
    inertia = _MASS * height
    found.run(stance, np.zeros(3))
    for k in range(1, 100):
        momentum = np.array([0.3, 2.0, 0.1]) * np.sin(0.2 * k)
        # No moment of the forces: what the body gains in swing the CoM loses.
        velocity = np.array([-momentum[1], momentum[0], 0.0]) / inertia
        advance_covariance(found.covariances)
        level(
            found.levels,
            found.tilts,
            found.balls,
            found.covariances,
            *stance,
            velocity,
            momentum,
            1.0,
            _MASS,
            _GRAVITY,
        )
    np.testing.assert_allclose(found.tilts["rotation"][0], np.eye(3), atol=1e-9)


def test_flight_says_nothing() -> None:
    """Below half the weight nothing is corrected, and less is known."""
    stance = _make_stance(Rotation.from_rotvec([0.1, 0, 0]), np.ones((2, 3)))
    found = _Level(Rotation.identity())
    for _ in range(10):
        before = found.covariances["P"][0, FORCE_VELOCITY, FORCE_VELOCITY]
        found.run(stance, np.array([0.3, -0.2, 0.0]))
    assert found.covariances["P"][0, FORCE_VELOCITY, FORCE_VELOCITY] > before
    np.testing.assert_array_equal(found.tilts["rotation"][0], np.eye(3))
    assert not found.tilts["accelerometer_bias"].any()


def test_push_is_no_tilt() -> None:
    """A kick that the ankles do not feel turns the attitude by 3 mrad at most."""
    stance = _make_stance(Rotation.identity(), _balanced_forces())
    found, turned = _Level(Rotation.identity()), []
    for k in range(600):
        speed = 0.09 * min(max(k - 400, 0) / 20, 1.0)  # 60 N on 65 kg for 0.1 s
        found.run(stance, np.array([0.0, speed, 0.0]))
        attitude = Rotation.from_matrix(found.tilts["rotation"][0])
        turned.append(np.linalg.norm(attitude.as_rotvec()))
    assert max(turned) < 3e-3


def test_encoders_that_are_off_hardly_turn_the_attitude() -> None:
    """A CoM shown elsewhere over each foot turns half as much for who expects it."""
    turned = []
    for encoder_bias in (0.0, 5e-3):
        found, angles = _Level(Rotation.identity(), encoder_bias=encoder_bias), []
        for k in range(200):
            attitude = Rotation.from_matrix(found.tilts["rotation"][0])
            estimates, contacts = _make_stance(attitude, _balanced_forces())
            step = int(k * _DT / 0.3)
            estimates["position_com_in_world"][0, 1] += 6e-3 * (-1.0) ** step
            found.run((estimates, contacts), np.zeros(3))
            angles.append(np.linalg.norm(attitude.as_rotvec()[:2]))
        turned.append(np.sqrt(np.mean(np.square(angles))))
    assert turned[1] < 0.6 * turned[0]


@pytest.mark.parametrize("seed", [1, 2])
def test_bias_of_the_accelerometer_is_found(seed: int) -> None:
    """The one that was drawn, 6 mg for each axis, after 20 s."""
    overrides = ["sensors.accelerometer.bias_std_m_s2=0.06", "duration_s=20"]
    prepared = prepare(load_config("stand", [*overrides, f"seed={seed}"]).config)
    controller = prepared.controller
    assert isinstance(controller, WheeledLipController)
    n = len(prepared.ids.sensor_joints)
    drawn = prepared.sensors._noise.bias[n + 3 : n + 6]
    result = run_prepared(prepared)
    assert result.is_upright
    arguments = controller.estimator.arguments
    fusion, tilts = arguments[0], arguments[2]
    true_bias = fusion["rotation_imu_to_trunk"][0] @ drawn
    assert np.linalg.norm(true_bias[:2]) > 0.03
    np.testing.assert_allclose(
        tilts["accelerometer_bias"][0, :2], true_bias[:2], atol=0.006
    )


def test_compiled_levelling_gives_the_bits_of_plain_python() -> None:
    """Attitude and bias are the same with and without compilation."""
    results = []
    for kernel in (level, getattr(level, "py_func", level)):
        random = np.random.default_rng(1)
        found = _Level(Rotation.identity())
        for _ in range(50):
            forces = _balanced_forces() + random.normal(size=(2, 3))
            stance = _make_stance(Rotation.identity(), forces)
            found.run(stance, 0.01 * random.normal(size=3), kernel)
        results.append(found.levels.tobytes() + found.tilts.tobytes())
    assert results[0] == results[1]


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["stand", "step", "roll-to"])
@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_mid_sensors_know_the_body(scenario: str, radius: float, seed: int) -> None:
    """20 s with `mid`: upright, CoM and CoP over the ball within 1 cm rms."""
    overrides = [f"ball.radius_m={radius}", f"seed={seed}", "duration_s=20"]
    config = load_config(scenario, ["sensors.preset=mid", *overrides]).config
    outcome, summary = run_and_summarise(prepare(config), "test")
    assert outcome.is_upright
    errors = summary["estimate_rms"]
    assert errors["com_to_ball_m"] < 0.010
    assert errors["cop_to_ball_m"] < 0.010
    assert errors["com_velocity_m_s"] < 0.03
