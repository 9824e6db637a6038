"""Health of the sensors, judged from their readings alone, and what stands in.

A sensor is ill at a tick if a value of it is no number, if all its values are zero at
once (of a joint, an angle that has come to zero at no speed), if none of its bits has
changed for three readings (of a joint's encoder, for more than chance explains), or if
a value has moved further from the last healthy one than it can have moved since. What
stands in then:

* encoder: the last healthy angle, moved on with its speed, and that with the
  acceleration that is asked of the joint, fading after a while; the leg's part in the
  odometry is left out meanwhile (`trust_legs`), IMU and contact forces carry on;
* gyros: the last healthy rate, that of the trunk with the acceleration that is asked of
  it, fading after a while;
* accelerometer: gravity in the estimated attitude;
* ankle: the last healthy wrench, scaled to the load that the other foot leaves.

A sensor that samples more slowly than every third reading looks frozen, and so does a
joint that comes to rest within one step of its encoder; what stands in then hardly
differs from what they hold.
"""

from __future__ import annotations

import math

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.stand_ins import load_wrench, move_rate
from ballsim_controllers.geometry import apply_transposed, clip
from ballsim_controllers.messages import Array, Record, reading_dtype
from ballsim_controllers.sensor_names import name_sensors
from ballsim_controllers.whole_body.leg_motion import N_BASE

__all__ = ["HEALTH", "HealthMonitor", "check_readings", "trust_legs"]

_ENCODER, _GYRO, _ACCELEROMETER, _LEFT_ANKLE, _RIGHT_ANKLE, _BALL_GYRO = range(6)
_STUCK_TIME = 0.015  # without a changed bit, [s]
_REPEAT_TIME = 0.3  # over which is counted how often a joint repeats itself, [s]
_CHANCE = math.log(1e-9)  # that a healthy one does so many times in a row
_MISSED, _UNCHANGED, _REPEATS, _BEFORE = range(4)  # rows of what is kept for joints
_DISBELIEF = 20  # ticks for which a value that stays elsewhere is not believed
_ROUNDED = 0.01  # what encoders round to zero, and more, [rad]

# What a healthy value may move in a tick, about four times what walking, stepping and
# pushes show (the scenarios of ballsim).
_MAX_ANGLE_STEP = 0.15  # [rad]
_MAX_SPEED_STEP = 20.0  # of a joint, [rad/s]
_MAX_RATE_STEP = 1.0  # [rad/s]
_MAX_ACCELERATION_STEP = 15.0  # [m/s^2]
_MAX_FORCE_STEP = 600.0  # [N]
_MAX_TORQUE_STEP = 40.0  # [N m]

# What of the acceleration that is asked for is believed: a fall asks for anything.
_MOST_TURNING = 20.0  # of the trunk, [rad/s^2]
_MOST_BENDING = 200.0  # of a joint, [rad/s^2]

#: What the monitor keeps beside the last readings, raw and healthy.
HEALTH = np.dtype(
    [
        ("has_started", np.int64),
        ("dt", np.float64),
        ("weight", np.float64),
        ("ill", np.int32),  # bits as of `name_sensors`
        ("unchanged", np.int64, 6),  # readings in a row without a changed bit
        ("missed", np.int64, 6),  # ticks since the last healthy value
    ]
)


class HealthMonitor:
    """Finds ill sensors and keeps a reading that is healthy as far as can be.

    Args:
        n_joints: Number of joints.
        dt: Control period, [s].
        weight: Weight of the robot, [N].
        accelerations: Generalised acceleration that the last tick asked for, shape
            (6 + n,), [m/s^2, rad/s^2]; read at each check.

    Attributes:
        healthy: The reading to work with, shape (1,), dtype of `reading_dtype`.
        state: Shape (1,), dtype `HEALTH`.
        arguments: What `check_readings` takes before reading, fusion and tilt.
    """

    def __init__(
        self, n_joints: int, dt: float, weight: float, accelerations: Array
    ) -> None:
        """Begin with nothing."""
        self.healthy: Record = np.zeros(1, reading_dtype(n_joints))
        self.state: Record = np.zeros(1, HEALTH)
        self.state["dt"] = dt
        self.state["weight"] = weight
        raw: Record = np.zeros(1, reading_dtype(n_joints))
        joints = np.zeros((4, n_joints))
        joints[_REPEATS] = 1.0
        self.arguments = (self.healthy, self.state, raw, joints, accelerations)

    @property
    def ill_sensors(self) -> tuple[str, ...]:
        """Return the names of the sensors that are ill at present."""
        return name_sensors(int(self.state["ill"][0]))


@compiled
def check_readings(
    healthies: Record,
    healths: Record,
    raws: Record,
    joints: Array,
    accelerations: Array,
    readings: Record,
    rotation_imu_to_trunk: Array,
    rotation_trunk_to_world: Array,
    gravity: float,
) -> None:
    """Judge a reading and write one to work with.

    Args:
        healthies: The reading to work with, shape (1,), changed in place.
        healths: What the monitor keeps, shape (1,), dtype `HEALTH`.
        raws: The reading before, shape (1,).
        joints: For each joint ticks since its last healthy angle, readings in a row
            without a changed bit, share of readings that repeat, and that share before
            the last change, shape (4, n).
        accelerations: Generalised acceleration that the last tick asked for, shape
            (6 + n,), the trunk's turning in the trunk, [m/s^2, rad/s^2].
        readings: The reading, shape (1,).
        rotation_imu_to_trunk: Shape (3, 3).
        rotation_trunk_to_world: Attitude estimated at the last tick, shape (3, 3).
        gravity: g, [m/s^2].
    """
    reading, healthy, raw, health = readings[0], healthies[0], raws[0], healths[0]
    healthy["time"] = reading["time"]
    is_first = health["has_started"] == 0
    health["has_started"] = 1
    health["ill"] = 0
    _check_encoders(health, healthy, raw, reading, joints, accelerations, is_first)
    new, old = reading["angular_velocity_imu"], raw["angular_velocity_imu"]
    good = healthy["angular_velocity_imu"]
    if _is_healthy(health, _GYRO, new, old, good, _MAX_RATE_STEP, is_first):
        good[:] = new
    else:
        turning = accelerations[N_BASE - 3 : N_BASE]
        turning = apply_transposed(rotation_imu_to_trunk, turning)
        for i in range(3):
            asked = clip(turning[i], -_MOST_TURNING, _MOST_TURNING)
            good[i] = move_rate(good[i], asked, health["missed"][_GYRO], health["dt"])
    old[:] = new
    new, old = reading["acceleration_imu"], raw["acceleration_imu"]
    good, limit = healthy["acceleration_imu"], _MAX_ACCELERATION_STEP
    if _is_healthy(health, _ACCELEROMETER, new, old, good, limit, is_first):
        good[:] = new
    else:
        up = apply_transposed(rotation_trunk_to_world, np.array([0.0, 0.0, gravity]))
        good[:] = apply_transposed(rotation_imu_to_trunk, up)
    old[:] = new
    new, old = reading["angular_velocity_ball"], raw["angular_velocity_ball"]
    good = healthy["angular_velocity_ball"]
    if _is_healthy(health, _BALL_GYRO, new, old, good, _MAX_RATE_STEP, is_first):
        good[:] = new
    else:
        for i in range(3):
            good[i] = move_rate(good[i], 0.0, health["missed"][_BALL_GYRO], 0.0)
    old[:] = new
    _check_ankles(health, healthy, raw, reading, is_first)


@compiled
def _widen(missed: int) -> float:
    """Return how much further than in a tick a value may be after some without it.

    Healthy values come back to where they were, rather than running away. Only one
    that stays elsewhere for longer is believed in the end.
    """
    return 1.0 + 0.1 * missed + max(missed - _DISBELIEF, 0)


@compiled
def _is_healthy(
    health: Record,
    sensor: int,
    new: Array,
    old: Array,
    good: Array,
    limit: float,
    is_first: bool,
) -> bool:
    """Judge three values of a sensor and count.

    Args:
        health: What the monitor keeps.
        sensor: Index of the sensor.
        new: What it reads, shape (3,).
        old: What it read before, shape (3,).
        good: Its last healthy values, shape (3,).
        limit: What a value may move in a tick.
        is_first: True if nothing was read before.
    """
    is_number, is_changed, is_zero, was_zero, is_near = True, False, True, True, True
    reach = limit * _widen(health["missed"][sensor])
    for i in range(new.shape[0]):
        is_number = is_number and math.isfinite(new[i])
        is_changed = is_changed or new[i] != old[i]
        is_zero = is_zero and new[i] == 0.0
        was_zero = was_zero and good[i] == 0.0
        is_near = is_near and abs(new[i] - good[i]) <= reach
    return _count(
        health,
        sensor,
        is_number,
        is_changed,
        is_zero and not was_zero,
        is_near,
        is_first,
    )


@compiled
def _count(
    health: Record,
    sensor: int,
    is_number: bool,
    is_changed: bool,
    is_silent: bool,
    is_near: bool,
    is_first: bool,
) -> bool:
    """Put the signs together: write counts and bit, return whether it is healthy."""
    unchanged, missed = health["unchanged"], health["missed"]
    unchanged[sensor] = 0 if is_changed or is_first else unchanged[sensor] + 1
    is_stuck = unchanged[sensor] * health["dt"] >= _STUCK_TIME - 1e-9
    is_stuck = is_stuck and unchanged[sensor] >= 3
    is_healthy = is_number and (
        is_first or (is_near and not is_silent and not is_stuck)
    )
    if is_healthy:
        missed[sensor] = 0
    else:
        missed[sensor] += 1
        health["ill"] |= 1 << sensor
    return is_healthy


@compiled
def _check_encoders(
    health: Record,
    healthy: Record,
    raw: Record,
    reading: Record,
    joints: Array,
    accelerations: Array,
    is_first: bool,
) -> None:
    """Judge the encoders: silent and stuck as one bus, and joint by joint.

    A joint at rest may repeat its angle where the encoder rounds it. How often it does
    tells after how many repeats chance is no explanation any more.
    """
    positions, velocities = reading["joint_positions"], reading["joint_velocities"]
    old, dt = raw["joint_positions"], health["dt"]
    old_velocities = raw["joint_velocities"]
    follow = dt / _REPEAT_TIME
    good, good_velocities = healthy["joint_positions"], healthy["joint_velocities"]
    is_changed, is_zero, was_zero = False, True, True
    n = positions.shape[0]
    for i in range(n):
        is_same = positions[i] == old[i] and velocities[i] == old_velocities[i]
        is_changed = is_changed or positions[i] != old[i]
        joints[_UNCHANGED, i] = joints[_UNCHANGED, i] + 1.0 if is_same else 0.0
        if not is_same:
            joints[_BEFORE, i] = joints[_REPEATS, i]
        if not _is_stuck(joints, i, dt):
            share = 1.0 if is_same else 0.0
            joints[_REPEATS, i] += follow * (share - joints[_REPEATS, i])
        is_zero = is_zero and positions[i] == 0.0
        was_zero = was_zero and good[i] == 0.0
        old[i], old_velocities[i] = positions[i], velocities[i]
    is_silent = is_zero and not was_zero
    is_there = _count(health, _ENCODER, True, is_changed, is_silent, True, is_first)
    for i in range(n):
        position, velocity = positions[i], velocities[i]
        reach = _widen(int(joints[_MISSED, i]))
        is_near = (
            abs(position - good[i]) <= _MAX_ANGLE_STEP * reach
            and abs(velocity - good_velocities[i]) <= _MAX_SPEED_STEP * reach
        )
        is_number = math.isfinite(position) and math.isfinite(velocity)
        # An angle that has changed has done so at a speed, which is derived from it.
        is_lost = position == 0.0 and velocity == 0.0 and abs(good[i]) > _ROUNDED
        is_lost = is_lost and joints[_MISSED, i] < _DISBELIEF
        is_sound = is_near and not is_lost and not _is_stuck(joints, i, dt)
        if is_there and is_number and (is_first or is_sound):
            good[i], good_velocities[i] = position, velocity
            joints[_MISSED, i] = 0.0
        else:
            joints[_MISSED, i] += 1.0
            asked = clip(accelerations[N_BASE + i], -_MOST_BENDING, _MOST_BENDING)
            speed = move_rate(good_velocities[i], asked, joints[_MISSED, i], dt)
            good[i] += 0.5 * dt * (good_velocities[i] + speed)
            good_velocities[i] = speed
            health["ill"] |= 1 << _ENCODER


@compiled
def trust_legs(trust: Array, joints: Array, legs: Array) -> None:
    """Tell the legs whose joints are all known from the others.

    An angle that goes on with the last speed places a foot well enough for 50 ms. The
    speed is wrong by a whole joint's acceleration, and with it what the leg tells of
    the trunk's.

    Args:
        trust: Gets 1 for a leg whose encoders are healthy, else 0, shape (2,).
        joints: What `check_readings` counts for each joint.
        legs: Degrees of freedom of each leg, shape (2, 6).
    """
    for leg in range(2):
        trust[leg] = 1.0
        for dof in legs[leg]:
            if joints[_MISSED, dof - N_BASE] > 0.0:
                trust[leg] = 0.0


@compiled
def _is_stuck(joints: Array, joint: int, dt: float) -> bool:
    """Return whether a joint has repeated itself more often than chance explains."""
    repeats = joints[_UNCHANGED, joint]
    if repeats < 3.0 or repeats * dt < _STUCK_TIME - 1e-9:
        return False
    return bool(repeats * math.log(max(joints[_BEFORE, joint], 1e-9)) < _CHANCE)


@compiled
def _check_ankles(
    health: Record, healthy: Record, raw: Record, reading: Record, is_first: bool
) -> None:
    """Judge both ankles; the other foot tells the load of one that is ill."""
    is_well = np.zeros(2, dtype=np.bool_)
    for foot in range(2):
        sensor = _LEFT_ANKLE + foot
        force, torque = reading["foot_forces"][foot], reading["foot_torques"][foot]
        good_force = healthy["foot_forces"][foot]
        good_torque = healthy["foot_torques"][foot]
        old_force, old_torque = raw["foot_forces"][foot], raw["foot_torques"][foot]
        is_number, is_changed, is_near = True, False, True
        is_zero, was_zero = True, True
        reach = _widen(health["missed"][sensor])
        for i in range(3):
            is_number = is_number and math.isfinite(force[i])
            is_number = is_number and math.isfinite(torque[i])
            is_changed = is_changed or force[i] != old_force[i]
            is_changed = is_changed or torque[i] != old_torque[i]
            is_zero = is_zero and force[i] == 0.0 and torque[i] == 0.0
            was_zero = was_zero and good_force[i] == 0.0
            is_near = (
                is_near and abs(force[i] - good_force[i]) <= _MAX_FORCE_STEP * reach
            )
            is_near = (
                is_near and abs(torque[i] - good_torque[i]) <= _MAX_TORQUE_STEP * reach
            )
            old_force[i], old_torque[i] = force[i], torque[i]
        is_silent = is_zero and not was_zero
        is_well[foot] = _count(
            health, sensor, is_number, is_changed, is_silent, is_near, is_first
        )
        if is_well[foot]:
            good_force[:] = force
            good_torque[:] = torque
    for foot in range(2):
        if not is_well[foot] and is_well[1 - foot]:
            # The shank presses the foot down: a load is a negative force along z.
            left = health["weight"] + healthy["foot_forces"][1 - foot][2]
            load_wrench(
                healthy["foot_forces"][foot],
                healthy["foot_torques"][foot],
                min(max(left, 0.0), health["weight"]),
                health["weight"],
            )
