"""Whole-body layer: CoP and foot references to joint position targets.

Two roads lead to the joints and are added in the position set-point: mink's
inverse kinematics gives where the joints shall be, the force distribution the
torque that the contact forces need,

    set-point = q_ik + (tau + kv q'_ik) / kp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.swing import SWING, SwingReference
from ballsim_controllers.messages import Array, IntArray, StateEstimate
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.settings import ForceSettings
from ballsim_controllers.whole_body.accelerations import (
    WholeBodyAccelerations,
    find_touching_points,
    make_gains,
    wanted_accelerations,
)
from ballsim_controllers.whole_body.forces import (
    ContactForces,
    ForceDistribution,
    ForceLimits,
)
from ballsim_controllers.whole_body.inverse_kinematics import (
    InverseKinematics,
    PostureTargets,
    TaskCosts,
)
from ballsim_controllers.whole_body.motion_targets import predict_motion

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
        self._robot = robot = robot_model
        self._contact_force = settings.contact_force_n
        self._ik_period = ik_period
        self._forces = ForceDistribution(
            robot,
            ForceLimits(
                cop_half_length=settings.cop_half_length_m,
                cop_half_width=settings.cop_half_width_m,
                minimal_share=settings.minimal_share,
                pitch_compliance=settings.pitch_compliance,
                roll_compliance=settings.roll_compliance,
            ),
        )
        self._ik = InverseKinematics(robot, TaskCosts(), ik_period)
        self._ik_velocity = np.zeros(robot.joint_count)
        self._ik_positions = robot.nominal_posture.copy()
        self._since_ik = np.inf
        self._targets = (np.zeros(3), np.zeros((2, 3)))
        trunk = robot.data.xmat[robot.trunk_id].reshape(3, 3)
        self._gains = make_gains(settings)
        upper = robot.upper_dofs
        self._physics = (robot.feet_record, ball_radius, robot.mass, robot.gravity)
        self._posture = (
            trunk,
            robot.qpos,
            robot.qvel,
            upper,
            robot.nominal_posture[upper - 6],
        )
        self._trunk = trunk
        self._drives = (
            robot.qvel,
            robot.kp,
            robot.kv,
            robot.torque_limits,
            np.array(robot.leg_dofs),
        )

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
        touching = find_touching_points(
            robot.feet_record, estimate.position_ball_in_world, shares
        )
        swing = _NO_SWING if command.swing is None else command.swing
        wanted = WholeBodyAccelerations(
            *wanted_accelerations(
                self._gains,
                estimate.record,
                *self._physics,
                *self._posture,
                command.com_height,
                command.heading,
                command.ball_acceleration,
                command.stance,
                swing.record,
                touching,
                contacts,
                shares,
            )
        )
        forces = self._forces.solve(wanted, touching, contacts, shares)
        self._since_ik += dt
        if self._since_ik > self._ik_period - 0.5 * dt:
            self._since_ik = 0.0
            self._solve_ik(estimate, wanted, forces)
        positions = _set_points(
            self._ik_positions,
            self._ik_velocity,
            dt,
            forces.joint_torques,
            shares,
            *self._drives,
        )
        return BodyResult(positions, forces, *self._targets)

    def _loaded_feet(
        self, estimate: StateEstimate, stance: tuple[bool, bool]
    ) -> tuple[bool, bool]:
        """Return which of the standing feet touch the ball.

        A foot that has bounced off carries nothing, whatever is commanded; it
        is led back to the ball first.
        """
        threshold = self._contact_force
        force_left, force_right = estimate.normal_forces.tolist()
        left = stance[0] and force_left > threshold
        right = stance[1] and force_right > threshold
        return (left, right) if left or right else stance

    def _solve_ik(
        self,
        estimate: StateEstimate,
        wanted: WholeBodyAccelerations,
        forces: ContactForces,
    ) -> None:
        """Aim mink at where CoM, soles and trunk will be after one IK period."""
        com, positions, rotations, trunk = predict_motion(
            estimate.record,
            *self._physics,
            self._ik_period,
            self._trunk,
            wanted.soles,
            forces.trunk_angular,
            forces.forces,
            forces.contacts,
            forces.shares,
        )
        targets = PostureTargets(com, positions, rotations, trunk)
        self._ik_velocity = self._ik.solve(self._robot.qpos, targets)
        self._ik_positions = self._robot.qpos[7:].copy()
        self._targets = (com, positions)


@compiled
def _set_points(
    ik_positions: Array,
    ik_velocity: Array,
    dt: float,
    torques: Array,
    shares: Array,
    qvel: Array,
    kp: Array,
    kv: Array,
    torque_limits: Array,
    legs: IntArray,
) -> Array:
    """Move the IK's posture on by one tick (in place); return the set-points.

    The drives' damping is made up for, except at the ankles of standing
    feet: there it is what keeps the sole from rocking on the ball.
    """
    n = len(ik_positions)
    velocity = qvel[6:].copy()
    for foot in range(2):
        if shares[foot] > 0.0:
            for ankle in legs[foot, 4:]:
                velocity[ankle - 6] = ik_velocity[ankle - 6]
    result = np.empty(n)
    for i in range(n):
        ik_positions[i] += ik_velocity[i] * dt
        torque = min(max(torques[i], -torque_limits[i]), torque_limits[i])
        result[i] = ik_positions[i] + (torque + kv[i] * velocity[i]) / kp[i]
    return result
