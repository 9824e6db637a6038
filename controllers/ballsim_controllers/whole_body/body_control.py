"""Whole-body layer: CoP and foot references to joint position targets.

Two roads lead to the joints and are added in the position set-point: mink's
inverse kinematics gives where the joints shall be, the force distribution the
torque that the contact forces need,

    set-point = q_ik + (tau + kv q'_ik) / kp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.footsteps.swing import SwingReference
from ballsim_controllers.geometry import (
    cross,
    rotation_from_vector,
    rotation_vector_between,
    sole_rotation_on_ball,
)
from ballsim_controllers.messages import Array, StateEstimate
from ballsim_controllers.robot_model import FootKinematics, RobotModel
from ballsim_controllers.settings import ForceSettings
from ballsim_controllers.whole_body.forces import (
    ContactForces,
    ForceDistribution,
    ForceLimits,
    WholeBodyAccelerations,
)
from ballsim_controllers.whole_body.inverse_kinematics import (
    InverseKinematics,
    PostureTargets,
    TaskCosts,
)

__all__ = ["BodyCommand", "BodyControl", "BodyResult"]


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
        self._settings = settings
        self._radius = ball_radius
        self._ik_period = ik_period
        self._forces = ForceDistribution(
            robot_model,
            ForceLimits(
                cop_half_length=settings.cop_half_length_m,
                cop_half_width=settings.cop_half_width_m,
                minimal_share=settings.minimal_share,
                pitch_compliance=settings.pitch_compliance,
                roll_compliance=settings.roll_compliance,
            ),
        )
        self._ik = InverseKinematics(robot_model, TaskCosts(), ik_period)
        self._ik_velocity = np.zeros(robot_model.joint_count)
        self._ik_positions = robot_model.nominal_posture.copy()
        self._since_ik = np.inf
        upper = robot_model.upper_dofs
        self._upper = upper
        self._nominal_upper = robot_model.nominal_posture[upper - 6]
        self._targets = (np.zeros(3), np.zeros((2, 3)))

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
        robot = self._robot
        robot.update_dynamics()
        loaded = self._loaded_feet(estimate, command.stance)
        contacts, shares = self._forces.place_contacts(
            command.cop, loaded, command.transfer
        )
        touching = self._touching_points(estimate, shares)
        wanted = self._accelerations(estimate, command, touching, contacts, shares)
        forces = self._forces.solve(wanted, touching, contacts, shares)
        self._since_ik += dt
        if self._since_ik > self._ik_period - 0.5 * dt:
            self._since_ik = 0.0
            self._solve_ik(estimate, wanted, forces)
        self._ik_positions = self._ik_positions + self._ik_velocity * dt
        limits = robot.torque_limits
        torques = np.clip(forces.joint_torques, -limits, limits)
        # The drives' damping is made up for, except at the ankles of standing
        # feet: there it is what keeps the sole from rocking on the ball.
        velocity = robot.data.qvel[6:].copy()
        for i in range(2):
            if shares[i] > 0.0:
                ankle = robot.leg_dofs[i][4:] - 6
                velocity[ankle] = self._ik_velocity[ankle]
        positions = self._ik_positions + (torques + robot.kv * velocity) / robot.kp
        return BodyResult(positions, forces, *self._targets)

    def _loaded_feet(
        self, estimate: StateEstimate, stance: tuple[bool, bool]
    ) -> tuple[bool, bool]:
        """Return which of the standing feet touch the ball.

        A foot that has bounced off carries nothing, whatever is commanded; it
        is led back to the ball first.
        """
        threshold = self._settings.contact_force_n
        left, right = (
            stands and float(force) > threshold
            for stands, force in zip(stance, estimate.normal_forces, strict=True)
        )
        return (left, right) if left or right else stance

    def _accelerations(
        self,
        estimate: StateEstimate,
        command: BodyCommand,
        touching: Array,
        contacts: Array,
        shares: Array,
    ) -> WholeBodyAccelerations:
        s, robot = self._settings, self._robot
        rotation = robot.data.xmat[robot.trunk_id].reshape(3, 3)
        omega = estimate.angular_velocity_trunk_in_trunk
        upright = rotation_from_vector(np.array([0.0, 0.0, command.heading]))
        error = rotation.T @ rotation_vector_between(rotation, upright)
        stiffness = np.array([s.trunk_stiffness, s.trunk_stiffness, s.yaw_stiffness])
        damping = np.array([s.trunk_damping, s.trunk_damping, s.yaw_damping])
        trunk = stiffness * error - damping * omega

        top = estimate.position_ball_in_world[2] + self._radius
        height_error = command.com_height + top - estimate.position_com_in_world[2]
        vertical = (
            s.height_stiffness * height_error
            - s.height_damping * estimate.linear_velocity_com_in_world[2]
        )
        limit = s.max_com_acceleration_m_s2
        vertical = float(min(max(vertical, -limit), limit))

        ball = estimate.position_ball_in_world
        floor = np.array([ball[0], ball[1], 0.0])
        ball_alpha = (
            np.array([-command.ball_acceleration[1], command.ball_acceleration[0], 0.0])
            / self._radius
        )
        ball_omega = estimate.angular_velocity_ball_in_world
        soles = np.zeros((2, 6))
        for i, foot in enumerate(robot.feet):
            if shares[i] > 0.0:
                point = touching[i]
                arm = point - foot.position
                velocity = foot.linear_velocity + cross(foot.angular_velocity, arm)
                slip = velocity - cross(ball_omega, point - floor)
                soles[i, :3] = ForceDistribution.contact_acceleration(
                    point, floor, ball_alpha, slip, s.slip_gain
                )
                soles[i, 3:] = -s.stance_rotation_damping * foot.angular_velocity
            elif command.stance[i]:
                soles[i] = self._return_to_ball(estimate, foot, ball_alpha)
            elif command.swing is not None:
                swing = command.swing
                soles[i, :3] = (
                    swing.linear_acceleration
                    + s.swing_stiffness * (swing.position - foot.position)
                    + s.swing_damping * (swing.linear_velocity - foot.linear_velocity)
                )
                soles[i, :2] += command.ball_acceleration
                soles[i, 3:] = (
                    s.swing_rotation_stiffness
                    * rotation_vector_between(foot.rotation, swing.rotation)
                    - s.swing_rotation_damping * foot.angular_velocity
                )
        upper = self._upper
        joints = robot.data.qpos[upper + 1]
        rates = robot.data.qvel[upper]
        posture = (
            s.posture_stiffness * (self._nominal_upper - joints)
            - s.posture_damping * rates
        )
        cop = shares @ contacts
        lever = estimate.position_com_in_world - cop
        push = robot.mass * (robot.gravity + vertical) * lever[:2] / lever[2]
        return WholeBodyAccelerations(trunk, vertical, push, soles, posture)

    def _return_to_ball(
        self, estimate: StateEstimate, foot: FootKinematics, ball_alpha: Array
    ) -> Array:
        """Return the acceleration of a sole that should stand but does not touch."""
        s = self._settings
        ball = estimate.position_ball_in_world
        normal = foot.position - ball
        distance = float(np.sqrt(normal @ normal))
        normal /= distance
        floor = np.array([ball[0], ball[1], 0.0])
        surface = cross(estimate.angular_velocity_ball_in_world, foot.position - floor)
        wanted = surface - s.landing_speed_m_s * normal
        heading = np.arctan2(foot.rotation[1, 0], foot.rotation[0, 0])
        tangent = sole_rotation_on_ball(normal, heading)
        gap = max(distance - self._radius, 0.0)
        linear = (
            cross(ball_alpha, foot.position - floor)
            + s.swing_damping * (wanted - foot.linear_velocity)
            - s.swing_stiffness * gap * normal
        )
        angular = (
            s.swing_rotation_stiffness * rotation_vector_between(foot.rotation, tangent)
            - s.swing_rotation_damping * foot.angular_velocity
        )
        return np.concatenate((linear, angular))

    def _touching_points(self, estimate: StateEstimate, shares: Array) -> Array:
        """Return where each sole is nearest to the ball, shape (2, 3), [m]."""
        points = np.empty((2, 3))
        ball = estimate.position_ball_in_world
        for i, foot in enumerate(self._robot.feet):
            points[i] = foot.position
            if shares[i] > 0.0:
                offset = foot.rotation.T @ (ball - foot.position)
                points[i] += foot.rotation[:, :2] @ offset[:2]
        return points

    def _solve_ik(
        self,
        estimate: StateEstimate,
        wanted: WholeBodyAccelerations,
        forces: ContactForces,
    ) -> None:
        """Aim mink at where CoM, soles and trunk will be after one IK period.

        Each target is the present motion carried on with the acceleration that
        the force distribution was given, so that the two roads to the joints
        agree; only a loaded sole is aimed at the place where, rolling without
        slip, it meets the ball at the commanded contact.
        """
        robot, horizon = self._robot, self._ik_period
        half = 0.5 * horizon**2
        com_acceleration = forces.forces.sum(axis=0) / robot.mass
        com_acceleration[2] -= robot.gravity
        com = (
            estimate.position_com_in_world
            + horizon * estimate.linear_velocity_com_in_world
            + half * com_acceleration
        )
        ball = estimate.position_ball_in_world
        ball_velocity = estimate.linear_velocity_ball_in_world
        centre = ball + horizon * ball_velocity
        positions = np.empty((2, 3))
        rotations = np.empty((2, 3, 3))
        for i, foot in enumerate(robot.feet):
            if forces.shares[i] == 0.0:
                linear, angular = wanted.soles[i, :3], wanted.soles[i, 3:]
                positions[i] = (
                    foot.position + horizon * foot.linear_velocity + half * linear
                )
                turn = horizon * foot.angular_velocity + half * angular
                rotations[i] = rotation_from_vector(turn) @ foot.rotation
                continue
            contact = forces.contacts[i]
            offset = foot.rotation.T @ (contact - foot.position)
            spin = cross(estimate.angular_velocity_ball_in_world, contact - ball)
            surface = contact + horizon * (ball_velocity + spin)
            normal = surface - centre
            normal /= np.sqrt(normal @ normal)
            heading = np.arctan2(foot.rotation[1, 0], foot.rotation[0, 0])
            rotations[i] = sole_rotation_on_ball(normal, heading)
            positions[i] = centre + self._radius * normal - rotations[i] @ offset
        rotation = robot.data.xmat[robot.trunk_id].reshape(3, 3)
        turn = (
            horizon * estimate.angular_velocity_trunk_in_trunk
            + half * forces.trunk_angular
        )
        trunk = rotation @ rotation_from_vector(turn)
        targets = PostureTargets(com, positions, rotations, trunk)
        qpos = robot.data.qpos
        self._ik_velocity = self._ik.solve(qpos, targets)
        self._ik_positions = qpos[7:].copy()
        self._targets = (com, positions)
