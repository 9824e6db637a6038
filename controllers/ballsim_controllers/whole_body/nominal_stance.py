"""Nominal standing pose on the ball's top."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.geometry import rotation_vector_between, sole_rotation_on_ball
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel

__all__ = ["NominalStance", "solve_nominal_stance"]

_TOLERANCE = 1e-10


@dataclass(frozen=True, slots=True)
class NominalStance:
    """The robot at rest on the ball, whose floor contact is the world's origin.

    Attributes:
        qpos: Base position, base quaternion, joint angles, shape (nq,).
        com_height: Height of the CoM over the ball's top, [m].
    """

    qpos: Array
    com_height: float


def solve_nominal_stance(robot_model: RobotModel, ball_radius: float) -> NominalStance:
    """Return the pose with tangent soles, CoM over the ball, trunk upright.

    The soles' centres touch the ball beside its top at the nominal stance half
    width, and the knees are bent as in the nominal posture on the mean.

    Args:
        robot_model: The robot; its data are overwritten.
        ball_radius: Radius of the ball, [m].

    Returns:
        The stance.

    Raises:
        InvalidSettingError: The ball is too small to stand on, or the stance
            needs joint angles outside of their ranges.
    """
    robot, model = robot_model, robot_model.model
    width = robot.robot.stance_half_width
    if not ball_radius > width / 0.8:
        raise InvalidSettingError(
            "ball.radius_m", ball_radius, f"more than {width / 0.8:.3g} to stand on"
        )
    height = (ball_radius**2 - width**2) ** 0.5
    normals = [np.array([0.0, sign * width, height]) / ball_radius for sign in (1, -1)]
    centre = np.array([0.0, 0.0, ball_radius])
    targets = [(centre + ball_radius * n, sole_rotation_on_ball(n)) for n in normals]

    qpos = np.zeros(model.nq)
    qpos[3] = 1.0
    qpos[7:] = robot.nominal_posture
    robot.update(qpos, np.zeros(model.nv))
    soles = np.mean([foot.position for foot in robot.feet], axis=0)
    qpos[:3] = targets[0][0] * (1.0, 0.0, 1.0) - soles
    legs = np.concatenate(robot.leg_dofs)
    knees = _knee_dofs(robot)
    bend = float(np.mean(robot.nominal_posture[knees - 6]))
    columns = np.concatenate((np.arange(3), legs))
    jacobian_com = np.zeros((3, model.nv))
    error = np.full(15, np.inf)
    for _ in range(100):
        robot.update(qpos, np.zeros(model.nv))
        jacobian = np.zeros((15, model.nv))
        for i, (position, rotation) in enumerate(targets):
            foot = robot.feet[i]
            error[6 * i : 6 * i + 3] = position - foot.position
            error[6 * i + 3 : 6 * i + 6] = rotation_vector_between(
                foot.rotation, rotation
            )
            jacobian[6 * i : 6 * i + 6] = robot.point_jacobian(i, foot.position)
        mujoco.mj_jacSubtreeCom(model, robot.data, jacobian_com, 0)
        error[12:14] = -robot.position_com_in_world[:2]
        jacobian[12:14] = jacobian_com[:2]
        error[14] = bend - float(np.mean(qpos[knees + 1]))
        jacobian[14, knees] = 1.0 / len(knees)
        if float(np.abs(error).max()) < _TOLERANCE:
            break
        step = np.linalg.lstsq(jacobian[:, columns], error, rcond=None)[0]
        step *= min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12))
        change = np.zeros(model.nv)
        change[columns] = step
        mujoco.mj_integratePos(model, qpos, change, 1.0)
    lower, upper = robot.joint_ranges.T
    joints = qpos[7:]
    if (
        not float(np.abs(error).max()) < 1e-6
        or np.any(joints < lower)
        or np.any(joints > upper)
    ):
        raise InvalidSettingError(
            "ball.radius_m", ball_radius, f"a ball that {robot.robot.name} can stand on"
        )
    com_height = float(robot.position_com_in_world[2]) - 2.0 * ball_radius
    return NominalStance(qpos, com_height)


def _knee_dofs(robot: RobotModel) -> np.ndarray:
    """Return the knees: the fourth joint of each leg, hip to ankle."""
    return np.array([leg[3] for leg in robot.leg_dofs])
