"""Whole-body layer: CoP and foot references to joint position targets.

Two roads lead to the joints and are added in the position set-point: mink's
inverse kinematics gives where the joints shall be, the force distribution the
torque that the contact forces need,

    set-point = q_ik + (tau + kv q'_ik) / kp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.footsteps.swing import SWING, SwingReference
from ballsim_controllers.messages import Array, Record, StateEstimate
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.settings import ForceSettings
from ballsim_controllers.whole_body.accelerations import make_gains
from ballsim_controllers.whole_body.force_control import find_forces
from ballsim_controllers.whole_body.forces import (
    ContactForces,
    ForceDistribution,
    ForceLimits,
    body_dtype,
)
from ballsim_controllers.whole_body.inverse_kinematics import (
    InverseKinematics,
    PostureTargets,
    TaskCosts,
)
from ballsim_controllers.whole_body.leg_motion import N_BASE
from ballsim_controllers.whole_body.motion_targets import predict_motion
from ballsim_controllers.whole_body.set_points import write_set_points

__all__ = ["BodyCommand", "BodyControl", "BodyResult"]

_NO_SWING = SwingReference(np.zeros(1, SWING))


@dataclass(frozen=True, slots=True)
class BodyCommand:
    """What the planner asks of the body at one tick.

    Attributes:
        cop: Commanded CoP, shape (2,), [m].
        stance: Which feet stand (left, right).
        transfer: How far each contact goes from its sole's centre to the CoP.
        swing: Reference of the swinging sole, None where both stand.
        com_height: Height of the CoM over the ball's top, [m].
        heading: Direction of the trunk about the vertical, [rad].
        ball_acceleration: Predicted acceleration of the ball's centre, (2,),
            [m/s^2].
    """

    cop: Array
    stance: tuple[bool, bool]
    transfer: tuple[float, float]
    swing: SwingReference | None
    com_height: float
    heading: float
    ball_acceleration: Array


@dataclass(frozen=True, slots=True)
class BodyResult:
    """Joint set-points and what led to them."""

    positions: Array
    forces: ContactForces
    target_com: Array
    target_soles: Array


class BodyControl:
    """Joint position set-points from CoP, stance and swing.

    Args:
        robot_model: The robot, updated with the present estimate.
        settings: Gains.
        ball_radius: Radius of the ball, [m].
        ik_period: How often the inverse kinematics is solved, [s].
    """

    def __init__(
        self,
        robot_model: RobotModel,
        settings: ForceSettings,
        ball_radius: float,
        ik_period: float,
    ) -> None:
        """Build force distribution and inverse kinematics."""
        self._robot = robot_model
        self._radius = ball_radius
        self._ik_period = ik_period
        #: Of the record that `find_forces` writes.
        self.body_dtype = body_dtype(robot_model.joint_count)
        forces = ForceDistribution(
            robot_model,
            ForceLimits(
                cop_half_length=settings.cop_half_length_m,
                cop_half_width=settings.cop_half_width_m,
                minimal_share=settings.minimal_share,
                pitch_compliance=settings.pitch_compliance,
                roll_compliance=settings.roll_compliance,
            ),
        )
        #: What `find_forces` takes behind the swing foot's reference.
        self.arguments: tuple[Record, Record, Record, float] = (
            robot_model.record,
            make_gains(settings),
            forces.limits,
            ball_radius,
        )
        self._ik = InverseKinematics(robot_model, TaskCosts(), ik_period)
        #: Velocity and posture of the inverse kinematics, as they go on.
        self.ik_velocity = np.zeros(robot_model.joint_count)
        self.ik_positions = robot_model.nominal_posture.copy()
        self._since_ik = np.inf
        #: Last targets of the inverse kinematics: CoM, (3,), and soles, (2, 3), [m].
        self.targets = (np.zeros(3), np.zeros((2, 3)))

    def step(
        self, estimate: StateEstimate, command: BodyCommand, dt: float
    ) -> BodyResult:
        """Return the joint set-points of one tick.

        Args:
            estimate: State that the robot model was updated with.
            command: What the planner asks.
            dt: Control period, [s].

        Returns:
            Set-points, contact forces and targets.
        """
        bodies: Record = np.zeros(1, self.body_dtype)
        swing = _NO_SWING if command.swing is None else command.swing
        find_forces(
            bodies,
            estimate.record,
            swing.record,
            *self.arguments,
            command.cop,
            *command.stance,
            *command.transfer,
            command.com_height,
            command.heading,
            command.ball_acceleration,
        )
        if self.is_ik_due(dt):
            self.solve_ik(estimate.record, bodies)
        positions = np.empty(len(self.ik_positions))
        write_set_points(
            positions,
            self.ik_positions,
            self.ik_velocity,
            dt,
            bodies,
            self._robot.record,
        )
        return BodyResult(positions, ContactForces(bodies), *self.targets)

    def is_ik_due(self, dt: float) -> bool:
        """Return whether an IK period is over with this tick, [s]."""
        self._since_ik += dt
        if self._since_ik <= self._ik_period - 0.5 * dt:
            return False
        self._since_ik = 0.0
        return True

    def solve_ik(self, estimates: Record, bodies: Record) -> None:
        """Aim mink at where CoM, soles and trunk will be after one IK period.

        Args:
            estimates: State that the robot model was updated with, shape (1,).
            bodies: What `find_forces` wrote, shape (1,).
        """
        com, positions, rotations, trunk = predict_motion(
            estimates, self._robot.record, bodies, self._radius, self._ik_period
        )
        targets = PostureTargets(com, positions, rotations, trunk)
        self.ik_velocity = self._ik.solve(self._robot.qpos, targets).copy()
        # A swinging leg's set-points gain speed by its acceleration tick after tick:
        # they begin with that of now, not with the mean over the period.
        half, body = 0.5 * self._ik_period, bodies[0]
        for share, dofs in zip(body["shares"], self._robot.leg_dofs, strict=True):
            if share == 0.0:
                self.ik_velocity[dofs - N_BASE] -= half * body["accelerations"][dofs]
        self.ik_positions = self._robot.qpos[7:].copy()
        self.targets = (com, positions)
