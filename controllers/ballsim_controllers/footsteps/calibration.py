"""What the planner keeps back for joints whose zero positions are in error."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.sensor_figures import SensorFigures
from ballsim_controllers.settings import WheeledLipSettings

__all__ = ["CalibrationMargins", "find_calibration_margins"]


@dataclass(frozen=True, slots=True)
class CalibrationMargins:
    """What encoders may tell wrongly in a stance, [m].

    Attributes:
        gap: Of the gap between the inner edges of the soles, at toes or heels.
        support: Of the CoM's place over a standing sole, along and across.
    """

    gap: float = 0.0
    support: tuple[float, float] = (0.0, 0.0)


def find_calibration_margins(
    robot_model: RobotModel,
    qpos: Array,
    settings: WheeledLipSettings,
    sensors: SensorFigures,
) -> CalibrationMargins:
    """Return what errors of the joints' zero positions do to a stance.

    No sensor but the encoders tells how far apart the feet are, so a foot that is to
    land beside the other one may come down on it; and over each foot the CoM is
    elsewhere than it seems, in another direction than over the other one. With J the
    Jacobian of a quantity by the joints, its standard deviation is the bias of an
    encoder times |J|; a margin is `encoder_deviations` of it. Quantities are

        y_left - y_right +- half_length (psi_left - psi_right),   c - p

    with y the lateral place and psi the heading of a sole, c the CoM and p a sole's
    centre.

    Args:
        robot_model: The robot; its data are overwritten.
        qpos: A stance with both feet down: position and quaternion of the base, joint
            angles, shape (nq,).
        settings: Settings of the controller: deviations, half of a sole's length.
        sensors: Figures of the sensors: errors of the joints' zero positions.
    """
    model = robot_model.model
    robot_model.update(qpos, np.zeros(model.nv))
    left, right = (
        robot_model.point_jacobian(foot, robot_model.feet[foot].position)[:, 6:]
        for foot in (0, 1)
    )
    com = np.empty((3, model.nv))
    mujoco.mj_jacSubtreeCom(model, robot_model.data, com, 0)
    apart, turned = (left - right)[[1, 5]]
    turned *= settings.forces.cop_half_length_m
    deviations = settings.planner.encoder_deviations

    def margin(*levers: Array) -> float:
        worst = max(math.sqrt(float(lever @ lever)) for lever in levers)
        return deviations * sensors.encoder_bias * worst

    along, across = (
        margin(*(com[axis, 6:] - foot[axis] for foot in (left, right)))
        for axis in (0, 1)
    )
    return CalibrationMargins(margin(apart + turned, apart - turned), (along, across))
