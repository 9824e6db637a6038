"""The sensors' monitor by itself: signs of illness and what stands in."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ballsim_controllers.estimation.health import (
    HealthMonitor,
    check_readings,
    trust_legs,
)
from ballsim_controllers.messages import Record, reading_dtype

_DT, _WEIGHT, _GRAVITY, _N = 0.005, 600.0, 9.81, 4


class _Feed:
    """Feeds a monitor with a quiet, noisy stance that single values are changed in."""

    def __init__(self) -> None:
        self.accelerations = np.zeros(6 + _N)
        self.monitor = HealthMonitor(_N, _DT, _WEIGHT, self.accelerations)
        self._random = np.random.default_rng(3)
        self._tick = 0

    def make(self) -> Record:
        """Return the next reading, untouched."""
        reading: Record = np.zeros(1, reading_dtype(_N))
        for name in (reading.dtype.names or ())[1:]:
            reading[name] = 1e-3 * self._random.normal(size=reading[name].shape)
        reading["acceleration_imu"][0, 2] += _GRAVITY
        reading["foot_forces"][0, :, 2] -= 0.5 * _WEIGHT
        reading["time"] = self._tick * _DT
        self._tick += 1
        return reading

    def check(
        self,
        reading: Record,
        rotation: np.ndarray | None = None,
        mounting: np.ndarray | None = None,
    ) -> set[str]:
        """Judge a reading and return who is ill."""
        trunk = np.eye(3) if rotation is None else rotation
        imu = np.eye(3) if mounting is None else mounting
        check_readings(*self.monitor.arguments, reading, imu, trunk, _GRAVITY)
        return set(self.monitor.ill_sensors)

    def settle(self, n: int = 5) -> None:
        """Feed healthy readings."""
        for _ in range(n):
            reading = self.make()
            assert self.check(reading) == set()
            assert self.monitor.healthy.tobytes() == reading.tobytes()


def test_healthy_readings_pass_bit_for_bit() -> None:
    """A monitor that finds nothing changes nothing."""
    _Feed().settle(50)


@pytest.mark.parametrize(
    ("name", "place", "sensor"),
    [
        ("joint_positions", 2, "encoder"),
        ("joint_velocities", 1, "encoder"),
        ("angular_velocity_imu", 0, "gyro"),
        ("acceleration_imu", 1, "accelerometer"),
        ("foot_forces", (0, 2), "left_ankle"),
        ("foot_torques", (1, 0), "right_ankle"),
        ("angular_velocity_ball", 2, "ball_gyro"),
    ],
)
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e4])
def test_one_bad_value_is_noticed_at_once(
    name: str, place: int | tuple[int, int], sensor: str, value: float
) -> None:
    """No number, or far from the last one: ill at that tick, well at the next."""
    feed = _Feed()
    feed.settle()
    reading = feed.make()
    reading[name][0][place] = value
    assert feed.check(reading) == {sensor}
    for field in feed.monitor.healthy.dtype.names or ():
        assert np.isfinite(feed.monitor.healthy[field]).all()
        assert np.abs(feed.monitor.healthy[field]).max() < 700.0
    feed.settle(1)


def test_frozen_sensor_is_noticed_at_the_third_repeat() -> None:
    """15 ms after its last change, not sooner; a repeat or two are no illness."""
    feed = _Feed()
    feed.settle()
    stuck = feed.make()
    assert feed.check(stuck) == set()
    for ill in (set(), set(), {"gyro"}, {"gyro"}):
        reading = feed.make()
        reading["angular_velocity_imu"] = stuck["angular_velocity_imu"]
        assert feed.check(reading) == ill
    feed.settle(1)


def test_silent_sensor_is_noticed_at_once_but_not_at_the_start() -> None:
    """All zero after something else; who begins with zero may be at rest."""
    feed = _Feed()
    reading = feed.make()
    reading["angular_velocity_ball"] = 0.0
    assert feed.check(reading) == set()
    feed.settle()
    reading = feed.make()
    reading["foot_forces"][0, 0] = 0.0
    reading["foot_torques"][0, 0] = 0.0
    assert feed.check(reading) == {"left_ankle"}


def test_lost_ankle_carries_what_the_other_leaves() -> None:
    """The wrench that stands in keeps its direction and CoP, not its size."""
    feed = _Feed()
    feed.settle()
    reading = feed.make()
    reading["foot_forces"][0, 0] = [30.0, 0.0, -300.0]
    reading["foot_torques"][0, 0] = [3.0, 6.0, 0.0]
    assert feed.check(reading) == set()
    reading = feed.make()
    reading["foot_forces"][0, 0] = np.nan
    reading["foot_forces"][0, 1] = [0.0, 0.0, -400.0]
    assert feed.check(reading) == {"left_ankle"}
    healthy = feed.monitor.healthy
    share = 200.0 / 300.0
    np.testing.assert_allclose(
        healthy["foot_forces"][0, 0], [30 * share, 0, -200], rtol=1e-12
    )
    np.testing.assert_allclose(
        healthy["foot_torques"][0, 0], [3 * share, 6 * share, 0], rtol=1e-12
    )


def test_foot_that_comes_down_unseen_is_loaded() -> None:
    """It carried nothing when its sensor was lost; then the other lets go."""
    feed = _Feed()
    for _ in range(3):
        reading = feed.make()
        reading["foot_forces"][0] = [[0.1, 0, -5.0], [0.2, 0, -595.0]]
        reading["foot_forces"][0] += 1e-3 * np.random.default_rng(1).normal(size=(2, 3))
        feed.check(reading)
    reading = feed.make()
    reading["foot_forces"][0] = [[np.nan] * 3, [0.0, 0.0, -250.0]]
    assert feed.check(reading) == {"left_ankle"}
    force = feed.monitor.healthy["foot_forces"][0, 0]
    np.testing.assert_allclose(force, [0.0, 0.0, -350.0])


def test_lost_accelerometer_feels_gravity_in_the_estimated_attitude() -> None:
    """At rest that is what it would read."""
    feed = _Feed()
    feed.settle()
    angle = 0.2
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    reading = feed.make()
    reading["acceleration_imu"] = np.nan
    assert feed.check(reading, rotation) == {"accelerometer"}
    expected = rotation.T @ np.array([0, 0, _GRAVITY])
    np.testing.assert_allclose(feed.monitor.healthy["acceleration_imu"][0], expected)


def test_lost_encoder_goes_on_with_its_speed() -> None:
    """The angle moves on; all other joints are read."""
    feed = _Feed()
    feed.settle()
    moving = feed.make()
    moving["joint_velocities"][0, 1] = 2.0
    assert feed.check(moving) == set()
    lost = feed.make()
    lost["joint_positions"][0, 1] = np.nan
    assert feed.check(lost) == {"encoder"}
    healthy = feed.monitor.healthy["joint_positions"][0]
    assert healthy[1] == pytest.approx(moving["joint_positions"][0, 1] + 2.0 * _DT)
    np.testing.assert_array_equal(
        healthy[[0, 2, 3]], lost["joint_positions"][0, [0, 2, 3]]
    )


def test_lost_encoder_keeps_its_speed_for_a_while() -> None:
    """For ten ticks, the 50 ms of a drop-out; then it comes to rest."""
    feed = _Feed()
    feed.settle()
    moving = feed.make()
    moving["joint_velocities"][0, 1] = 2.0
    feed.check(moving)
    speeds = []
    for _ in range(60):
        lost = feed.make()
        lost["joint_positions"][0, 1] = np.nan
        feed.check(lost)
        speeds.append(feed.monitor.healthy["joint_velocities"][0, 1])
    assert speeds[:10] == [2.0] * 10
    assert np.all(np.diff(speeds[9:]) < 0.0)
    assert speeds[-1] < 0.02


def test_lost_encoder_follows_what_is_asked_of_its_joint() -> None:
    """Constant acceleration from the last healthy reading on: a parabola."""
    feed = _Feed()
    feed.settle()
    moving = feed.make()
    moving["joint_velocities"][0, 1] = -0.4
    feed.check(moving)
    feed.accelerations[6 + 1] = 30.0
    for tick in range(1, 11):
        lost = feed.make()
        lost["joint_positions"][0, 1] = np.nan
        feed.check(lost)
        time = tick * _DT
        moved = -0.4 * time + 0.5 * 30.0 * time**2
        healthy = feed.monitor.healthy[0]
        assert healthy["joint_velocities"][1] == pytest.approx(-0.4 + 30.0 * time)
        angle = moving["joint_positions"][0, 1] + moved
        assert healthy["joint_positions"][1] == pytest.approx(angle)
    back = feed.make()
    back["joint_positions"][0, 1] += moved
    assert feed.check(back) == set()


def test_lost_gyro_follows_what_is_asked_of_the_trunk() -> None:
    """The angular acceleration in the trunk, seen by an IMU that is mounted askew."""
    feed = _Feed()
    feed.settle()
    last = feed.make()
    feed.check(last)
    asked = np.array([0.3, -2.0, 1.0])
    feed.accelerations[3:6] = asked
    mounting = Rotation.from_rotvec([0.1, 0.8, -0.4]).as_matrix()
    for tick in range(1, 11):
        lost = feed.make()
        lost["angular_velocity_imu"] = 0.0
        assert feed.check(lost, mounting=mounting) == {"gyro"}
        expected = mounting @ last["angular_velocity_imu"][0] + tick * _DT * asked
        rate = mounting @ feed.monitor.healthy["angular_velocity_imu"][0]
        np.testing.assert_allclose(rate, expected, atol=1e-12)


def test_a_leg_with_a_lost_encoder_is_not_trusted() -> None:
    """That leg alone, from the tick on, until the encoder is back; no arm matters."""
    monitor = HealthMonitor(13, _DT, _WEIGHT, np.zeros(19))
    counts, trust = monitor.arguments[3], np.zeros(2)
    legs = np.array([np.arange(6, 12), np.arange(12, 18)])
    trust_legs(trust, counts, legs)
    np.testing.assert_array_equal(trust, [1.0, 1.0])
    for joint, expected in ((8, [1.0, 0.0]), (0, [0.0, 1.0]), (12, [1.0, 1.0])):
        counts[0] = 0.0
        counts[0, joint] = 3.0
        trust_legs(trust, counts, legs)
        np.testing.assert_array_equal(trust, expected)


def test_frozen_joint_is_noticed_and_the_others_are_read() -> None:
    """One joint repeats itself: at the third repeat it goes on with its speed."""
    feed = _Feed()
    feed.settle(2000)
    last = feed.make()
    assert feed.check(last) == set()
    for tick in range(1, 8):
        reading = feed.make()
        for name in ("joint_positions", "joint_velocities"):
            reading[name][0, 2] = last[name][0, 2]
        assert feed.check(reading) == ({"encoder"} if tick >= 3 else set())
        healthy = feed.monitor.healthy["joint_positions"][0]
        np.testing.assert_array_equal(
            healthy[[0, 1, 3]], reading["joint_positions"][0, [0, 1, 3]]
        )
    assert feed.check(feed.make()) == set()


@pytest.mark.parametrize("step", [5e-4, 2e-3])
def test_rounded_joint_at_rest_is_not_frozen(step: float) -> None:
    """Encoders that round to about their noise repeat often and stay healthy."""
    feed = _Feed()
    for _ in range(5000):
        reading = feed.make()
        for name in ("joint_positions", "joint_velocities"):
            reading[name] = step * np.round(reading[name] / step)
        reading["joint_positions"][0, 0] += 1e-4 * feed._random.normal()
        assert feed.check(reading) == set()


def test_lasting_step_is_believed_in_the_end() -> None:
    """What a value can have moved grows, so that a real change is not shut out."""
    feed = _Feed()
    feed.settle()
    ill = []
    for _ in range(40):
        reading = feed.make()
        reading["angular_velocity_imu"][0, 0] += 5.0
        ill.append(bool(feed.check(reading)))
    n_ill = sum(ill)
    assert 20 <= n_ill <= 26
    assert ill == [True] * n_ill + [False] * (40 - n_ill)


def test_compiled_monitor_gives_the_bits_of_plain_python() -> None:
    """Readings are the same with and without compilation."""
    plain = getattr(check_readings, "py_func", check_readings)
    results = []
    for check in (check_readings, plain):
        feed, bits = _Feed(), []
        for tick in range(60):
            reading = feed.make()
            if 20 <= tick < 30:
                reading["foot_forces"][0, tick % 2] = np.nan
                reading["angular_velocity_imu"] = 0.0
                reading["joint_positions"][0, 1] = 9.0
            check(*feed.monitor.arguments, reading, np.eye(3), np.eye(3), _GRAVITY)
            bits.append(feed.monitor.healthy.tobytes() + feed.monitor.state.tobytes())
        results.append(bits)
    assert results[0] == results[1]
