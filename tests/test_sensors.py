"""Sensors: channels, noise statistics, streams, velocity tracker."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.noise import NoiseModel, SensorChannels, make_generator
from ballsim.preparation import PreparedRun, prepare
from ballsim.sensor_config import EncoderConfig, GyroConfig, SensorsConfig
from ballsim.sensors import SensorSuite, VelocityTracker, _sample
from ballsim_controllers.messages import JointTargets, SensorReading


class _Silent:
    telemetry = None

    def step(self, reading: SensorReading, command: object) -> JointTargets:
        return JointTargets(reading.joint_positions)


@pytest.fixture(scope="module")
def prepared() -> PreparedRun:
    """Return a scene with its ids."""
    return prepare(load_config("stand").config, _Silent())


def _suite(prepared: PreparedRun, config: SensorsConfig, seed: int = 0) -> SensorSuite:
    return SensorSuite(prepared.ids, config, 0.002, seed)


def _flatten(reading: SensorReading) -> np.ndarray:
    return reading.record.view(np.float64)


def test_ideal_sensors_read_the_truth(prepared: PreparedRun) -> None:
    """Without noise every reading is MuJoCo's own number, in the right place."""
    ids, model = prepared.ids, prepared.plant.model
    data = np.random.default_rng(1).normal(size=model.nsensordata)
    reading = _suite(prepared, SensorsConfig()).read(0.5, data)
    assert reading.time == 0.5
    np.testing.assert_array_equal(reading.joint_positions, data[ids.sensor_joints])
    np.testing.assert_array_equal(reading.angular_velocity_imu, data[ids.sensor_gyro])
    np.testing.assert_array_equal(
        reading.acceleration_imu, data[ids.sensor_accelerometer]
    )
    for foot in (0, 1):
        np.testing.assert_array_equal(
            reading.foot_forces[foot], data[ids.sensor_forces[foot]]
        )
        np.testing.assert_array_equal(
            reading.foot_torques[foot], data[ids.sensor_torques[foot]]
        )
    np.testing.assert_array_equal(
        reading.angular_velocity_ball, data[ids.sensor_gyro_ball]
    )
    assert not reading.joint_velocities.any()


def test_readings_share_no_memory(prepared: PreparedRun) -> None:
    """A controller that writes into a reading changes nothing else."""
    data = np.zeros(prepared.plant.model.nsensordata)
    suite = _suite(prepared, SensorsConfig())
    first = suite.read(0.0, data)
    for name in ("joint_positions", "joint_velocities", "foot_forces"):
        getattr(first, name)[:] = 99.0
    assert not data.any()
    assert not _flatten(suite.read(0.0, data)).any()
    assert not first.angular_velocity_imu.any()


def test_noise_has_the_configured_spread(prepared: PreparedRun) -> None:
    """White part and bias have their standard deviations, other sensors none."""
    config = SensorsConfig(gyro=GyroConfig(noise_std=0.2, bias_std=0.5))
    data = np.zeros(prepared.plant.model.nsensordata)
    biases = []
    for seed in range(200):
        suite = _suite(prepared, config, seed)
        readings = [suite.read(0.0, data) for _ in range(50)]
        rates = np.array([r.angular_velocity_imu for r in readings])
        biases.append(rates.mean(axis=0))
        assert not readings[-1].angular_velocity_ball.any()
        if seed == 0:
            long = np.array(
                [suite.read(0.0, data).angular_velocity_imu for _ in range(4000)]
            )
            assert long.std(axis=0) == pytest.approx(0.2, rel=0.05)
    expected = np.hypot(0.5, 0.2 / np.sqrt(50))
    assert np.std(biases) == pytest.approx(expected, rel=0.1)


def test_sensors_do_not_share_their_noise(prepared: PreparedRun) -> None:
    """Two sensors of one kind are noisy independently of each other."""
    gyro = GyroConfig(noise_std=1.0)
    suite = _suite(prepared, SensorsConfig(gyro=gyro, ball_gyro=gyro))
    data = np.zeros(prepared.plant.model.nsensordata)
    readings = [suite.read(0.0, data) for _ in range(2000)]
    trunk = np.array([reading.angular_velocity_imu for reading in readings])
    ball = np.array([reading.angular_velocity_ball for reading in readings])
    correlation = np.corrcoef(np.hstack([trunk, ball]).T) - np.eye(6)
    assert np.abs(correlation).max() < 0.1


def test_same_seed_gives_the_same_noise(prepared: PreparedRun) -> None:
    """The seed decides the noise, bit for bit."""
    config = SensorsConfig(encoder=EncoderConfig(noise_std=0.1))
    data = np.zeros(prepared.plant.model.nsensordata)

    def sample(seed: int) -> bytes:
        suite = _suite(prepared, config, seed)
        return b"".join(_flatten(suite.read(0.0, data)).tobytes() for _ in range(600))

    assert sample(3) == sample(3)
    assert sample(3) != sample(4)


def test_streams_are_common_random_numbers() -> None:
    """The level of one sensor scales its own draws and leaves the others alone."""

    def sample(first_std: float) -> np.ndarray:
        model = NoiseModel(
            [
                SensorChannels(2, first_std, 0.0, make_generator(5, 0)),
                SensorChannels(3, 1.0, 1.0, make_generator(5, 1)),
            ]
        )
        return np.array([model.draw().copy() for _ in range(300)])

    one, two = sample(1.0), sample(2.0)
    np.testing.assert_array_equal(two[:, :2], 2.0 * one[:, :2])
    np.testing.assert_array_equal(two[:, 2:], one[:, 2:])


@pytest.mark.parametrize("preset", ["high", "mid", "low"])
def test_level_zero_of_a_preset_is_ideal(prepared: PreparedRun, preset: str) -> None:
    """With the multiplier 0 any preset reads the same bits as `ideal`."""
    random = np.random.default_rng(1)
    data = random.normal(size=(300, prepared.plant.model.nsensordata))

    def read(*overrides: str) -> bytes:
        suite = _suite(prepared, load_config("stand", overrides).config.sensors)
        return b"".join(_flatten(suite.read(0.0, d)).tobytes() for d in data)

    chosen = f"sensors.preset={preset}"
    assert read(chosen, "sensors.noise_multiplier=0") == read()
    assert read(chosen) != read()


def test_multipliers_scale_the_same_draws(prepared: PreparedRun) -> None:
    """They scale noise and bias, that of one sensor leaves all others alone."""
    zeros = np.zeros(prepared.plant.model.nsensordata)
    joints = 2 * len(prepared.ids.sensor_joints)

    def read(*overrides: str) -> np.ndarray:
        # The preset that rounds nothing off.
        loaded = load_config("stand", ["sensors.preset=high", *overrides])
        suite = _suite(prepared, loaded.config.sensors)
        return np.array([_flatten(suite.read(0.0, zeros))[1:] for _ in range(300)])

    one, four = read(), read("sensors.noise_multiplier=4")
    assert (one[1:] != 0.0).all()
    np.testing.assert_array_equal(four, 4.0 * one)
    gyro = read("sensors.noise_multiplier=2", "sensors.gyro.noise_multiplier=8")
    np.testing.assert_array_equal(
        gyro[:, joints : joints + 3] / 16.0, one[:, joints : joints + 3]
    )
    np.testing.assert_array_equal(gyro[:, joints + 3 :], 2.0 * one[:, joints + 3 :])
    np.testing.assert_array_equal(gyro[:, :joints], 2.0 * one[:, :joints])
    alone = read("sensors.noisy=gyro")
    np.testing.assert_array_equal(
        alone[:, joints : joints + 3], one[:, joints : joints + 3]
    )
    assert not np.delete(alone, range(joints, joints + 3), axis=1).any()


def test_density_is_white_noise_at_the_rate_of_the_readings() -> None:
    """A density means more noise in a sample the faster samples are taken."""
    gyro = GyroConfig(noise_density=0.01)
    assert gyro.sample_std(0.0025) == pytest.approx(2.0 * gyro.sample_std(0.01))
    assert gyro.sample_std(0.01) == pytest.approx(0.1)
    both = GyroConfig(noise_std=0.3, noise_density=0.04)
    assert both.sample_std(0.01) == pytest.approx(0.5)
    encoder = EncoderConfig(noise_density=1e-5)
    assert encoder.sample_std(0.0004) == pytest.approx(5e-4)


@pytest.mark.parametrize("n_late", [0, 1, 3, 70])
def test_readings_arrive_late(prepared: PreparedRun, n_late: int) -> None:
    """A delay shifts all but the time; the first reading stands in at the start."""
    gyro = GyroConfig(noise_std=0.1)
    config = SensorsConfig(gyro=gyro, delay=n_late * 0.002)
    prompt, late = _suite(prepared, SensorsConfig(gyro=gyro)), _suite(prepared, config)
    random = np.random.default_rng(1)
    data = random.normal(size=(200, prepared.plant.model.nsensordata))
    times = 0.002 * np.arange(200)
    readings = [prompt.read(t, d) for t, d in zip(times, data, strict=True)]
    delayed = [late.read(t, d) for t, d in zip(times, data, strict=True)]
    for i, reading in enumerate(delayed):
        assert reading.time == times[i]
        earlier = _flatten(readings[max(0, i - n_late)])
        np.testing.assert_array_equal(_flatten(reading)[1:], earlier[1:])
    assert not any(np.shares_memory(delayed[0].record, r.record) for r in delayed[1:9])


def test_compiled_kernels_give_the_bits_of_plain_python() -> None:
    """Readings are the same with and without compilation."""
    random = np.random.default_rng(2)
    order = random.permutation(12)
    results = []
    for sample in (_sample, getattr(_sample, "py_func", _sample)):
        random = np.random.default_rng(3)
        tracker = VelocityTracker(40.0, 0.004, 5)
        rows = np.zeros((20, 1 + 12 + 5))
        for row in rows:
            data, errors = random.normal(size=(2, 12))
            sample(row, data, order, errors, tracker.gains, tracker.state)
        results.append(rows.tobytes())
    assert results[0] == results[1]


def test_plain_difference_without_bandwidth() -> None:
    """Bandwidth 0 gives the difference over one period, and 0 at first."""
    tracker = VelocityTracker(0.0, 0.002, 3)
    positions = np.cumsum(np.random.default_rng(0).normal(size=(50, 3)), axis=0)
    velocities = np.array([tracker.update(p) for p in positions])
    assert not velocities[0].any()
    expected = np.diff(positions, axis=0) / 0.002
    np.testing.assert_allclose(velocities[1:], expected, rtol=1e-9, atol=1e-9)


def test_tracker_has_no_lag_at_constant_speed_and_less_noise() -> None:
    """The tracker settles on a constant speed and damps the encoder's noise."""
    period, noise = 0.002, 1e-4 * np.random.default_rng(0).normal(size=(3000, 1))
    ramp = 0.7 * period * np.arange(3000)[:, None]
    tracker = VelocityTracker(30.0, period, 1)
    clean = np.array([tracker.update(p) for p in ramp])
    assert clean[-1] == pytest.approx(0.7)
    slow, plain = VelocityTracker(30.0, period, 1), VelocityTracker(0.0, period, 1)
    damped = np.array([slow.update(p) for p in noise])
    raw = np.array([plain.update(p) for p in noise])
    assert damped[500:].std() < 0.3 * raw[500:].std()
