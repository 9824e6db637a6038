"""Contact of each sole with the ball from the ankle's force-torque sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.geometry import cross
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel

__all__ = ["NO_CONTACT", "ContactEstimator", "FootContact"]


@dataclass(frozen=True, slots=True)
class FootContact:
    """One foot's contact.

    Attributes:
        force: Force of the ball on the foot, in the frame of the robot model's
            base position, shape (3,), [N].
        normal_force: Its component along the sole's normal, [N].
        offset: CoP in the sole, shape (2,), [m]; zero where nothing is carried.
        confidence: 0 (no load, or at the sole's edge) to 1.
    """

    force: Array
    normal_force: float
    offset: Array
    confidence: float


#: A foot that is away from the ball.
NO_CONTACT = FootContact(np.zeros(3), 0.0, np.zeros(2), 0.0)


class ContactEstimator:
    """Takes the foot's weight from the ankle's wrench and finds the CoP.

    A flat sole touches the ball in one point, so the CoP is that point, and
    the ball's centre lies one radius below it along the sole's normal, unless
    the contact is at the sole's edge.

    Args:
        robot_model: Supplies the feet's masses and poses.
        full_load: Normal force from which the CoP is fully trusted, [N].
        edge_margin: Distance from the edge below which it is trusted less, [m].
    """

    def __init__(
        self,
        robot_model: RobotModel,
        full_load: float = 60.0,
        edge_margin: float = 0.004,
    ) -> None:
        """Keep the parameters."""
        self._robot = robot_model
        self._full_load = full_load
        self._edge_margin = edge_margin
        robot = robot_model.robot
        self._half = np.array([robot.sole_half_length, robot.sole_half_width])

    def estimate(self, foot: int, force: Array, torque: Array) -> FootContact:
        """Return the contact of one foot for the robot model's present pose.

        Args:
            foot: 0 = left, 1 = right.
            force: Sensor's force (shank on foot), in the sensor, (3,), [N].
            torque: Sensor's torque about its origin, in the sensor, [N m].

        Returns:
            The contact.
        """
        robot = self._robot
        data = robot.data
        site = robot.wrench_ids[foot]
        rotation = data.site_xmat[site].reshape(3, 3)
        shank_force, shank_torque = rotation @ force, rotation @ torque
        weight = np.array([0.0, 0.0, -robot.foot_masses[foot] * robot.gravity])
        sole = robot.feet[foot]
        ball_force = -shank_force - weight
        moment = (
            -shank_torque
            - cross(data.site_xpos[site] - sole.position, shank_force)
            - cross(data.xipos[robot.foot_body_ids[foot]] - sole.position, weight)
        )
        local_force = sole.rotation.T @ ball_force
        local_moment = sole.rotation.T @ moment
        normal = float(local_force[2])
        if normal < 1.0:
            return FootContact(ball_force, max(normal, 0.0), np.zeros(2), 0.0)
        offset = np.array([-local_moment[1], local_moment[0]]) / normal
        inside = np.minimum(np.maximum(offset, -self._half), self._half)
        margin = float((self._half - np.abs(inside)).min())
        confidence = min(normal / self._full_load, 1.0)
        confidence *= min(max(margin / self._edge_margin, 0.01), 1.0)
        return FootContact(ball_force, normal, inside, confidence)
