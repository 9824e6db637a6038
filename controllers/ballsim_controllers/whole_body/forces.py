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

import functools
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import apply, apply_transposed, cross
from ballsim_controllers.messages import Array, ArrayField, Message, Record
from ballsim_controllers.native import view_1d, view_2d
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.accelerations import WholeBodyAccelerations
from ballsim_controllers.whole_body.contact_placement import place_contacts
from ballsim_controllers.whole_body.contact_wrench import (
    limit_twist,
    limit_yaw,
    share_yaw,
    squeeze_feet,
)
from ballsim_controllers.whole_body.leg_motion import N_BASE, solve_legs
from ballsim_controllers.whole_body.momentum import base_acceleration, net_wrench

__all__ = [
    "FORCE_LIMITS",
    "ContactForces",
    "ForceDistribution",
    "ForceLimits",
    "body_dtype",
    "distribute_forces",
]


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


#: What of the limits the distribution itself needs.
FORCE_LIMITS = np.dtype(
    [
        (name, np.float64)
        for name in (
            "torsion_arm",
            "couple_friction",
            "pitch_compliance",
            "roll_compliance",
        )
    ]
)


@functools.cache
def body_dtype(n_joints: int) -> np.dtype[np.void]:
    """Return the fields of `ContactForces` of a robot with some joints."""
    return np.dtype(
        [
            ("joint_torques", np.float64, n_joints),
            ("accelerations", np.float64, N_BASE + n_joints),
            ("soles", np.float64, (2, 6)),
            ("sole_biases", np.float64, (2, 6)),
            ("forces", np.float64, (2, 3)),
            ("contacts", np.float64, (2, 3)),
            ("shares", np.float64, 2),
            ("cop", np.float64, 2),
            ("twist", np.float64),
            ("squeeze", np.float64),
        ]
    )


@dataclass(frozen=True, slots=True)
class ContactForces(Message):
    """Result of the distribution.

    Attributes:
        record: All of the below, shape (1,), dtype of `body_dtype`.
        joint_torques: Shape (n,), [N m].
        accelerations: Generalised acceleration, shape (6 + n,).
        soles: Accelerations of the soles that were asked for, shape (2, 6).
        sole_biases: What of them needs no joint acceleration, shape (2, 6).
        forces: Force of the ball on each foot, in the world, (2, 3), [N].
        contacts: Where each force acts, in the world, (2, 3), [m].
        shares: Share of the load per foot, shape (2,).
        cop: CoP that the contacts realise, shape (2,), [m].
    """

    joint_torques = ArrayField()
    accelerations = ArrayField()
    soles = ArrayField()
    sole_biases = ArrayField()
    forces = ArrayField()
    contacts = ArrayField()
    shares = ArrayField()
    cop = ArrayField()

    @property
    def joint_accelerations(self) -> Array:
        """Return the accelerations of the joints, shape (n,), [rad/s^2]."""
        return self.accelerations[N_BASE:]

    @property
    def trunk_angular(self) -> Array:
        """Return the trunk's angular acceleration, in the trunk, (3,), [rad/s^2]."""
        return self.accelerations[3:N_BASE]


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
        self._usable_sole = (limits.cop_half_length, limits.cop_half_width)
        self._minimal_share = limits.minimal_share
        #: Limits as a record, shape (1,), dtype `FORCE_LIMITS`.
        self.limits: Record = np.zeros(1, FORCE_LIMITS)
        for name in FORCE_LIMITS.names or ():
            self.limits[name] = getattr(limits, name)

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
            self._robot.record["feet"][0],
            cop,
            stance,
            transfer,
            self._usable_sole,
            self._minimal_share,
        )

    def solve(
        self,
        wanted: WholeBodyAccelerations,
        touching: Array,
        contacts: Array,
        shares: Array,
        twist: float = 0.0,
        squeeze: float = 0.0,
    ) -> ContactForces:
        """Return forces and joint torques that realise the accelerations.

        Args:
            wanted: Accelerations of trunk, CoM height, soles, upper body.
            touching: Where each sole meets the ball now, or its centre for a
                swing foot: the points that ``wanted.soles`` speaks of, (2, 3),
                [m].
            contacts: Where the forces shall act, shape (2, 3), [m].
            shares: Share of the load per foot, shape (2,); 0 = swings.
            twist: Torsion that the left foot is to get and the right one to give,
                [N m].
            squeeze: Force that is to press the feet together beside what the
                ball's slope asks for, [N].

        Returns:
            Joint torques, accelerations and contact forces.
        """
        bodies: Record = np.empty(1, body_dtype(self._robot.joint_count))
        bodies["contacts"], bodies["shares"] = contacts, shares
        bodies["soles"] = wanted.soles
        bodies["twist"], bodies["squeeze"] = twist, squeeze
        _distribute(
            bodies,
            self._robot.record,
            self.limits,
            wanted.trunk_angular,
            wanted.com_vertical,
            wanted.horizontal_force,
            wanted.upper_joints,
            touching,
        )
        return ContactForces(bodies)


@compiled
def _distribute(
    bodies: Record,
    robots: Record,
    limits: Record,
    trunk_angular: Array,
    com_vertical: float,
    horizontal_force: Array,
    upper_joints: Array,
    touching: Array,
) -> None:
    """Distribute from Python; see `distribute_forces`."""
    distribute_forces(
        bodies[0],
        robots[0],
        limits[0],
        trunk_angular,
        com_vertical,
        horizontal_force,
        upper_joints,
        touching,
    )


@compiled
def distribute_forces(
    body: Record,
    robot: Record,
    limits: Record,
    trunk_angular: Array,
    com_vertical: float,
    horizontal_force: Array,
    upper_joints: Array,
    touching: Array,
) -> None:
    """Write torques, accelerations, forces and CoP into a body record.

    Args:
        body: Dtype of `body_dtype`; its soles, contacts, shares, twist and
            squeeze are given.
        robot: The robot, dtype of `robot_dtype`.
        limits: What the contacts can transmit, dtype `FORCE_LIMITS`.
        trunk_angular: See `WholeBodyAccelerations`, as what follows.
        com_vertical: Vertical acceleration of the CoM, [m/s^2].
        horizontal_force: Contact force of the inverted pendulum, (2,), [N].
        upper_joints: Accelerations of the joints that are not in the legs.
        touching: Where each sole meets the ball now, shape (2, 3), [m].
    """
    nv, legs = robot["nv"], robot["legs"]
    contacts, shares = body["contacts"], body["shares"]
    mass_matrix = view_2d(robot["mass_matrix"], nv, nv)
    bias = view_1d(robot["bias"], nv)
    base_position = view_1d(robot["qpos"], 3)
    attitudes = view_2d(robot["xmat"], robot["n_bodies"], 9)
    rotation_trunk = attitudes[robot["trunk_body"]].reshape(3, 3)
    # 1. Leg accelerations = solution @ (base acceleration, 1).
    solutions, jacobians = solve_legs(
        touching, body["soles"], robot, body["sole_biases"]
    )

    # 2. Net wrench about the CoP, world axes: wrench @ (base acceleration, 1).
    cop = np.empty(3)
    for i in range(3):
        cop[i] = shares[0] * contacts[0, i] + shares[1] * contacts[1, i]
    body["cop"][0], body["cop"][1] = cop[0], cop[1]
    wrench = net_wrench(
        solutions, robot, upper_joints, mass_matrix, bias, rotation_trunk
    )
    for column in range(7):
        moment = cross(cop - base_position, wrench[:3, column])
        for i in range(3):
            wrench[3 + i, column] -= moment[i]
    force_vertical = robot["mass"] * (robot["gravity"] + com_vertical)
    base, yaw = base_acceleration(
        wrench,
        force_vertical,
        trunk_angular,
        horizontal_force,
        rotation_trunk,
        limit_yaw(contacts, shares, force_vertical, limits),
        robot["mass"],
        limits,
    )
    qacc = body["accelerations"]
    qacc[:N_BASE] = base
    for i in range(len(upper_joints)):
        qacc[robot["upper"][i]] = upper_joints[i]
    for foot in range(2):
        leg = apply(solutions[foot][:, :N_BASE], base)
        for i in range(6):
            qacc[legs[foot, i]] = leg[i] + solutions[foot, i, N_BASE]

    # 3. Share, twist, torques.
    net = apply(wrench[:3, :N_BASE], base)
    forces = body["forces"]
    for i in range(3):
        force = net[i] + wrench[i, N_BASE]
        forces[0, i], forces[1, i] = shares[0] * force, shares[1] * force
    squeeze_feet(
        contacts,
        shares,
        robot["feet"]["rotation"],
        forces,
        body["squeeze"],
        limits["couple_friction"],
    )
    torsion_arm = limits["torsion_arm"]
    torsion = share_yaw(contacts, shares, forces, yaw, torsion_arm)
    twist = limit_twist(body["twist"], shares, forces, torsion, torsion_arm)
    torques = body["joint_torques"]
    torques[:] = apply(mass_matrix[N_BASE:], qacc)
    for i in range(nv - N_BASE):
        torques[i] += bias[N_BASE + i]
    foot_wrench = np.empty(6)
    for foot in range(2):
        if shares[foot] > 0.0:
            foot_wrench[:3] = forces[foot]
            foot_wrench[3:] = cross(contacts[foot] - touching[foot], forces[foot])
            foot_wrench[5] += shares[foot] * torsion + (1 - 2 * foot) * twist
            leg = apply_transposed(jacobians[foot][:, N_BASE:], foot_wrench)
            for i in range(6):
                torques[legs[foot, i] - N_BASE] -= leg[i]
