"""Effects of the sensor models, each by a second route."""

from __future__ import annotations

import numpy as np
import pytest
from tests.sensor_readings import (
    PERIOD,
    make_noise,
    make_zeros,
    prepare_sensors,
    read_all,
)

from ballsim.noise import NoiseModel, SensorChannels, make_generator
from ballsim.preparation import PreparedRun
from ballsim.sensor_config import (
    AccelerometerConfig,
    EncoderConfig,
    ForceConfig,
    GyroConfig,
    SensorsConfig,
    TorqueConfig,
)
from ballsim_controllers.messages import Array


@pytest.fixture(scope="module")
def prepared() -> PreparedRun:
    """Return a run of the shipped robot; only its sensors are of interest."""
    return prepare_sensors()


def _allan_variance(values: Array, n: int) -> float:
    """Return the Allan variance of samples averaged n at a time."""
    means = values[: len(values) // n * n].reshape(-1, n).mean(axis=1)
    return float(0.5 * np.mean(np.diff(means) ** 2))


def test_allan_variance_has_the_slopes_of_both_densities() -> None:
    """N^2 / tau for white noise, K^2 tau / 3 for the walk: IEEE Std 952."""
    white, walk, period = 2e-3, 5e-3, 0.01
    model = NoiseModel(
        [
            SensorChannels(1, white / np.sqrt(period), 0.0, make_generator(1, 0)),
            SensorChannels(
                1,
                0.0,
                0.0,
                make_generator(1, 1),
                walk * np.sqrt(period),
                make_generator(1, 1, 0),
            ),
        ]
    )
    samples = np.array([model.draw().copy() for _ in range(200_000)])
    for n in (4, 16, 64):
        expected = white**2 / (n * period)
        assert _allan_variance(samples[:, 0], n) == pytest.approx(expected, rel=0.08)
    for n in (16, 64, 256):
        # The discrete walk is within 1 / (2 n^2) of the continuous one.
        expected = walk**2 * n * period / 3.0
        assert _allan_variance(samples[:, 1], n) == pytest.approx(expected, rel=0.15)


def test_bias_walks_from_its_value_at_switch_on(prepared: PreparedRun) -> None:
    """Over seeds the bias spreads by walk * sqrt(time) about its start."""
    gyro = GyroConfig(random_walk=0.3)
    truth = make_zeros(prepared, 501)
    ends = [
        read_all(prepared, SensorsConfig(gyro=gyro), truth, seed)["gyro"][[0, 500]]
        for seed in range(100)
    ]
    rise = np.array(ends)[:, 1] - np.array(ends)[:, 0]
    assert rise.std() == pytest.approx(0.3 * np.sqrt(500 * PERIOD), rel=0.12)


def test_rounding_error_is_uniform(prepared: PreparedRun) -> None:
    """A step q makes an error of q / sqrt(12), never above q / 2."""
    step = 0.05
    gyro = GyroConfig(resolution=step)
    truth = make_noise(prepared, 4000)
    exact = read_all(prepared, SensorsConfig(), truth)["gyro"]
    rounded = read_all(prepared, SensorsConfig(gyro=gyro), truth)["gyro"]
    error = rounded - exact
    assert np.abs(error).max() <= 0.5 * step * (1.0 + 1e-9)
    assert error.std() == pytest.approx(step / np.sqrt(12.0), rel=0.02)
    assert abs(error.mean()) < 0.02 * step
    np.testing.assert_allclose(rounded / step, np.round(rounded / step), atol=1e-9)


def test_readings_end_at_the_limits(prepared: PreparedRun) -> None:
    """Beyond the range a sensor reads its end; z of a force has a limit of its own."""
    config = SensorsConfig(
        accelerometer=AccelerometerConfig(limit=0.5),
        foot_force=ForceConfig(limit=0.7, limit_z=1.5),
        foot_torque=TorqueConfig(limit=0.3),
    )
    truth = make_noise(prepared, 500)
    exact = read_all(prepared, SensorsConfig(), truth)
    cut = read_all(prepared, config, truth)
    limits = np.tile([0.7, 0.7, 1.5], 2)
    for name, limit in (
        ("accelerometer", 0.5),
        ("foot_force", limits),
        ("foot_torque", 0.3),
        ("gyro", 99.0),
    ):
        np.testing.assert_array_equal(cut[name], np.clip(exact[name], -limit, limit))
    assert (np.abs(cut["foot_force"]) == limits).any(axis=0).all()


@pytest.mark.parametrize("count", [1.0, 2.0, 2.25, 5.5])
def test_delay_shifts_the_signal(prepared: PreparedRun, count: float) -> None:
    """One sensor is late, interpolated between two periods; all others are not."""
    accelerometer = AccelerometerConfig(delay=count * PERIOD)
    truth = np.cumsum(make_noise(prepared, 100), axis=0)
    prompt = read_all(prepared, SensorsConfig(), truth)
    late = read_all(prepared, SensorsConfig(accelerometer=accelerometer), truth)
    times = np.arange(100.0)
    for axis in range(3):
        expected = np.interp(times - count, times, prompt["accelerometer"][:, axis])
        np.testing.assert_allclose(
            late["accelerometer"][:, axis], expected, rtol=0.0, atol=1e-12
        )
    for name in ("encoder", "velocity", "gyro", "foot_force", "ball_gyro"):
        np.testing.assert_array_equal(late[name], prompt[name])


def test_late_encoders_have_late_velocities(prepared: PreparedRun) -> None:
    """The drive derives the velocity from what its encoder reads."""
    truth = np.cumsum(make_noise(prepared, 60), axis=0)
    encoder = EncoderConfig(delay=3 * PERIOD)
    prompt = read_all(prepared, SensorsConfig(), truth)["velocity"]
    late = read_all(prepared, SensorsConfig(encoder=encoder), truth)["velocity"]
    np.testing.assert_array_equal(late[4:], prompt[1:-3])


def test_slow_sensor_holds_its_samples(prepared: PreparedRun) -> None:
    """100 Hz at 500 Hz: each fifth reading is fresh, the others repeat it."""
    slow = SensorsConfig(
        gyro=GyroConfig(rate=100.0), encoder=EncoderConfig(rate=1.0 / (3 * PERIOD))
    )
    truth = make_noise(prepared, 600)
    exact, held = (
        read_all(prepared, SensorsConfig(), truth),
        read_all(prepared, slow, truth),
    )
    ticks = np.arange(600)
    np.testing.assert_array_equal(held["gyro"], exact["gyro"][ticks // 5 * 5])
    for name in ("encoder", "velocity"):
        np.testing.assert_array_equal(held[name], exact[name][ticks // 3 * 3])


def test_rate_need_not_divide_the_control_rate(prepared: PreparedRun) -> None:
    """A rate of 180 Hz gives 180 fresh samples in a second."""
    gyro = GyroConfig(rate=180.0)
    held = read_all(prepared, SensorsConfig(gyro=gyro), make_noise(prepared, 501))[
        "gyro"
    ]
    assert np.any(np.diff(held, axis=0) != 0.0, axis=1).sum() == 180


def test_slow_sensor_has_less_noise_of_a_density() -> None:
    """A sample stands for its own period, not for the control period."""
    gyro = GyroConfig(noise_density=0.01, rate=100.0)
    assert gyro.sample_period(PERIOD) == pytest.approx(0.01)
    assert gyro.sample_std(gyro.sample_period(PERIOD)) == pytest.approx(0.1)
    assert GyroConfig(rate=2000.0).sample_period(PERIOD) == PERIOD


def test_lost_samples_are_held(prepared: PreparedRun) -> None:
    """They are as frequent as configured, and one frame carries an ankle's wrench."""
    lossy = SensorsConfig(
        foot_force=ForceConfig(drop_probability=0.2),
        foot_torque=TorqueConfig(drop_probability=0.2),
    )
    truth = make_noise(prepared, 5000)
    exact, held = (
        read_all(prepared, SensorsConfig(), truth),
        read_all(prepared, lossy, truth),
    )
    is_lost = held["foot_force"] != exact["foot_force"]
    np.testing.assert_array_equal(is_lost, held["foot_torque"] != exact["foot_torque"])
    left, right = is_lost[:, 0], is_lost[:, 3]
    np.testing.assert_array_equal(is_lost[:, :3], np.repeat(left[:, None], 3, axis=1))
    assert left.mean() == pytest.approx(0.2, abs=0.02)
    assert (left & right).mean() == pytest.approx(0.04, abs=0.01)
    rows = np.maximum.accumulate(np.where(left, 0, np.arange(5000)))
    np.testing.assert_array_equal(
        held["foot_force"][:, :3], exact["foot_force"][rows, :3]
    )


def test_more_drops_keep_those_of_fewer(prepared: PreparedRun) -> None:
    """Common random numbers: what is lost at a lower probability stays lost."""
    truth = make_noise(prepared, 2000)
    exact = read_all(prepared, SensorsConfig(), truth)["gyro"][:, 0]

    def lost(probability: float) -> Array:
        gyro = GyroConfig(drop_probability=probability)
        held = read_all(prepared, SensorsConfig(gyro=gyro), truth)["gyro"][:, 0]
        is_lost: Array = held != exact
        return is_lost

    few, many = lost(0.1), lost(0.3)
    assert not (few & ~many).any()
    assert (many & ~few).any()


def test_scheduled_dropouts(prepared: PreparedRun) -> None:
    """50 ms once in a second hold the last sample; the first second is whole."""
    force = ForceConfig(dropout_period=1.0, dropout_duration=0.05)
    truth = make_noise(prepared, 1600)
    exact = read_all(prepared, SensorsConfig(), truth)["foot_force"]
    held = read_all(prepared, SensorsConfig(foot_force=force), truth)["foot_force"]
    rows = np.arange(1600)
    for start in (500, 1000, 1500):
        rows[start : start + 25] = start - 1
    np.testing.assert_array_equal(held, exact[rows])


def test_scale_and_axes_are_linear_errors(prepared: PreparedRun) -> None:
    """A least-squares calibration finds the same matrix that the spread says."""
    gyro = GyroConfig(scale_std=0.02, misalignment_std=0.03)
    truth = make_noise(prepared, 50)
    exact = read_all(prepared, SensorsConfig(), truth)["gyro"]
    errors = []
    for seed in range(150):
        read = read_all(prepared, SensorsConfig(gyro=gyro), truth, seed)["gyro"]
        matrix, residuals, _, _ = np.linalg.lstsq(exact, read, rcond=None)
        assert residuals.max() < 1e-20
        errors.append(matrix.T - np.eye(3))
    spread = np.std(errors, axis=0)
    assert np.diag(spread) == pytest.approx(0.02, rel=0.2)
    assert spread[~np.eye(3, dtype=bool)] == pytest.approx(0.03, rel=0.2)


def test_coupling_links_force_and_torque_of_one_foot(prepared: PreparedRun) -> None:
    """Torques show forces of the same foot, in metres; forces stay as they are."""
    config = SensorsConfig(foot_torque=TorqueConfig(coupling_std=0.01))
    truth = make_noise(prepared, 80)
    exact, read = (
        read_all(prepared, SensorsConfig(), truth),
        read_all(prepared, config, truth),
    )
    np.testing.assert_array_equal(read["foot_force"], exact["foot_force"])
    for foot in (slice(0, 3), slice(3, 6)):
        extra = read["foot_torque"][:, foot] - exact["foot_torque"][:, foot]
        force = exact["foot_force"][:, foot]
        matrix, residuals, _, _ = np.linalg.lstsq(force, extra, rcond=None)
        assert residuals.max() < 1e-20
        assert 0.002 < matrix.std() < 0.02
        assert (matrix != 0.0).all()
