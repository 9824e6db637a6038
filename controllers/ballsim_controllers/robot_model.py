"""The robot's own kinematics and dynamics, through a MuJoCo model of itself."""

from __future__ import annotations

import copy
import functools
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.native import find_function
from ballsim_controllers.robot import RobotDescription
from ballsim_controllers.robot_kinematics import (
    ARRAYS,
    FEET,
    FUNCTIONS,
    refresh_dynamics,
    refresh_kinematics,
    robot_dtype,
)

__all__ = ["FootKinematics", "RobotModel"]


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


@functools.lru_cache(maxsize=4)
def _load_model(path: Path, _stamp: int) -> mujoco.MjModel:
    """Return the model of an MJCF file, which all share that do not change it."""
    return mujoco.MjModel.from_xml_path(str(path))


class RobotModel:
    """Kinematics and dynamics of the robot alone (no ball, no contacts).

    The generalised velocity is MuJoCo's: linear velocity of the base in the
    world, angular velocity of the base in the base, joint velocities in
    actuator order.

    Args:
        robot: Description of the robot.
        has_own_model: True if the trunk's mass will be moved, see
            `robot_kinematics.move_mass`; else the model is shared.

    Raises:
        InvalidSettingError: Joints and actuators of the MJCF do not agree with
            what this class assumes (one floating base, every joint actuated by
            a position servo, in the order of the joints).
    """

    def __init__(self, robot: RobotDescription, has_own_model: bool = False) -> None:
        """Compile the robot's MJCF and look its parts up."""
        self.robot = robot
        model = _load_model(robot.mjcf_path, robot.mjcf_path.stat().st_mtime_ns)
        self.has_own_model = has_own_model
        self.model = copy.copy(model) if has_own_model else model
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
        #: Configuration and velocity, to be written before ``refresh``.
        self.qpos: Array = self.data.qpos
        self.qvel: Array = self.data.qvel
        #: All that compiled functions need, shape (1,); see `robot_kinematics`.
        self.record = self._make_record()
        feet = self.record["feet"]
        assert FEET.names is not None
        self.feet = tuple(
            FootKinematics(*(feet[name][0, i] for name in FEET.names)) for i in range(2)
        )

    def _make_record(self) -> Record:
        model, data = self.model, self.data
        n_upper = len(self.upper_dofs)
        record: Record = np.zeros(1, robot_dtype(self.joint_count, n_upper))
        for name in FUNCTIONS:
            record[name] = find_function(name)
        for name in ARRAYS:
            record[name] = getattr(data, name).ctypes.data
        record["model"], record["data"] = model._address, data._address
        record["body_mass"] = model.body_mass.ctypes.data
        record["body_ipos"] = model.body_ipos.ctypes.data
        record["trunk_ipos"] = model.body_ipos[self.trunk_id]
        record["has_own_model"] = self.has_own_model
        record["mass_matrix"] = self.mass_matrix.ctypes.data
        record["bias"] = self.bias.ctypes.data
        record["n_bodies"], record["n_sites"] = model.nbody, model.nsite
        record["nv"], record["trunk_body"] = model.nv, self.trunk_id
        record["foot_bodies"], record["sole_sites"] = self.foot_body_ids, self.sole_ids
        record["wrench_sites"], record["legs"] = self.wrench_ids, self.leg_dofs
        record["upper"] = self.upper_dofs
        record["nominal_upper"] = self.nominal_posture[self.upper_dofs - 6]
        for name in ("mass", "gravity", "kp", "kv", "torque_limits"):
            record[name] = getattr(self, name)
        return record

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
        refresh_kinematics(self.record)

    def update_dynamics(self) -> None:
        """Refresh mass matrix and bias forces for the last ``update``."""
        refresh_dynamics(self.record)

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
