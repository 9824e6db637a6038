"""The predicted errors of the estimate: against many filters, and their limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

import ballsim
from ballsim.config import Config
from ballsim.config_io import load_config
from ballsim.error_model.error_system import ErrorSystem
from ballsim.error_model.linear_estimator import linearise
from ballsim.error_model.sensor_errors import find_sensor_errors
from ballsim.error_model.sigmas import (
    BOTH,
    LANDED,
    LEFT,
    RIGHT,
    find_support,
    predict_errors,
)
from ballsim.error_model.snapshots import (
    TRUNK_ATTITUDE,
    restore,
    take_snapshot,
)
from ballsim.error_model.standing import make_estimator, make_standing_reading
from ballsim.sensors import VelocityTracker
from ballsim_controllers.geometry import rotation_from_vector, rotation_vector_between
from ballsim_controllers.messages import Array, SensorReading


def _load(preset: str = "mid", *overrides: str) -> Config:
    given = [f"sensors.preset={preset}", "duration_s=0.3", *overrides]
    return load_config("stand", given).config


def test_many_filters_have_the_predicted_covariance() -> None:
    """NEES of 40 of the controllers' own estimators, fed with drawn errors."""
    config, n_filters = _load("mid", "duration_s=0.315"), 40
    random = np.random.default_rng(5)
    estimator, robot = make_estimator(config)
    truth = make_standing_reading(estimator, robot)
    period, n = config.simulation.control_period, robot.joint_count
    sensors = find_sensor_errors(config.sensors, truth, period)
    bandwidth = config.sensors.encoder.velocity_bandwidth
    fresh, m = take_snapshot(estimator), len(sensors.bias_std)
    true = estimator.stance.qpos
    robot.update(true, np.zeros(robot.model.nv))
    true_com = robot.position_com_in_world - [0.0, 0.0, config.ball.radius]
    errors: dict[str, list[Array]] = {"ball_position_m": [], "com_to_ball_m": []}
    errors |= {"trunk_tilt_rad": [], "com_velocity_m_s": [], "cop_to_ball_m": []}
    for _ in range(n_filters):
        restore(estimator, fresh)
        lean = config.initial.max_lean / np.sqrt(6.0) * random.standard_normal(2)
        turn = rotation_from_vector(np.array([*lean, 0.0]))
        estimator.arguments[2]["rotation"][0] = turn
        tracker = VelocityTracker(bandwidth, period, n)
        bias = sensors.bias_std * random.standard_normal(m)
        for _ in range(config.n_ticks):
            bias += sensors.walk_std * random.standard_normal(m)
            wrong = bias + sensors.white_std * random.standard_normal(m)
            row = truth.record.view(np.float64).copy()
            row[1 : n + 1] += wrong[:n]
            row[n + 1 : 2 * n + 1] = tracker.update(row[1 : n + 1])
            row[2 * n + 1 :] += wrong[n:]
            reading = SensorReading(row.view(truth.record.dtype))
            estimate = estimator.update(reading)
        ball, rotation = (
            estimate.position_ball_in_world,
            estimator.arguments[2]["rotation"][0],
        )
        tilt = rotation_vector_between(np.eye(3), rotation)[:2]
        errors["trunk_tilt_rad"].append(tilt)
        errors["ball_position_m"].append(ball[:2])
        com = estimate.position_com_in_world - ball - true_com
        errors["com_to_ball_m"].append(com[:2])
        errors["com_velocity_m_s"].append(estimate.linear_velocity_com_in_world)
        errors["cop_to_ball_m"].append(estimate.cop_in_world - ball[:2])
    prediction = predict_errors(config)
    assert prediction.time[-1] == pytest.approx(config.duration - period)
    for quantity, drawn in errors.items():
        sample = np.array(drawn)
        d = sample.shape[1]
        P = prediction.find_covariance(quantity)[-1][:d, :d]
        nees = np.einsum("ni,ij,nj->", sample, np.linalg.inv(P), sample)
        low, high = chi2.ppf([0.001, 0.999], d * n_filters)
        assert low < nees < high, quantity


def test_perfect_sensors_and_start_leave_no_error() -> None:
    """Without any noise, and upright at the start, all errors are zero."""
    config = _load("ideal", "initial.max_lean_rad=0")
    np.testing.assert_array_equal(predict_errors(config).covariance, 0.0)


def test_twice_the_noise_gives_at_most_twice_the_errors() -> None:
    """What gyros add up to doubles; what is weighed anew grows by less, but grows."""
    upright, time = "initial.max_lean_rad=0", np.array([0.02, 0.1])
    # Rounding is left as it is.
    fine = [f"sensors.{s}.resolution_rad_s=0" for s in ("gyro", "ball_gyro")]
    fine += ["sensors.accelerometer.resolution_m_s2=0", "duration_s=0.15"]
    once = predict_errors(_load("mid", upright, *fine))
    twice = predict_errors(_load("mid", upright, *fine, "sensors.noise_multiplier=2"))
    for quantity in ("trunk_yaw_rad", "ball_velocity_m_s", "ball_position_m"):
        np.testing.assert_allclose(
            twice.sigma(quantity, time), 2.0 * once.sigma(quantity, time), rtol=0.02
        )
    low = once.sigma("trunk_tilt_rad", time)[:, :2]
    high = twice.sigma("trunk_tilt_rad", time)[:, :2]
    assert np.all(high > 1.05 * low)
    assert np.all(high < 2.0 * low)


def test_feet_stand_for_good_after_a_while() -> None:
    """At the start and after each step both feet have only just landed."""
    ticks = {"both": 60, "left": 3, "again": 55, "right": 2, "shortly": 40}
    loads = {"left": (600.0, 0.0), "right": (1.0, 599.0)}
    forces = np.vstack(
        [np.tile(loads.get(name, (300.0, 300.0)), (n, 1)) for name, n in ticks.items()]
    )
    expected = [LANDED] * 50 + [BOTH] * 10 + [LEFT] * 3
    expected += [LANDED] * 50 + [BOTH] * 5 + [RIGHT] * 2 + [LANDED] * 40
    np.testing.assert_array_equal(find_support(forces, 0.005), expected)


def test_standing_soles_hold_the_heading() -> None:
    """Standing, it drifts far less than on one foot after the other."""
    config = _load("mid", "duration_s=6")
    instant = np.array([5.9])
    stands = predict_errors(config).sigma("trunk_yaw_rad", instant)[0, 0]
    steps = np.tile(np.repeat([LEFT, RIGHT], 60), config.n_ticks // 120)
    walks = predict_errors(config, steps).sigma("trunk_yaw_rad", instant)[0, 0]
    gyro = config.sensors.find_level("gyro") * config.sensors.gyro.bias_std
    assert stands < 0.3 * walks
    assert walks < gyro * instant[0]


def test_many_ticks_at_once_are_many_ticks() -> None:
    """Repeated squaring agrees with one step after the other."""
    random = np.random.default_rng(2)
    F, noise = 0.4 * random.normal(size=(5, 5)), random.normal(size=(5, 5))
    one = ErrorSystem(F, noise @ noise.T, np.eye(5), np.eye(5), noise)
    P = np.eye(5)
    for _ in range(7):
        P = one.advance(P)
    np.testing.assert_allclose(one.repeat(7).advance(np.eye(5)), P, rtol=1e-12)


def test_linearising_leaves_the_estimator_as_it_is() -> None:
    """The same bits before and after, and the first order is right."""
    estimator, robot = make_estimator(_load())
    reading = make_standing_reading(estimator, robot)
    for _ in range(3):
        estimator.update(reading)
    before = take_snapshot(estimator)
    linear = linearise(estimator, reading)
    for kept, record in zip(before, estimator.arguments, strict=False):
        assert kept.tobytes() == record.tobytes()
    # A yaw of the whole world: the estimate's yaw, and all vectors turned.
    assert linear.C[3, TRUNK_ATTITUDE + 2] == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(ValueError, match="read-only"):
        linear.A[0, 0] = 1.0


def test_three_sigma_hold_nearly_all_errors_of_a_run() -> None:
    """The bounds of a recording: symmetric, as long as the run, and wide enough."""
    run = ballsim.run("stand", sensors="mid", duration=1.5, seed=3)
    bounds, errors = run["limits/estimate/com"], run["estimate/error/com"]
    assert bounds.time[0] == 0.0
    assert bounds.time[-1] == pytest.approx(errors.time[-1], abs=0.1)
    low, high = np.split(bounds.at(errors.time), 2, axis=1)
    np.testing.assert_array_equal(low, -high)
    assert np.mean(np.abs(errors.values[:, :2]) < high[:, :2]) > 0.95
    assert high[-1, 0] < 0.6 * high[0, 0]  # the lean is found out
