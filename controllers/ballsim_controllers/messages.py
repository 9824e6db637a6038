"""Messages that cross the seam between the robot's computer and the world.

Frames
------
*World* of the robot: the floor, z up, origin under the ball's centre at the
start, x along the robot's heading at the start. The robot knows no other
world: neither its true heading nor its true place can be observed from its
sensors. *Trunk*: x forward, y left, z up. *Ball*: fixed in the ball, equal to
the world at the start.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from ballsim_controllers.robot import RobotDescription

__all__ = [
    "Array",
    "BallParameters",
    "Command",
    "Controller",
    "ControllerSetup",
    "GaitPhase",
    "JointTargets",
    "SensorReading",
    "StateEstimate",
    "Telemetry",
]

Array = npt.NDArray[np.float64]


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


@dataclass(frozen=True, slots=True)
class SensorReading:
    """One sample of every sensor, all of the same instant.

    Foot arrays have the left foot in row 0 and the right foot in row 1.

    Attributes:
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

    time: float
    joint_positions: Array
    joint_velocities: Array
    angular_velocity_imu: Array
    acceleration_imu: Array
    foot_forces: Array
    foot_torques: Array
    angular_velocity_ball: Array


@dataclass(frozen=True, slots=True)
class Command:
    """What the operator asks of the robot at this instant.

    Attributes:
        target_ball_angle: Roll angle theta_1 that the ball shall reach along
            the robot's initial heading, [rad]. The controller shapes the way
            there (speed and acceleration limits).
        is_stepping: True to step even where balance alone would not need it.
    """

    target_ball_angle: float = 0.0
    is_stepping: bool = False


@dataclass(frozen=True, slots=True)
class JointTargets:
    """What the controller sends to the joint drives.

    Attributes:
        positions: Position set-points in actuator order, shape (n,), [rad].
            A drive applies ``kp (set-point - position) - kv velocity``.
    """

    positions: Array


@dataclass(frozen=True, slots=True)
class StateEstimate:
    """The state as the robot believes it, in its own world frame.

    Attributes:
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

    time: float
    quaternion_trunk_to_world: Array
    angular_velocity_trunk_in_trunk: Array
    position_trunk_in_world: Array
    linear_velocity_trunk_in_world: Array
    position_com_in_world: Array
    linear_velocity_com_in_world: Array
    position_ball_in_world: Array
    linear_velocity_ball_in_world: Array
    angular_velocity_ball_in_world: Array
    contacts_in_world: Array
    normal_forces: Array
    cop_in_world: Array


@dataclass(frozen=True, slots=True)
class Telemetry:
    """What the controller reports about itself at each tick, for the log.

    Attributes:
        estimate: State estimate that this tick acted on.
        phase: Gait phase.
        step_count: Touchdowns so far.
        ideal_cop: CoP that the balance controller wants, shape (2,), [m].
        commanded_cop: CoP after the soles' limits, shape (2,), [m].
        target_com: CoM target of the whole-body layer, shape (3,), [m].
        target_soles: Sole centre targets (left, right), shape (2, 3), [m].
        reference_ball_angle: Shaped reference theta_1^r, [rad].
        joint_torques: Feed-forward joint torques, shape (n,), [N m].
    """

    estimate: StateEstimate
    phase: GaitPhase
    step_count: int
    ideal_cop: Array
    commanded_cop: Array
    target_com: Array
    target_soles: Array
    reference_ball_angle: float
    joint_torques: Array


@dataclass(frozen=True, slots=True)
class ControllerSetup:
    """Everything a controller is built from.

    Attributes:
        robot: Description of the robot.
        ball: Parameters of the ball.
        control_period: Time between two calls of ``step``, [s].
        settings: The ``[controller]`` table of the configuration, without the
            name: values that replace those of the controller's preset.
    """

    robot: RobotDescription
    ball: BallParameters
    control_period: float
    settings: Mapping[str, Any] = field(default_factory=dict)


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
