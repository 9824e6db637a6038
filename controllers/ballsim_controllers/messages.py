"""Messages that cross the seam between the robot's computer and the world.

Frames
------
*World* of the robot: the floor, z up, origin under the ball's centre at the
start, x along the robot's heading at the start. The robot knows no other
world: neither its true heading nor its true place can be observed from its
sensors. *Trunk*: x forward, y left, z up. *Ball*: fixed in the ball, equal to
the world at the start.

Records
-------
The messages of every tick are frozen dataclasses over one NumPy record: the
compiled kernels read and write its fields by name, and a log keeps it as a row.
"""

from __future__ import annotations

import enum
import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, Self, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt

from ballsim_controllers.commands import Command
from ballsim_controllers.robot import RobotDescription
from ballsim_controllers.sensor_figures import SensorFigures

__all__ = [
    "ESTIMATE",
    "Array",
    "ArrayField",
    "BallParameters",
    "Command",
    "Controller",
    "ControllerSetup",
    "GaitPhase",
    "IntArray",
    "JointTargets",
    "Message",
    "Record",
    "SensorReading",
    "StateEstimate",
    "Telemetry",
    "make_record",
    "reading_dtype",
    "telemetry_dtype",
]

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int_]
#: Array of NumPy records or one of them; NumPy's types know nothing of fields.
Record: TypeAlias = Any

_F8, _I4 = np.float64, np.int32

#: Fields of a `StateEstimate`.
ESTIMATE = np.dtype(
    [
        ("time", _F8),
        ("quaternion_trunk_to_world", _F8, 4),
        ("angular_velocity_trunk_in_trunk", _F8, 3),
        ("position_trunk_in_world", _F8, 3),
        ("linear_velocity_trunk_in_world", _F8, 3),
        ("position_com_in_world", _F8, 3),
        ("linear_velocity_com_in_world", _F8, 3),
        ("position_ball_in_world", _F8, 3),
        ("linear_velocity_ball_in_world", _F8, 3),
        ("angular_velocity_ball_in_world", _F8, 3),
        ("contacts_in_world", _F8, (2, 3)),
        ("normal_forces", _F8, 2),
        ("cop_in_world", _F8, 2),
    ]
)


@functools.cache
def reading_dtype(n_joints: int) -> np.dtype[np.void]:
    """Return the fields of a `SensorReading` of a robot with some joints."""
    return np.dtype(
        [
            ("time", _F8),
            ("joint_positions", _F8, n_joints),
            ("joint_velocities", _F8, n_joints),
            ("angular_velocity_imu", _F8, 3),
            ("acceleration_imu", _F8, 3),
            ("foot_forces", _F8, (2, 3)),
            ("foot_torques", _F8, (2, 3)),
            ("angular_velocity_ball", _F8, 3),
        ]
    )


@functools.cache
def telemetry_dtype(n_joints: int) -> np.dtype[np.void]:
    """Return the fields of a `Telemetry` of a robot with some joints."""
    return np.dtype(
        [
            ("estimate", ESTIMATE),
            ("phase", _I4),
            ("step_count", _I4),
            ("ill_sensors", _I4),
            ("ideal_cop", _F8, 2),
            ("commanded_cop", _F8, 2),
            ("target_com", _F8, 3),
            ("target_soles", _F8, (2, 3)),
            ("landings", _F8, (2, 2)),
            ("reference_ball_angle", _F8),
            ("joint_torques", _F8, n_joints),
        ]
    )


class GaitPhase(enum.IntEnum):
    """Which feet carry the robot, as commanded by the footstep planner."""

    STAND = 0
    DOUBLE = 1
    LEFT_SUPPORT = 2
    RIGHT_SUPPORT = 3


@dataclass(frozen=True, slots=True)
class BallParameters:
    """What the controller is told about the ball.

    Attributes:
        radius: Radius r0, [m].
        mass: Mass m0, [kg].
        inertia: Moment of inertia I0 about any axis through the centre, [kg m^2].
    """

    radius: float
    mass: float
    inertia: float


class ArrayField:
    """Attribute of a message: the array of the same name in its record.

    It is a view; messages are made afresh for each tick, so it stays as it is.
    """

    def __init__(self) -> None:
        self._name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, message: Any, owner: type) -> Array:
        array: Array = message.record[self._name][0]
        return array


def make_record(dtype: np.dtype[np.void], values: Mapping[str, Any]) -> Record:
    """Return a record with values by the names of its fields; all are needed.

    Args:
        dtype: Its fields.
        values: Their values.

    Raises:
        TypeError: A field is missing or unknown.
    """
    record: Record = np.empty(1, dtype)
    assert dtype.names is not None
    if set(values) != set(dtype.names):
        names = ", ".join(sorted(set(values) ^ set(dtype.names)))
        raise TypeError(f"fields that are missing or unknown: {names}")
    for name, value in values.items():
        record[name][0] = value
    return record


@dataclass(frozen=True, slots=True)
class Message:
    """A message over a record.

    Attributes:
        record: Its fields, shape (1,).
    """

    record: Record

    @property
    def time(self) -> float:
        """Return the time that the message speaks of, [s]."""
        return float(self.record["time"][0])

    def changed(self, **changes: Any) -> Self:
        """Return a copy with other values of some fields, by name."""
        record = self.record.copy()
        for name, value in changes.items():
            record[name][0] = value
        return type(self)(record)


@dataclass(frozen=True, slots=True)
class SensorReading(Message):
    """One sample of every sensor, all of the same instant.

    Foot arrays have the left foot in row 0 and the right foot in row 1.

    Attributes:
        record: All of the below, shape (1,), dtype of `reading_dtype`.
        time: Time of the sample, [s].
        joint_positions: Encoder readings in actuator order, shape (n,), [rad].
        joint_velocities: Velocities that the drives derive from the encoders,
            shape (n,), [rad/s].
        angular_velocity_imu: Gyro on the trunk, in the IMU frame, shape (3,),
            [rad/s].
        acceleration_imu: Accelerometer on the trunk (specific force: +g upwards
            at rest), in the IMU frame, shape (3,), [m/s^2].
        foot_forces: Force that the shank exerts on the foot through the ankle
            sensor, in the sensor frame, shape (2, 3), [N].
        foot_torques: Torque of the same wrench about the sensor's origin, in
            the sensor frame, shape (2, 3), [N m].
        angular_velocity_ball: Gyro in the ball, in the ball's own rotating
            frame, shape (3,), [rad/s].
    """

    joint_positions = ArrayField()
    joint_velocities = ArrayField()
    angular_velocity_imu = ArrayField()
    acceleration_imu = ArrayField()
    foot_forces = ArrayField()
    foot_torques = ArrayField()
    angular_velocity_ball = ArrayField()

    @classmethod
    def of(cls, **values: Any) -> SensorReading:
        """Return a reading from the values of all fields by name."""
        n_joints = len(values["joint_positions"])
        return cls(make_record(reading_dtype(n_joints), values))


@dataclass(frozen=True, slots=True)
class JointTargets:
    """What the controller sends to the joint drives.

    Attributes:
        positions: Position set-points in actuator order, shape (n,), [rad].
            A drive applies ``kp (set-point - position) - kv velocity``.
    """

    positions: Array


@dataclass(frozen=True, slots=True)
class StateEstimate(Message):
    """The state as the robot believes it, in its own world frame.

    Attributes:
        record: All of the below, shape (1,), dtype `ESTIMATE`.
        time: Time of the estimate, [s].
        quaternion_trunk_to_world: Attitude of the trunk, (w, x, y, z).
        angular_velocity_trunk_in_trunk: Shape (3,), [rad/s].
        position_trunk_in_world: Origin of the trunk, shape (3,), [m].
        linear_velocity_trunk_in_world: Shape (3,), [m/s].
        position_com_in_world: Robot's centre of mass, shape (3,), [m].
        linear_velocity_com_in_world: Shape (3,), [m/s].
        position_ball_in_world: Ball's centre, shape (3,), [m].
        linear_velocity_ball_in_world: Shape (3,), [m/s].
        angular_velocity_ball_in_world: Shape (3,), [rad/s].
        contacts_in_world: Contact point of each foot with the ball (left,
            right), shape (2, 3), [m]; the sole's point nearest to the ball
            where the foot carries nothing.
        normal_forces: Force of the ball on each foot along the sole's normal,
            shape (2,), [N].
        cop_in_world: Measured CoP, shape (2,), [m].
    """

    quaternion_trunk_to_world = ArrayField()
    angular_velocity_trunk_in_trunk = ArrayField()
    position_trunk_in_world = ArrayField()
    linear_velocity_trunk_in_world = ArrayField()
    position_com_in_world = ArrayField()
    linear_velocity_com_in_world = ArrayField()
    position_ball_in_world = ArrayField()
    linear_velocity_ball_in_world = ArrayField()
    angular_velocity_ball_in_world = ArrayField()
    contacts_in_world = ArrayField()
    normal_forces = ArrayField()
    cop_in_world = ArrayField()

    @classmethod
    def of(cls, **values: Any) -> StateEstimate:
        """Return an estimate from the values of all fields by name."""
        return cls(make_record(ESTIMATE, values))


@dataclass(frozen=True, slots=True)
class Telemetry(Message):
    """What the controller reports about itself at each tick, for the log.

    Attributes:
        record: All of the below, shape (1,), dtype of `telemetry_dtype`.
        estimate: State estimate that this tick acted on.
        phase: Gait phase.
        step_count: Touchdowns so far.
        ill_sensors: Bits of the sensors whose readings were not used.
        ideal_cop: CoP that the balance controller wants, shape (2,), [m].
        commanded_cop: CoP that the feet are asked for: within the soles, ahead of its
            lag and against its error, shape (2,), [m].
        target_com: CoM target of the whole-body layer, shape (3,), [m].
        target_soles: Sole centre targets (left, right), shape (2, 3), [m].
        landings: Where the plan wants each foot to land next (left, right), from
            where the ball's centre will be then, shape (2, 2), [m]; NaN for a foot
            that stays, or that the plan does not look ahead to.
        reference_ball_angle: Shaped reference theta_1^r, [rad].
        joint_torques: Feed-forward joint torques, shape (n,), [N m].
    """

    @property
    def time(self) -> float:
        """Return the time of the tick, [s]."""
        return self.estimate.time

    ideal_cop = ArrayField()
    commanded_cop = ArrayField()
    target_com = ArrayField()
    target_soles = ArrayField()
    landings = ArrayField()
    joint_torques = ArrayField()

    @classmethod
    def of(cls, **values: Any) -> Telemetry:
        """Return a report from the values of all fields by name."""
        values["estimate"] = values["estimate"].record[0]
        values.setdefault("ill_sensors", 0)
        values.setdefault("landings", np.full((2, 2), np.nan))
        return cls(make_record(telemetry_dtype(len(values["joint_torques"])), values))

    @property
    def estimate(self) -> StateEstimate:
        """Return the state estimate that the tick acted on."""
        return StateEstimate(self.record["estimate"])

    @property
    def phase(self) -> GaitPhase:
        """Return the gait phase."""
        return GaitPhase(int(self.record["phase"][0]))

    @property
    def step_count(self) -> int:
        """Return the number of touchdowns so far."""
        return int(self.record["step_count"][0])

    @property
    def reference_ball_angle(self) -> float:
        """Return the shaped reference theta_1^r, [rad]."""
        return float(self.record["reference_ball_angle"][0])


@dataclass(frozen=True, slots=True)
class ControllerSetup:
    """Everything a controller is built from.

    Attributes:
        robot: Description of the robot.
        ball: Parameters of the ball.
        control_period: Time between two calls of ``step``, [s].
        settings: The ``[controller]`` table of the configuration, without the
            name: values that replace those of the controller's preset.
        sensors: What the data sheets of the sensors say.
    """

    robot: RobotDescription
    ball: BallParameters
    control_period: float
    settings: Mapping[str, Any] = field(default_factory=dict)
    sensors: SensorFigures = field(default_factory=SensorFigures)


@runtime_checkable
class Controller(Protocol):
    """What a controller must offer: the same calls in simulation and on a robot."""

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        """Return the joint targets that answer one sensor reading."""
        ...

    @property
    def telemetry(self) -> Telemetry | None:
        """Return what the last ``step`` did, or None before the first."""
        ...
