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

from ballsim_controllers.geometry import rotation_to_quaternion
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel

__all__ = ["InverseKinematics", "PostureTargets", "TaskCosts"]


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
        self._ranges = robot_model.joint_ranges.T.copy()
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
        self._largest_step = np.full(model.nv, np.inf)
        self._largest_step[self._speeds.indices] = period * self._speeds.limit
        self._constant_hessian = self._posture.compute_qp_objective(
            self.configuration
        ).H + self.damping * np.eye(model.nv)
        self._posture_weights = self._posture.cost**2 * self._posture.gain
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
        inside = qpos.copy()
        # A start beyond a joint's stop has no solution within the speed limit.
        inside[7:] = np.minimum(np.maximum(qpos[7:], self._ranges[0]), self._ranges[1])
        self.configuration.update(inside)
        self._com.set_target(targets.com)
        for i, task in enumerate(self._soles):
            task.set_target(
                _transform(targets.sole_rotations[i], targets.sole_positions[i])
            )
        self._trunk.set_target(_transform(targets.trunk_rotation, np.zeros(3)))
        hessian, gradient = self._objective()
        lower, upper = self._bounds(inside)
        step, _, flag, _ = daqp.solve(
            hessian, gradient, self._no_rows, upper, lower, self._sense
        )
        if flag < 1:
            self.failure_count += 1
            self._velocity = 0.5 * self._velocity
        else:
            self._velocity = step[6:] / self._period
        return self._velocity

    def _objective(self) -> tuple[Array, Array]:
        """Return the sum of all tasks' objectives, (nv, nv) and (nv,)."""
        residuals = [
            task.compute_qp_residual(self.configuration) for task in self._moving
        ]
        jacobian = np.concatenate([weighted for weighted, _, _ in residuals])
        error = np.concatenate([weighted for _, weighted, _ in residuals])
        hessian = jacobian.T @ jacobian
        hessian += self._constant_hessian
        gradient = self._posture_weights * self._posture.compute_error(
            self.configuration
        )
        gradient -= error @ jacobian
        return hessian, gradient

    def _bounds(self, qpos: Array) -> tuple[Array, Array]:
        """Return the least and the largest step of every degree of freedom."""
        angles, gain = self._angles, self._angles.gain
        lower, upper = -self._largest_step, self._largest_step.copy()
        lower[6:] = np.maximum(lower[6:], gain * (angles.lower[7:] - qpos[7:]))
        upper[6:] = np.minimum(upper[6:], gain * (angles.upper[7:] - qpos[7:]))
        return lower, upper


def _transform(rotation: Array, position: Array) -> mink.SE3:
    return mink.SE3(np.concatenate((rotation_to_quaternion(rotation), position)))
