"""CoM and foot targets to joint positions, by mink."""

from __future__ import annotations

from dataclasses import dataclass

import mink
import numpy as np
from mink.exceptions import MinkError

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
    """

    def __init__(
        self, robot_model: RobotModel, costs: TaskCosts, period: float
    ) -> None:
        """Set up tasks and limits once."""
        robot, model = robot_model.robot, robot_model.model
        self._period = period
        self._damping = costs.damping
        self._ranges = robot_model.joint_ranges
        self._configuration = mink.Configuration(model)
        self._com_task = mink.ComTask(cost=costs.com)
        self._foot_tasks = tuple(
            mink.FrameTask(
                leg.sole_site,
                "site",
                position_cost=costs.foot_position,
                orientation_cost=costs.foot_orientation,
            )
            for leg in robot.legs
        )
        self._trunk_task = mink.FrameTask(
            robot.trunk_body,
            "body",
            position_cost=0.0,
            orientation_cost=costs.trunk_orientation,
        )
        self._posture_task = mink.PostureTask(model, cost=costs.posture)
        nominal = np.concatenate(
            ((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), robot_model.nominal_posture)
        )
        self._posture_task.set_target(nominal)
        self._tasks = (
            self._com_task,
            *self._foot_tasks,
            self._trunk_task,
            self._posture_task,
        )
        self._limits = (
            mink.ConfigurationLimit(model, gain=0.9),
            mink.VelocityLimit(model, dict(robot.velocity_limits)),
        )
        #: Calls for which the QP had no solution; the last velocity was halved.
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
        np.clip(qpos[7:], self._ranges[:, 0], self._ranges[:, 1], out=inside[7:])
        self._configuration.update(inside)
        self._com_task.set_target(targets.com)
        for i, task in enumerate(self._foot_tasks):
            task.set_target(
                _transform(targets.sole_rotations[i], targets.sole_positions[i])
            )
        self._trunk_task.set_target(_transform(targets.trunk_rotation, np.zeros(3)))
        try:
            velocity = mink.solve_ik(
                self._configuration,
                self._tasks,
                self._period,
                solver="daqp",
                damping=self._damping,
                limits=self._limits,
            )
        except MinkError:
            self.failure_count += 1
            self._velocity = 0.5 * self._velocity
        else:
            self._velocity = velocity[6:].copy()
        return self._velocity


def _transform(rotation: Array, position: Array) -> mink.SE3:
    return mink.SE3.from_rotation_and_translation(
        mink.SO3.from_matrix(rotation), position
    )
