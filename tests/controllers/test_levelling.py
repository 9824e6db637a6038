"""Tilt from the balance of the whole body: what it finds, and what it leaves alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ballsim.config_io import load_config
from ballsim.metrics import run_and_summarise
from ballsim.preparation import prepare
from ballsim.simulation import run_prepared
from ballsim_controllers.estimation.contacts import CONTACT
from ballsim_controllers.estimation.levelling import level, make_level
from ballsim_controllers.estimation.tilt import TILT_STATE
from ballsim_controllers.messages import ESTIMATE, Array, Record
from ballsim_controllers.pipeline import WheeledLipController

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


def test_level_robot_at_rest_is_left_alone() -> None:
    """Forces that balance it exactly, feet at different heights: nothing moves."""
    estimates, contacts = _make_stance(Rotation.identity(), _balanced_forces())
    levels, tilts = make_level(_DT), np.zeros(1, TILT_STATE)
    tilts["rotation"] = np.eye(3)
    for _ in range(1000):
        level(levels, tilts, estimates, contacts, np.zeros(3), _MASS, _GRAVITY)
    np.testing.assert_allclose(levels["bias"], 0.0, atol=1e-9)
    np.testing.assert_allclose(tilts["rotation"][0], np.eye(3), atol=1e-9)


@pytest.mark.parametrize("tilt", [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [-0.01, 0.02, 0]])
def test_first_correction_goes_against_the_tilt(tilt: list[float]) -> None:
    """The attitude turns back along the error; the bias is the one that caused it."""
    error = Rotation.from_rotvec(tilt)
    estimates, contacts = _make_stance(error, _balanced_forces())
    levels, tilts = make_level(_DT), np.zeros(1, TILT_STATE)
    tilts["rotation"] = error.as_matrix()
    for _ in range(200):
        level(levels, tilts, estimates, contacts, np.zeros(3), _MASS, _GRAVITY)
    left = Rotation.from_matrix(tilts["rotation"][0]).as_rotvec()
    turned = (left - tilt)[:2]
    cosine = turned @ -np.array(tilt[:2])
    cosine /= np.linalg.norm(turned) * np.linalg.norm(tilt[:2])
    assert cosine > 0.999
    # Settled: the tilt times g, crosswise, is minus the accelerometer's bias.
    cause = -np.cross(tilt, [0.0, 0.0, _GRAVITY])[:2]
    bias = levels["bias"][0, :2]
    assert bias @ cause > 0.99 * np.linalg.norm(bias) * np.linalg.norm(cause)


def test_flight_says_nothing() -> None:
    """Below half the weight the observer follows the kinematics."""
    estimates, contacts = _make_stance(
        Rotation.from_rotvec([0.1, 0, 0]), np.ones((2, 3))
    )
    levels, tilts = make_level(_DT), np.zeros(1, TILT_STATE)
    tilts["rotation"] = np.eye(3)
    velocity = np.array([0.3, -0.2, 0.0])
    for _ in range(10):
        level(levels, tilts, estimates, contacts, velocity, _MASS, _GRAVITY)
    np.testing.assert_array_equal(levels["velocity"][0], velocity[:2])
    assert not levels["bias"].any()
    np.testing.assert_array_equal(tilts["rotation"][0], np.eye(3))


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
    fusion, levels = arguments[0], arguments[3]
    true_bias = fusion["rotation_imu_to_trunk"][0] @ drawn
    assert np.linalg.norm(true_bias[:2]) > 0.03
    np.testing.assert_allclose(levels["bias"][0, :2], true_bias[:2], atol=0.006)


def test_compiled_levelling_gives_the_bits_of_plain_python() -> None:
    """Attitude and bias are the same with and without compilation."""
    results = []
    for kernel in (level, getattr(level, "py_func", level)):
        random = np.random.default_rng(1)
        levels, tilts = make_level(_DT), np.zeros(1, TILT_STATE)
        tilts["rotation"] = np.eye(3)
        for _ in range(50):
            forces = _balanced_forces() + random.normal(size=(2, 3))
            estimates, contacts = _make_stance(Rotation.identity(), forces)
            velocity = 0.01 * random.normal(size=3)
            kernel(levels, tilts, estimates, contacts, velocity, _MASS, _GRAVITY)
        results.append(levels.tobytes() + tilts.tobytes())
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
