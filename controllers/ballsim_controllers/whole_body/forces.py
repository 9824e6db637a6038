"""Contact forces and joint torques that realise a commanded CoP.

The chain from the CoP to the joint torques, in closed form:

1. Every joint acceleration is written as an affine function of the base's
   acceleration: a stance leg keeps its contact point on the ball, the swing leg
   follows its foot, the upper body holds its posture.
2. The trunk's angular acceleration and the vertical acceleration of the CoM are
   chosen; the horizontal acceleration follows from "no horizontal moment about
   the CoP", the definition of the CoP.
3. The resulting net wrench is shared between the standing feet, and the joint
   torques follow from the equations of motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.geometry import cross, skew
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel

__all__ = ["ForceDistribution", "ForceLimits", "WholeBodyAccelerations"]


@dataclass(frozen=True, slots=True)
class ForceLimits:
    """What the contacts can transmit.

    Attributes:
        cop_half_length: Usable half length of a sole, [m].
        cop_half_width: Usable half width of a sole, [m].
        torsion_arm: Torsional moment over normal force of one contact, [m].
        couple_friction: Largest horizontal force, over the smaller of the two
            normal forces, that may be spent on a yaw couple.
        minimal_share: Smallest share of the load on a standing foot.
        pitch_compliance: Price of a deviation of the CoM's sagittal acceleration
            over that of the trunk's angular acceleration, [rad^2/m^2].
        roll_compliance: The same for the lateral acceleration.
    """

    cop_half_length: float
    cop_half_width: float
    torsion_arm: float = 0.012
    couple_friction: float = 0.3
    minimal_share: float = 0.08
    pitch_compliance: float = 1500.0
    roll_compliance: float = 300.0


@dataclass(frozen=True, slots=True)
class WholeBodyAccelerations:
    """What the body shall do at this instant.

    Attributes:
        trunk_angular: Angular acceleration of the trunk, in the trunk, (3,),
            [rad/s^2].
        com_vertical: Vertical acceleration of the CoM, [m/s^2].
        horizontal_force: Contact force of the inverted pendulum, (2,), [N].
        soles: Linear and angular acceleration in the world of each foot: at the
            contact point for a standing foot, at the sole's centre for a swing
            foot, shape (2, 6), [m/s^2] and [rad/s^2].
        upper_joints: Accelerations of the joints that are not in the legs,
            [rad/s^2].
    """

    trunk_angular: Array
    com_vertical: float
    horizontal_force: Array
    soles: Array
    upper_joints: Array


@dataclass(frozen=True, slots=True)
class ContactForces:
    """Result of the distribution.

    Attributes:
        joint_torques: Shape (n,), [N m].
        joint_accelerations: Shape (n,), [rad/s^2].
        trunk_angular: Angular acceleration of the trunk, in the trunk, (3,),
            [rad/s^2].
        forces: Force of the ball on each foot, in the world, (2, 3), [N].
        contacts: Where each force acts, in the world, (2, 3), [m].
        shares: Share of the load per foot, shape (2,).
        cop: CoP that the contacts realise, shape (2,), [m].
    """

    joint_torques: Array
    joint_accelerations: Array
    trunk_angular: Array
    forces: Array
    contacts: Array
    shares: Array
    cop: Array


class ForceDistribution:
    """Closed-form force distribution for a biped with six joints per leg.

    Args:
        robot_model: The robot's dynamics; ``update`` and ``update_dynamics``
            must have been called before ``solve``.
        limits: What the contacts can transmit.
    """

    def __init__(self, robot_model: RobotModel, limits: ForceLimits) -> None:
        """Keep the model and the limits."""
        self._robot = robot_model
        self._limits = limits

    def place_contacts(
        self, cop: Array, stance: tuple[bool, bool], transfer: tuple[float, float]
    ) -> tuple[Array, Array]:
        """Choose contact points and load shares that give a CoP.

        Each contact goes from its sole's centre towards the CoP by the foot's
        transfer: 0 = the centre, 1 = as near to the CoP as the sole allows. A
        foot that is about to carry alone (or has just done so) has transfer 1,
        so that its contact need not jump when the other foot lifts off. The
        CoP is then projected on the line between the contacts; the rest moves
        both contacts alike, within the soles.

        Args:
            cop: Wanted CoP, shape (2,), [m].
            stance: Which feet stand (left, right); at least one.
            transfer: Transfer of each foot, 0 to 1.

        Returns:
            Contact points in the world, shape (2, 3), [m], and the share of the
            load of each foot, shape (2,).
        """
        feet = self._robot.feet
        minimum = self._limits.minimal_share
        offsets = [
            transfer[i] * self._clip_to_sole(i, cop - feet[i].position[:2])
            for i in range(2)
        ]
        contacts = np.array(
            [feet[i].position + self._on_sole(i, offsets[i]) for i in range(2)]
        )
        shares = np.array([float(stance[0]), float(stance[1])])
        if stance[0] and stance[1]:
            span = contacts[0, :2] - contacts[1, :2]
            length = max(float(span @ span), 1e-6)
            share = float(span @ (cop - contacts[1, :2])) / length
            share = min(max(share, minimum), 1.0 - minimum)
            shares[:] = (share, 1.0 - share)
        # What a sole's edge cuts off is lost: to make up for it with the other
        # foot would make that contact jump.
        shift = cop - shares @ contacts[:, :2]
        for i, foot in enumerate(feet):
            place = contacts[i, :2] + shift - foot.position[:2]
            contacts[i] = foot.position + self._on_sole(i, self._clip_to_sole(i, place))
        return contacts, shares

    def _clip_to_sole(self, foot: int, shift: Array) -> Array:
        """Return sole coordinates of a horizontal shift, within the usable sole."""
        limits = self._limits
        (a, b), (c, d) = self._robot.feet[foot].rotation[:2, :2].tolist()
        determinant = a * d - b * c
        x = (d * shift[0] - b * shift[1]) / determinant
        y = (a * shift[1] - c * shift[0]) / determinant
        length, width = limits.cop_half_length, limits.cop_half_width
        return np.array([min(max(x, -length), length), min(max(y, -width), width)])

    def _on_sole(self, foot: int, offset: Array) -> Array:
        """Return the world vector of an offset in sole coordinates."""
        vector: Array = self._robot.feet[foot].rotation[:, :2] @ offset
        return vector

    def solve(
        self,
        wanted: WholeBodyAccelerations,
        touching: Array,
        contacts: Array,
        shares: Array,
    ) -> ContactForces:
        """Return forces and joint torques that realise the accelerations.

        Args:
            wanted: Accelerations of trunk, CoM height, soles, upper body.
            touching: Where each sole meets the ball now, or its centre for a
                swing foot: the points that ``wanted.soles`` speaks of, (2, 3),
                [m].
            contacts: Where the forces shall act, shape (2, 3), [m].
            shares: Share of the load per foot, shape (2,); 0 = swings.

        Returns:
            Joint torques, accelerations and contact forces.
        """
        robot = self._robot
        mass_matrix, bias = robot.mass_matrix, robot.bias
        rotation_trunk = robot.data.xmat[robot.trunk_id].reshape(3, 3)
        base_position = robot.data.qpos[:3]

        # 1. qacc = basis @ base_acceleration + offset
        basis, offset, jacobians = self._affine_accelerations(wanted, touching)

        # 2. Net wrench about the base, world axes: a @ base_acceleration + c.
        momentum = mass_matrix[:6] @ basis
        constant = mass_matrix[:6] @ offset + bias[:6]
        momentum[3:] = rotation_trunk @ momentum[3:]
        constant[3:] = rotation_trunk @ constant[3:]
        cop3 = shares @ contacts
        to_cop = skew(cop3 - base_position)
        moment = momentum[3:] - to_cop @ momentum[:3]
        moment_constant = constant[3:] - to_cop @ constant[:3]
        # Rows: vertical force, horizontal moment about the CoP; then yaw moment.
        rows = np.vstack((momentum[2], moment))
        row_constant = np.concatenate((constant[2:3], moment_constant))
        force_vertical = robot.mass * (robot.gravity + wanted.com_vertical)
        target = np.array([force_vertical, 0.0, 0.0]) - row_constant[:3]
        base_acceleration = self._share_momentum(
            rows[:3], target, momentum[:2], constant[:2], wanted, rotation_trunk
        )
        # The trunk's yaw acceleration gives way where the feet cannot twist.
        direction = np.zeros(6)
        direction[3:] = rotation_trunk[2]
        direction[:3] = np.linalg.solve(rows[:3, :3], -rows[:3] @ direction)
        yaw = float(rows[3] @ base_acceleration + row_constant[3])
        yaw_limit = self._yaw_limit(contacts, shares, force_vertical)
        excess = yaw - min(max(yaw, -yaw_limit), yaw_limit)
        base_acceleration -= excess / float(rows[3] @ direction) * direction
        qacc = basis @ base_acceleration + offset
        force = momentum[:3] @ base_acceleration + constant[:3]

        # 3. Share, twist, torques.
        forces = shares[:, None] * force
        self._squeeze(contacts, shares, forces)
        twist = self._share_yaw(contacts, shares, forces, yaw - excess)
        torques = mass_matrix[6:] @ qacc + bias[6:]
        for i in range(2):
            if shares[i] > 0.0:
                wrench = np.concatenate((forces[i], (0.0, 0.0, twist[i])))
                wrench[3:] += cross(contacts[i] - touching[i], forces[i])
                torques -= jacobians[i][:, 6:].T @ wrench
        return ContactForces(
            torques, qacc[6:], qacc[3:6], forces, contacts, shares, cop3[:2]
        )

    def _affine_accelerations(
        self, wanted: WholeBodyAccelerations, touching: Array
    ) -> tuple[Array, Array, list[Array]]:
        """Return accelerations as an affine function of the base's.

        Returns:
            Basis, shape (nv, 6), and offset, shape (nv,), of the generalised
            acceleration, and the feet's Jacobians at the touching points.
        """
        robot = self._robot
        nv = robot.model.nv
        basis = np.zeros((nv, 6))
        basis[:6, :6] = np.eye(6)
        offset = np.zeros(nv)
        offset[robot.upper_dofs] = wanted.upper_joints
        jacobians = []
        for i in range(2):
            point = touching[i]
            jacobian = robot.point_jacobian(i, point)
            jacobians.append(jacobian)
            leg = robot.leg_dofs[i]
            rhs = np.empty((6, 7))
            rhs[:, :6] = -jacobian[:, :6]
            rhs[:, 6] = wanted.soles[i] - robot.point_bias_acceleration(i, point)
            solution = np.linalg.solve(jacobian[:, leg], rhs)
            basis[leg] = solution[:, :6]
            offset[leg] = solution[:, 6]
        return basis, offset, jacobians

    def _share_momentum(
        self,
        rows: Array,
        target: Array,
        momentum: Array,
        constant: Array,
        wanted: WholeBodyAccelerations,
        rotation_trunk: Array,
    ) -> Array:
        """Return the base's acceleration that meets the CoP exactly.

        What the swinging leg does to the angular momentum must be answered by
        the trunk (it leans) or by the horizontal force (the ball is kicked):
        least squares over both, about the wanted trunk acceleration and the
        force of the pendulum.
        """
        weight = np.array([self._limits.pitch_compliance, self._limits.roll_compliance])
        axes = rotation_trunk[:2]
        # Deviation of the trunk about the world's x and y: two unknowns.
        right = np.empty((3, 3))
        right[:, 0] = target - rows[:, 3:] @ wanted.trunk_angular
        right[:, 1:] = -rows[:, 3:] @ axes.T
        linear = np.linalg.solve(rows[:, :3], right)
        solution = np.zeros((6, 3))
        solution[:3] = linear
        solution[3:, 0] = wanted.trunk_angular
        solution[3:, 1:] = axes.T
        forces = momentum @ solution
        gap = wanted.horizontal_force - constant - forces[:, 0]
        effect = forces[:, 1:] / self._robot.mass
        pull = effect.T * weight
        lean = np.linalg.solve(np.eye(2) + pull @ effect, pull @ gap / self._robot.mass)
        acceleration: Array = solution[:, 0] + solution[:, 1:] @ lean
        return acceleration

    def _yaw_limit(
        self, contacts: Array, shares: Array, force_vertical: float
    ) -> float:
        limits = self._limits
        span = contacts[0, :2] - contacts[1, :2]
        couple = (
            limits.couple_friction * float(shares.min()) * float(np.sqrt(span @ span))
        )
        return (limits.torsion_arm + couple) * force_vertical

    def _squeeze(self, contacts: Array, shares: Array, forces: Array) -> None:
        """Press the feet together as the ball's slope asks for (in place).

        Two feet beside the ball's top stand on opposite slopes; under vertical
        forces they would creep apart. An internal force along the line between
        the contacts, without effect on the body as a whole, turns the force on
        the lighter foot into the plane of its sole's normal.
        """
        if shares.min() <= 0.0:
            return
        span = contacts[0] - contacts[1]
        axis = span / float(np.sqrt(span @ span))
        normals = [foot.rotation[:, 2] for foot in self._robot.feet]
        pressures = [
            sign * float(normal @ axis) / float(normal[2]) * float(force[2])
            for sign, normal, force in zip((1.0, -1.0), normals, forces, strict=True)
        ]
        pressure = max(min(pressures), 0.0)
        forces[0] += pressure * axis
        forces[1] -= pressure * axis

    def _share_yaw(
        self, contacts: Array, shares: Array, forces: Array, yaw: float
    ) -> Array:
        """Give the yaw moment to torsion first, then to a couple (in place)."""
        limits = self._limits
        # The shared forces act at the contacts, not at the CoP, but in
        # proportion: their own moment about the CoP is zero.
        total = float(forces[0, 2] + forces[1, 2])
        torsion = min(max(yaw, -limits.torsion_arm * total), limits.torsion_arm * total)
        rest = yaw - torsion
        if rest != 0.0 and shares.min() > 0.0:
            span = contacts[0] - contacts[1]
            arm = np.array([-span[1], span[0], 0.0]) / float(span[:2] @ span[:2])
            forces[0] += rest * arm
            forces[1] -= rest * arm
        twist: Array = shares * torsion
        return twist

    @staticmethod
    def contact_acceleration(
        contact: Array,
        floor_contact: Array,
        angular_acceleration_ball: Array,
        slip_velocity: Array,
        slip_gain: float,
    ) -> Array:
        """Return the acceleration of the ball's surface at a contact.

        Args:
            contact: Contact point in the world, shape (3,), [m].
            floor_contact: Where the ball touches the floor, shape (3,), [m].
            angular_acceleration_ball: In the world, shape (3,), [rad/s^2].
            slip_velocity: Velocity of the foot's point over the ball's surface,
                shape (3,), [m/s].
            slip_gain: Rate at which slip shall vanish, [1/s].

        Returns:
            Acceleration for the foot's contact point, shape (3,), [m/s^2].
        """
        surface = cross(angular_acceleration_ball, contact - floor_contact)
        result: Array = surface - slip_gain * slip_velocity
        return result
