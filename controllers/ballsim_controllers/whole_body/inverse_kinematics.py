"""CoM and foot targets to joint positions, by mink.

Configuration, tasks and limits are mink's. The quadratic program that mink builds
of them is put together here, because it has more structure than mink assumes: the
Hessian of the posture task is constant, and all limits are bounds on single joints,
which the solver takes as such instead of as 72 rows of a matrix.
"""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import mink
import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import clip, rotation_to_quaternion
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel

__all__ = ["InverseKinematics", "PostureTargets", "TaskCosts"]

_FREE = 1e3  # step that a degree of freedom without limits never takes


@dataclass(frozen=True, slots=True)
class TaskCosts:
    """Costs of the tasks, in [cost] per unit of the error.

    Attributes:
        com: Centre of mass, [1/m].
        foot_position: Sole's centre, [1/m].
        foot_orientation: Sole's attitude, [1/rad].
        trunk_orientation: Trunk's attitude, [1/rad].
        posture: Deviation from the nominal posture, [1/rad].
        damping: Damping of every degree of freedom.
    """

    com: float = 5.0
    foot_position: float = 10.0
    foot_orientation: float = 3.0
    trunk_orientation: float = 1.0
    posture: float = 1e-3
    damping: float = 1e-6


@dataclass(frozen=True, slots=True)
class PostureTargets:
    """Where the robot's parts shall be after one period of the IK.

    Attributes:
        com: CoM in the world, shape (3,), [m].
        sole_positions: Sole centres (left, right), shape (2, 3), [m].
        sole_rotations: Sole to world, shape (2, 3, 3).
        trunk_rotation: Trunk to world, shape (3, 3).
    """

    com: Array
    sole_positions: Array
    sole_rotations: Array
    trunk_rotation: Array


class InverseKinematics:
    """Differential inverse kinematics with joint position and speed limits.

    The model is that of the robot alone: with the ball in it, mink's CoM task
    would count the ball's mass.

    Args:
        robot_model: Supplies the MJCF model, names and limits; its data are not
            touched, mink works on data of its own.
        costs: Costs of the tasks.
        period: Time over which the targets shall be reached, [s].

    Attributes:
        configuration: mink's configuration.
        tasks: mink's tasks: CoM, both soles, trunk, posture.
        limits: mink's limits of joint angles and joint velocities.
        damping: Damping of every degree of freedom.
        failure_count: Calls for which the QP had no solution; the last velocity
            was halved.
    """

    def __init__(
        self, robot_model: RobotModel, costs: TaskCosts, period: float
    ) -> None:
        """Set up tasks and limits once."""
        robot, model = robot_model.robot, robot_model.model
        self._period = period
        self.damping = costs.damping
        self.configuration = mink.Configuration(model)
        self._com = mink.ComTask(cost=costs.com)
        self._soles = tuple(
            mink.FrameTask(
                leg.sole_site,
                "site",
                position_cost=costs.foot_position,
                orientation_cost=costs.foot_orientation,
            )
            for leg in robot.legs
        )
        self._trunk = mink.FrameTask(
            robot.trunk_body,
            "body",
            position_cost=0.0,
            orientation_cost=costs.trunk_orientation,
        )
        # The targets are written into mink's own arrays: quaternion and place of
        # each sole and of the trunk, and the CoM.
        self._poses = np.zeros((3, 7))
        for task, pose in zip((*self._soles, self._trunk), self._poses, strict=True):
            task.transform_target_to_world = mink.SE3(pose)
        self._com.target_com = self._target_com = np.zeros(3)
        self._posture = mink.PostureTask(model, cost=costs.posture)
        self._posture.set_target(
            np.concatenate(
                ((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), robot_model.nominal_posture)
            )
        )
        self._moving = (self._com, *self._soles, self._trunk)
        self.tasks = (*self._moving, self._posture)
        self._angles = mink.ConfigurationLimit(model, gain=0.9)
        self._speeds = mink.VelocityLimit(model, dict(robot.velocity_limits))
        self.limits = (self._angles, self._speeds)
        joints = slice(7, None)
        largest_steps = np.full(robot_model.joint_count, np.inf)
        largest_steps[self._speeds.indices - 6] = period * self._speeds.limit
        self._bounds = (
            robot_model.joint_ranges,
            np.array([self._angles.lower[joints], self._angles.upper[joints]]),
            self._angles.gain,
            largest_steps,
        )
        self._constant_hessian = self._posture.compute_qp_objective(
            self.configuration
        ).H + self.damping * np.eye(model.nv)
        self._posture_weights = self._posture.cost**2 * self._posture.gain
        rows = sum(len(task.cost) for task in self._moving)
        self._jacobian, self._error = np.empty((rows, model.nv)), np.empty(rows)
        self._hessian = np.empty((model.nv, model.nv))
        self._inside = np.empty(model.nq)
        self._lower, self._upper = np.full(model.nv, -_FREE), np.full(model.nv, _FREE)
        self._no_rows = np.zeros((0, model.nv))
        self._sense = np.zeros(model.nv, dtype=np.intc)
        self.failure_count = 0
        self._velocity = np.zeros(robot_model.joint_count)

    def solve(self, qpos: Array, targets: PostureTargets) -> Array:
        """Return joint velocities that lead to the targets in one period.

        Args:
            qpos: Measured configuration, shape (nq,).
            targets: Where the parts shall be.

        Returns:
            Joint velocities in actuator order, shape (n,), [rad/s]. Where the
            QP has no solution, half of the last ones.
        """
        # A start beyond a joint's stop has no solution within the speed limit.
        _set_bounds(self._inside, self._lower, self._upper, qpos, *self._bounds)
        self.configuration.update(self._inside)
        self._target_com[:] = targets.com
        _write_poses(
            self._poses,
            targets.sole_rotations,
            targets.sole_positions,
            targets.trunk_rotation,
        )
        gradient = self._compute_objective()
        step, _, flag, _ = daqp.solve(
            self._hessian,
            gradient,
            self._no_rows,
            self._upper,
            self._lower,
            self._sense,
        )
        if flag < 1:
            self.failure_count += 1
            self._velocity = 0.5 * self._velocity
        else:
            self._velocity = step[6:] / self._period
        return self._velocity

    def _compute_objective(self) -> Array:
        """Compute the sum of all tasks' objectives; return the gradient, (nv,)."""
        row = 0
        for task in self._moving:
            jacobian, error, _ = task.compute_qp_residual(self.configuration)
            end = row + len(error)
            self._jacobian[row:end], self._error[row:end] = jacobian, error
            row = end
        np.dot(self._jacobian.T, self._jacobian, out=self._hessian)
        self._hessian += self._constant_hessian
        gradient: Array = self._posture_weights * self._posture.compute_error(
            self.configuration
        )
        gradient -= self._error @ self._jacobian
        return gradient


@compiled
def _set_bounds(
    inside: Array,
    lower: Array,
    upper: Array,
    qpos: Array,
    ranges: Array,
    limits: Array,
    gain: float,
    largest_steps: Array,
) -> None:
    """Write the configuration within its ranges, and bounds on the joints' steps.

    Args:
        inside: The configuration, shape (nq,).
        lower: Least step of every degree of freedom, shape (nv,), [rad].
        upper: Largest step, likewise.
        qpos: Measured configuration, shape (nq,).
        ranges: Joint ranges, shape (n, 2), [rad].
        limits: Lower and upper limits that mink keeps, shape (2, n), [rad].
        gain: Share of the way to a limit that one step may take.
        largest_steps: By the joints' speeds, shape (n,), [rad].
    """
    inside[:7] = qpos[:7]
    for i in range(len(largest_steps)):
        angle = clip(qpos[7 + i], ranges[i, 0], ranges[i, 1])
        inside[7 + i] = angle
        lower[6 + i] = max(-largest_steps[i], gain * (limits[0, i] - angle))
        upper[6 + i] = min(largest_steps[i], gain * (limits[1, i] - angle))


@compiled
def _write_poses(
    poses: Array, sole_rotations: Array, sole_positions: Array, trunk_rotation: Array
) -> None:
    """Write the poses of the soles and the attitude of the trunk as mink has them.

    Args:
        poses: Quaternion (w, x, y, z) and place of each, shape (3, 7).
        sole_rotations: Sole to world, shape (2, 3, 3).
        sole_positions: Sole centres, shape (2, 3), [m].
        trunk_rotation: Trunk to world, shape (3, 3).
    """
    for i in range(2):
        poses[i, :4] = rotation_to_quaternion(sole_rotations[i])
        poses[i, 4:] = sole_positions[i]
    poses[2, :4] = rotation_to_quaternion(trunk_rotation)
