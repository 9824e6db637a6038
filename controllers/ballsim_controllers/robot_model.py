"""The robot's own kinematics and dynamics, through a MuJoCo model of itself."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.geometry import cross
from ballsim_controllers.messages import Array, IntArray, Record
from ballsim_controllers.robot import RobotDescription

__all__ = ["FEET", "FootKinematics", "RobotModel", "com_velocity"]

#: Pose and motion of both soles (left, right), as in `FootKinematics`.
FEET = np.dtype(
    [
        ("position", np.float64, (2, 3)),
        ("rotation", np.float64, (2, 3, 3)),
        ("linear_velocity", np.float64, (2, 3)),
        ("angular_velocity", np.float64, (2, 3)),
    ]
)


@dataclass(slots=True)
class FootKinematics:
    """Pose and motion of one sole: views that ``RobotModel.update`` refreshes.

    Attributes:
        position: Sole's centre in the world, shape (3,), [m].
        rotation: Sole to world, shape (3, 3).
        linear_velocity: Of the sole's centre, in the world, (3,), [m/s].
        angular_velocity: In the world, shape (3,), [rad/s].
    """

    position: Array
    rotation: Array
    linear_velocity: Array
    angular_velocity: Array


class RobotModel:
    """Kinematics and dynamics of the robot alone (no ball, no contacts).

    The generalised velocity is MuJoCo's: linear velocity of the base in the
    world, angular velocity of the base in the base, joint velocities in
    actuator order.

    Args:
        robot: Description of the robot.

    Raises:
        InvalidSettingError: Joints and actuators of the MJCF do not agree with
            what this class assumes (one floating base, every joint actuated by
            a position servo, in the order of the joints).
    """

    def __init__(self, robot: RobotDescription) -> None:
        """Compile the robot's MJCF and look its parts up."""
        self.robot = robot
        self.model = mujoco.MjModel.from_xml_path(str(robot.mjcf_path))
        self.data = mujoco.MjData(self.model)
        model = self.model
        self.joint_names = tuple(model.actuator(i).name for i in range(model.nu))
        joint_ids = [int(model.actuator_trnid[i, 0]) for i in range(model.nu)]
        if model.nv != 6 + model.nu or model.nq != 7 + model.nu:
            raise InvalidSettingError(
                str(robot.mjcf_path), model.nv, "one free joint and one servo per joint"
            )
        if [int(model.jnt_dofadr[j]) for j in joint_ids] != list(range(6, model.nv)):
            raise InvalidSettingError(
                str(robot.mjcf_path),
                self.joint_names,
                "actuators in the order of joints",
            )
        self.joint_count = int(model.nu)
        self.mass = float(model.body_subtreemass[0])
        self.gravity = float(-model.opt.gravity[2])
        self.kp = model.actuator_gainprm[:, 0].copy()
        self.kv = -model.actuator_biasprm[:, 2].copy()
        self.torque_limits = model.actuator_forcerange[:, 1].copy()
        self.joint_ranges = model.jnt_range[joint_ids].copy()
        self.nominal_posture = np.array(
            [robot.nominal_posture[name] for name in self.joint_names]
        )
        self.velocity_limits = np.array(
            [robot.velocity_limits[name] for name in self.joint_names]
        )
        self.trunk_id = int(model.body(robot.trunk_body).id)
        self.imu_id = int(model.site(robot.imu_site).id)
        self.foot_body_ids = tuple(int(model.body(g.foot_body).id) for g in robot.legs)
        self.sole_ids = tuple(int(model.site(g.sole_site).id) for g in robot.legs)
        self.wrench_ids = tuple(int(model.site(g.wrench_site).id) for g in robot.legs)
        self.foot_masses = tuple(float(model.body_mass[b]) for b in self.foot_body_ids)
        #: Columns of each leg in the generalised velocity.
        self.leg_dofs = tuple(
            np.array([6 + self.joint_names.index(name) for name in g.joints])
            for g in robot.legs
        )
        on_legs = np.concatenate(self.leg_dofs)
        self.upper_dofs = np.setdiff1d(np.arange(6, model.nv), on_legs)
        self.mass_matrix = np.zeros((model.nv, model.nv))
        self.bias = np.zeros(model.nv)
        self._jacobian = np.zeros((6, model.nv))
        #: Both soles, shape (1,), dtype `FEET`; refreshed in place by ``update``.
        self.feet_record: Record = np.zeros(1, FEET)
        assert FEET.names is not None
        self.feet = tuple(
            FootKinematics(*(self.feet_record[name][0, i] for name in FEET.names))
            for i in range(2)
        )
        # MuJoCo's arrays stay where they are: looked up once.
        data = self.data
        #: Configuration and velocity, to be written before ``refresh``.
        self.qpos: Array = data.qpos
        self.qvel: Array = data.qvel
        self._feet_arguments = (
            self.feet_record,
            np.array(self.sole_ids),
            np.array(self.foot_body_ids),
            data.site_xpos,
            data.site_xmat,
            data.cvel,
            data.subtree_com,
        )

    def update(self, qpos: Array, qvel: Array) -> None:
        """Refresh every quantity for a configuration and a velocity.

        Args:
            qpos: Base position, base quaternion, joint angles, shape (nq,).
            qvel: Generalised velocity, shape (nv,).
        """
        self.qpos[:] = qpos
        self.qvel[:] = qvel
        self.refresh()

    def refresh(self) -> None:
        """Refresh every quantity for what stands in ``qpos`` and ``qvel``."""
        model, data = self.model, self.data
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        _update_feet(*self._feet_arguments)

    def update_dynamics(self) -> None:
        """Refresh mass matrix and bias forces for the last ``update``."""
        mujoco.mj_makeM(self.model, self.data)
        mujoco.mj_fullM(self.model, self.data, self.mass_matrix)
        mujoco.mj_rne(self.model, self.data, 0, self.bias)

    @property
    def position_com_in_world(self) -> Array:
        """Return the robot's centre of mass, shape (3,), [m]."""
        com: Array = self.data.subtree_com[0].copy()
        return com

    def com_velocity(self) -> Array:
        """Return the velocity of the centre of mass in the world, (3,), [m/s]."""
        mujoco.mj_subtreeVel(self.model, self.data)
        velocity: Array = self.data.subtree_linvel[0].copy()
        return velocity

    def point_jacobian(self, foot: int, point: Array) -> Array:
        """Return the Jacobian of a point that is fixed in a foot.

        Args:
            foot: 0 = left, 1 = right.
            point: The point in the world, shape (3,), [m].

        Returns:
            Linear over angular velocity in the world, shape (6, nv).
        """
        jacobian = np.empty((6, self.model.nv))
        mujoco.mj_jac(
            self.model,
            self.data,
            jacobian[:3],
            jacobian[3:],
            point,
            self.foot_body_ids[foot],
        )
        return jacobian

    def point_bias_acceleration(self, foot: int, point: Array) -> Array:
        """Return the acceleration of a foot's point at zero joint acceleration.

        Args:
            foot: 0 = left, 1 = right.
            point: The point in the world, shape (3,), [m].

        Returns:
            Linear over angular acceleration in the world, shape (6,).
        """
        mujoco.mj_jacDot(
            self.model,
            self.data,
            self._jacobian[:3],
            self._jacobian[3:],
            point,
            self.foot_body_ids[foot],
        )
        acceleration: Array = self._jacobian @ self.data.qvel
        return acceleration


@compiled
def _update_feet(
    feet: Record,
    sole_ids: IntArray,
    foot_body_ids: IntArray,
    site_xpos: Array,
    site_xmat: Array,
    cvel: Array,
    subtree_com: Array,
) -> None:
    """Fill in pose and motion of the soles from what MuJoCo computed.

    MuJoCo's ``cvel`` is the motion of a body (angular, linear) at the CoM of its
    tree, the robot's.
    """
    for i in range(2):
        site, body = sole_ids[i], foot_body_ids[i]
        foot = feet[0]
        lever = site_xpos[site] - subtree_com[1]
        turning = cross(cvel[body, :3], lever)
        for j in range(3):
            foot["position"][i, j] = site_xpos[site, j]
            foot["angular_velocity"][i, j] = cvel[body, j]
            foot["linear_velocity"][i, j] = cvel[body, 3 + j] + turning[j]
            for k in range(3):
                foot["rotation"][i, j, k] = site_xmat[site, 3 * j + k]


@compiled
def com_velocity(
    subtree_com: Array, cvel: Array, xipos: Array, body_masses: Array
) -> Array:
    """Return the velocity of the robot's CoM from what MuJoCo computed.

    Args:
        subtree_com: CoM of each body's tree, shape (nbody, 3), [m].
        cvel: Motion of each body at the CoM of its tree (angular, linear), shape
            (nbody, 6), [rad/s] and [m/s].
        xipos: CoM of each body, shape (nbody, 3), [m].
        body_masses: Shape (nbody,), [kg].

    Returns:
        Velocity in the world, shape (3,), [m/s].
    """
    momentum, mass = np.zeros(3), 0.0
    for i in range(1, len(body_masses)):
        turning = cross(cvel[i, :3], xipos[i] - subtree_com[1])
        mass += body_masses[i]
        for j in range(3):
            momentum[j] += body_masses[i] * (cvel[i, 3 + j] + turning[j])
    for j in range(3):
        momentum[j] /= mass
    return momentum
