"""Equations of motion of a force distribution, on another way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.forces import ContactForces

if TYPE_CHECKING:
    from tests.controllers.conftest import Situation

__all__ = ["contact_wrench", "equation_residual", "full_acceleration"]


def full_acceleration(robot: RobotModel, result: ContactForces) -> Array:
    """Return the whole qacc: the base's linear part follows from the forces.

    The mean of the forces over the mass is the CoM's acceleration less gravity.
    """
    qacc = np.zeros(robot.model.nv)
    qacc[3:6] = result.trunk_angular
    qacc[6:] = result.joint_accelerations
    rest = robot.mass_matrix[:3] @ qacc + robot.bias[:3]
    qacc[:3] = (result.forces.sum(axis=0) - rest) / robot.mass
    return qacc


def contact_wrench(
    robot: RobotModel, situation: Situation, result: ContactForces, twist: float
) -> Array:
    """Return the generalised force of the contacts, twist shared by load."""
    total = np.zeros(robot.model.nv)
    for i in range(2):
        if situation.shares[i] > 0.0:
            jacobian = robot.point_jacobian(i, result.contacts[i])
            moment = np.array([0.0, 0.0, situation.shares[i] * twist])
            total += jacobian.T @ np.concatenate((result.forces[i], moment))
    return total


def equation_residual(
    robot: RobotModel, situation: Situation, result: ContactForces
) -> tuple[Array, float]:
    """Return M qacc + h - S' tau - J' f on every row, and the twist that it needs.

    The twist about the vertical is not reported; the yaw row gives it.
    """
    qacc = full_acceleration(robot, result)
    residual = robot.mass_matrix @ qacc + robot.bias
    residual[6:] -= result.joint_torques
    residual -= contact_wrench(robot, situation, result, 0.0)
    # A pure moment about the world's z acts on the base through its third row.
    rotation = robot.data.xmat[robot.trunk_id].reshape(3, 3)
    twist = float(rotation[2] @ residual[3:6])
    pure = contact_wrench(robot, situation, result, twist)
    residual -= pure - contact_wrench(robot, situation, result, 0.0)
    return residual, twist
