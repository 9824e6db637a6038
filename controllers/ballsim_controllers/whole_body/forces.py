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

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import (
    apply,
    apply_transposed,
    clip,
    cross,
    multiply,
    solve_linear,
)
from ballsim_controllers.messages import Array, IntArray, Record
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.accelerations import WholeBodyAccelerations
from ballsim_controllers.whole_body.contact_placement import place_contacts
from ballsim_controllers.whole_body.leg_motion import N_BASE, solve_legs

__all__ = ["ContactForces", "ForceDistribution", "ForceLimits"]


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
        robot, data = robot_model, robot_model.data
        self._feet = robot.feet_record
        self._half_size = (limits.cop_half_length, limits.cop_half_width)
        self._minimal_share = limits.minimal_share
        self._parameters: Record = np.zeros(1, _PARAMETERS)
        for name in _LIMITS:
            self._parameters[name] = getattr(limits, name)
        self._parameters["mass"] = robot.mass
        self._parameters["gravity"] = robot.gravity
        self._model = (
            robot.feet_record,
            np.array(robot.leg_dofs),
            np.array(robot.foot_body_ids),
            robot.upper_dofs,
            data.xmat[robot.trunk_id].reshape(3, 3),
            robot.mass_matrix,
            robot.bias,
            robot.qpos,
            robot.qvel,
            data.cdof,
            data.cdof_dot,
            data.cvel,
            data.subtree_com,
        )

    def place_contacts(
        self, cop: Array, stance: tuple[bool, bool], transfer: tuple[float, float]
    ) -> tuple[Array, Array]:
        """Choose contact points and load shares that give a CoP.

        Args:
            cop: Wanted CoP, shape (2,), [m].
            stance: Which feet stand (left, right); at least one.
            transfer: Transfer of each foot, 0 to 1.

        Returns:
            Contact points in the world, shape (2, 3), [m], and the share of the
            load of each foot, shape (2,); see `contact_placement`.
        """
        return place_contacts(
            self._feet, cop, stance, transfer, self._half_size, self._minimal_share
        )

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
        torques, accelerations, forces, cop = _distribute(
            self._parameters,
            wanted.trunk_angular,
            wanted.com_vertical,
            wanted.horizontal_force,
            wanted.soles,
            wanted.upper_joints,
            touching,
            contacts,
            shares,
            *self._model,
        )
        return ContactForces(
            joint_torques=torques,
            joint_accelerations=accelerations[N_BASE:],
            trunk_angular=accelerations[3:N_BASE],
            forces=forces,
            contacts=contacts,
            shares=shares,
            cop=cop,
        )


#: What of the limits the distribution itself needs.
_LIMITS = ("torsion_arm", "couple_friction", "pitch_compliance", "roll_compliance")
_PARAMETERS = np.dtype([(name, np.float64) for name in (*_LIMITS, "mass", "gravity")])


@compiled
def _distribute(
    parameters: Record,
    trunk_angular: Array,
    com_vertical: float,
    horizontal_force: Array,
    soles: Array,
    upper_joints: Array,
    touching: Array,
    contacts: Array,
    shares: Array,
    feet: Record,
    legs: IntArray,
    bodies: IntArray,
    upper: IntArray,
    rotation_trunk: Array,
    mass_matrix: Array,
    bias: Array,
    qpos: Array,
    qvel: Array,
    cdof: Array,
    cdof_dot: Array,
    cvel: Array,
    subtree_com: Array,
) -> tuple[Array, Array, Array, Array]:
    """Return joint torques, accelerations (nv,), forces (2, 3) and CoP (2,)."""
    limits, nv = parameters[0], len(qvel)
    # 1. Leg accelerations = solution @ (base acceleration, 1).
    solutions, jacobians = solve_legs(
        touching, soles, legs, bodies, qvel, cdof, cdof_dot, cvel, subtree_com
    )

    # 2. Net wrench about the CoP, world axes: wrench @ (base acceleration, 1).
    cop = np.zeros(3)
    for i in range(3):
        cop[i] = shares[0] * contacts[0, i] + shares[1] * contacts[1, i]
    wrench = _net_wrench(
        solutions, legs, upper, upper_joints, mass_matrix, bias, rotation_trunk
    )
    for column in range(7):
        moment = cross(cop - qpos[:3], wrench[:3, column])
        for i in range(3):
            wrench[3 + i, column] -= moment[i]
    force_vertical = limits["mass"] * (limits["gravity"] + com_vertical)
    # Vertical force and horizontal moment about the CoP are given.
    rows, target = np.empty((3, N_BASE)), np.empty(3)
    for i in range(3):
        for column in range(N_BASE):
            rows[i, column] = wrench[2 + i, column]
        target[i] = (force_vertical if i == 0 else 0.0) - wrench[2 + i, N_BASE]
    base = _share_momentum(
        rows, target, wrench, trunk_angular, horizontal_force, rotation_trunk, limits
    )

    # The trunk's yaw acceleration gives way where the feet cannot twist.
    direction = np.zeros((N_BASE, 1))
    for i in range(3):
        direction[3 + i, 0] = rotation_trunk[2, i]
    direction[:3] = solve_linear(rows[:, :3], -multiply(rows, direction))
    yaw, change = wrench[5, N_BASE], 0.0
    for column in range(N_BASE):
        yaw += wrench[5, column] * base[column]
        change += wrench[5, column] * direction[column, 0]
    yaw_limit = _yaw_limit(contacts, shares, force_vertical, limits)
    held_yaw = clip(yaw, -yaw_limit, yaw_limit)
    for column in range(N_BASE):
        base[column] -= (yaw - held_yaw) / change * direction[column, 0]

    qacc = np.zeros(nv)
    qacc[:N_BASE] = base
    for i in range(len(upper)):
        qacc[upper[i]] = upper_joints[i]
    for foot in range(2):
        for i in range(6):
            total = solutions[foot, i, N_BASE]
            for column in range(N_BASE):
                total += solutions[foot, i, column] * base[column]
            qacc[legs[foot, i]] = total

    # 3. Share, twist, torques.
    forces = np.empty((2, 3))
    for i in range(3):
        force = wrench[i, N_BASE]
        for column in range(N_BASE):
            force += wrench[i, column] * base[column]
        forces[0, i], forces[1, i] = shares[0] * force, shares[1] * force
    _squeeze(contacts, shares, feet[0]["rotation"], forces)
    torsion = _share_yaw(contacts, shares, forces, held_yaw, limits["torsion_arm"])
    torques = apply(mass_matrix[N_BASE:], qacc)
    for i in range(nv - N_BASE):
        torques[i] += bias[N_BASE + i]
    for foot in range(2):
        if shares[foot] > 0.0:
            foot_wrench = np.empty(6)
            foot_wrench[:3] = forces[foot]
            foot_wrench[3:] = cross(contacts[foot] - touching[foot], forces[foot])
            foot_wrench[5] += shares[foot] * torsion
            leg_torques = apply_transposed(jacobians[foot][:, N_BASE:], foot_wrench)
            for i in range(6):
                torques[legs[foot, i] - N_BASE] -= leg_torques[i]
    return torques, qacc, forces, cop[:2]


@compiled
def _net_wrench(
    solutions: Array,
    legs: IntArray,
    upper: IntArray,
    upper_joints: Array,
    mass_matrix: Array,
    bias: Array,
    rotation_trunk: Array,
) -> Array:
    """Return the net wrench about the base, world axes, per base acceleration.

    Returns:
        Force over moment; the last column is the constant part, shape (6, 7).
    """
    wrench = np.empty((6, 7))
    for row in range(6):
        for column in range(7):
            total = mass_matrix[row, column] if column < N_BASE else bias[row]
            for foot in range(2):
                for i in range(6):
                    total += (
                        mass_matrix[row, legs[foot, i]] * solutions[foot, i, column]
                    )
            wrench[row, column] = total
        for i in range(len(upper)):
            wrench[row, N_BASE] += mass_matrix[row, upper[i]] * upper_joints[i]
    # The base's rotations are about the trunk's own axes.
    wrench[3:] = multiply(rotation_trunk, wrench[3:])
    return wrench


@compiled
def _share_momentum(
    rows: Array,
    target: Array,
    wrench: Array,
    trunk_angular: Array,
    horizontal_force: Array,
    rotation_trunk: Array,
    limits: Record,
) -> Array:
    """Return the base's acceleration that meets the CoP exactly.

    What the swinging leg does to the angular momentum must be answered by
    the trunk (it leans) or by the horizontal force (the ball is kicked):
    least squares over both, about the wanted trunk acceleration and the
    force of the pendulum.

    Args:
        rows: Vertical force and horizontal moment about the CoP per base
            acceleration, shape (3, 6).
        target: What they shall be, less their constant part, shape (3,).
        wrench: Net wrench, shape (6, 7).
        trunk_angular: Wanted, in the trunk, shape (3,), [rad/s^2].
        horizontal_force: Contact force of the inverted pendulum, (2,), [N].
        rotation_trunk: Trunk to world, shape (3, 3).
        limits: Prices of both deviations.

    Returns:
        Linear acceleration in the world, angular in the trunk, shape (6,).
    """
    # Columns: wanted motion, deviation of the trunk about the world's x and y.
    solution = np.zeros((6, 3))
    for i in range(3):
        solution[3 + i, 0] = trunk_angular[i]
        solution[3 + i, 1] = rotation_trunk[0, i]
        solution[3 + i, 2] = rotation_trunk[1, i]
    right = -multiply(rows, solution)
    for i in range(3):
        right[i, 0] += target[i]
    solution[:3] = solve_linear(rows[:, :3], right)
    forces = multiply(wrench[:2, :N_BASE], solution)
    mass = limits["mass"]
    system, gap = np.eye(2), np.zeros((2, 1))
    for axis in range(2):
        price = limits["pitch_compliance"] if axis == 0 else limits["roll_compliance"]
        rest = horizontal_force[axis] - wrench[axis, N_BASE] - forces[axis, 0]
        for i in range(2):
            pull = forces[axis, 1 + i] / mass * price
            gap[i, 0] += pull * rest / mass
            for j in range(2):
                system[i, j] += pull * forces[axis, 1 + j] / mass
    lean = solve_linear(system, gap)
    base = np.empty(6)
    for i in range(6):
        base[i] = solution[i, 0] + solution[i, 1] * lean[0, 0]
        base[i] += solution[i, 2] * lean[1, 0]
    return base


@compiled
def _yaw_limit(
    contacts: Array, shares: Array, force_vertical: float, limits: Record
) -> float:
    """Return the largest yaw moment that torsion and a couple can give, [N m]."""
    x, y = contacts[0, 0] - contacts[1, 0], contacts[0, 1] - contacts[1, 1]
    couple = limits["couple_friction"] * min(shares[0], shares[1])
    arm: float = limits["torsion_arm"] + couple * (x * x + y * y) ** 0.5
    return arm * force_vertical


@compiled
def _squeeze(contacts: Array, shares: Array, rotations: Array, forces: Array) -> None:
    """Press the feet together as the ball's slope asks for (in place).

    Two feet beside the ball's top stand on opposite slopes; under vertical
    forces they would creep apart. An internal force along the line between
    the contacts, without effect on the body as a whole, turns the force on
    the lighter foot into the plane of its sole's normal.
    """
    if min(shares[0], shares[1]) <= 0.0:
        return
    span = contacts[0] - contacts[1]
    length = (span[0] ** 2 + span[1] ** 2 + span[2] ** 2) ** 0.5
    pressures = np.zeros(2)
    for foot in range(2):
        along = 0.0
        for i in range(3):
            along += rotations[foot, i, 2] * span[i] / length
        sign = 1.0 if foot == 0 else -1.0
        pressures[foot] = sign * along / rotations[foot, 2, 2] * forces[foot, 2]
    pressure = max(min(pressures[0], pressures[1]), 0.0)
    for i in range(3):
        forces[0, i] += pressure * span[i] / length
        forces[1, i] -= pressure * span[i] / length


@compiled
def _share_yaw(
    contacts: Array, shares: Array, forces: Array, yaw: float, torsion_arm: float
) -> float:
    """Give the yaw moment to torsion first, then to a couple (in place).

    Returns:
        Torsional moment of both feet, to be shared as the load is, [N m].
    """
    # The shared forces act at the contacts, not at the CoP, but in
    # proportion: their own moment about the CoP is zero.
    limit = torsion_arm * (forces[0, 2] + forces[1, 2])
    torsion = clip(yaw, -limit, limit)
    rest = yaw - torsion
    if rest != 0.0 and min(shares[0], shares[1]) > 0.0:
        x, y = contacts[0, 0] - contacts[1, 0], contacts[0, 1] - contacts[1, 1]
        scale = rest / (x * x + y * y)
        forces[0, 0] -= scale * y
        forces[0, 1] += scale * x
        forces[1, 0] += scale * y
        forces[1, 1] -= scale * x
    return torsion
