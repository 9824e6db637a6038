"""Contact of each sole with the ball from the ankle's force-torque sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import apply, apply_transposed, clip, cross
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.robot_model import RobotModel

__all__ = [
    "CONTACT",
    "FOOT_PARAMETERS",
    "ContactEstimator",
    "FootContact",
    "clear_contact",
    "estimate_contact",
    "place_loads",
]

#: One foot's contact, fields as in `FootContact`.
CONTACT = np.dtype(
    [
        ("force", np.float64, 3),
        ("normal_force", np.float64),
        ("offset", np.float64, 2),
        ("confidence", np.float64),
    ]
)
#: What the contact of one foot depends on: its weight, half sizes of the sole,
#: and the thresholds of `ContactEstimator`.
FOOT_PARAMETERS = np.dtype(
    [
        ("weight", np.float64),
        ("half_length", np.float64),
        ("half_width", np.float64),
        ("full_load", np.float64),
        ("edge_margin", np.float64),
    ]
)


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


class ContactEstimator:
    """Takes the foot's weight from the ankle's wrench and finds the CoP.

    A flat sole touches the ball in one point, so the CoP is that point, and
    the ball's centre lies one radius below it along the sole's normal, unless
    the contact is at the sole's edge.

    Args:
        robot_model: Supplies the feet's masses and poses.
        full_load: Normal force from which the CoP is fully trusted, [N].
        edge_margin: Distance from the edge below which it is trusted less, [m].

    Attributes:
        parameters: Of both feet, shape (2,), dtype `FOOT_PARAMETERS`.
    """

    def __init__(
        self,
        robot_model: RobotModel,
        full_load: float = 60.0,
        edge_margin: float = 0.004,
    ) -> None:
        """Keep the parameters."""
        self._robot = robot_model
        robot = robot_model.robot
        self.parameters: Record = np.zeros(2, FOOT_PARAMETERS)
        self.parameters["weight"] = (
            np.array(robot_model.foot_masses) * robot_model.gravity
        )
        self.parameters["half_length"] = robot.sole_half_length
        self.parameters["half_width"] = robot.sole_half_width
        self.parameters["full_load"] = full_load
        self.parameters["edge_margin"] = edge_margin

    def estimate(self, foot: int, force: Array, torque: Array) -> FootContact:
        """Return the contact of one foot for the robot model's present pose.

        Args:
            foot: 0 = left, 1 = right.
            force: Sensor's force (shank on foot), in the sensor, (3,), [N].
            torque: Sensor's torque about its origin, in the sensor, [N m].

        Returns:
            The contact.
        """
        robot, data = self._robot, self._robot.data
        contacts: Record = np.zeros(1, CONTACT)
        site = robot.wrench_ids[foot]
        estimate_contact(
            contacts[0],
            force,
            torque,
            data.site_xpos[site],
            data.site_xmat[site].reshape(3, 3),
            data.xipos[robot.foot_body_ids[foot]],
            robot.feet[foot].position,
            robot.feet[foot].rotation,
            self.parameters[foot],
        )
        contact = contacts[0]
        return FootContact(
            contact["force"],
            float(contact["normal_force"]),
            contact["offset"],
            float(contact["confidence"]),
        )


@compiled
def clear_contact(contact: Record) -> None:
    """Write the contact of a foot that is away from the ball (in place)."""
    contact["force"][:] = 0.0
    contact["normal_force"] = 0.0
    contact["offset"][:] = 0.0
    contact["confidence"] = 0.0


@compiled
def estimate_contact(
    contact: Record,
    force: Array,
    torque: Array,
    sensor_position: Array,
    rotation_sensor_to_world: Array,
    position_com_foot: Array,
    position_sole: Array,
    rotation_sole_to_world: Array,
    parameters: Record,
) -> None:
    """Write the contact of one foot (in place).

    The foot is taken to be at rest: shank, ball and weight are in balance.

    Args:
        contact: The contact, dtype `CONTACT`.
        force: Sensor's force (shank on foot), in the sensor, (3,), [N].
        torque: Sensor's torque about its origin, in the sensor, [N m].
        sensor_position: Origin of the sensor, shape (3,), [m].
        rotation_sensor_to_world: Shape (3, 3).
        position_com_foot: The foot's own CoM, shape (3,), [m].
        position_sole: Centre of the sole, shape (3,), [m].
        rotation_sole_to_world: Shape (3, 3).
        parameters: Of the foot, dtype `FOOT_PARAMETERS`.
    """
    weight = np.array([0.0, 0.0, -parameters["weight"]])
    shank_force = apply(rotation_sensor_to_world, force)
    shank_torque = apply(rotation_sensor_to_world, torque)
    ball_force = -shank_force - weight
    moment = (
        -shank_torque
        - cross(sensor_position - position_sole, shank_force)
        - cross(position_com_foot - position_sole, weight)
    )
    local_force = apply_transposed(rotation_sole_to_world, ball_force)
    local_moment = apply_transposed(rotation_sole_to_world, moment)
    normal = local_force[2]
    contact["force"][:] = ball_force
    contact["normal_force"] = max(normal, 0.0)
    contact["offset"][:] = 0.0
    contact["confidence"] = 0.0
    if normal < 1.0:
        return
    length, width = parameters["half_length"], parameters["half_width"]
    x = clip(-local_moment[1] / normal, -length, length)
    y = clip(local_moment[0] / normal, -width, width)
    contact["offset"][0], contact["offset"][1] = x, y
    margin = min(length - abs(x), width - abs(y))
    trust = clip(margin / parameters["edge_margin"], 0.01, 1.0)
    contact["confidence"] = min(normal / parameters["full_load"], 1.0) * trust


@compiled
def place_loads(
    estimate: Record, contacts: Record, feet: Record, position_ball: Array
) -> None:
    """Write contact points, normal forces and the CoP into an estimate.

    The contact of a foot that does not touch is the point of its sole next to the
    ball; the CoP of a robot in the air is the ball's centre.

    Args:
        estimate: Dtype `ESTIMATE`.
        contacts: Contact of each foot, shape (2,), dtype `CONTACT`.
        feet: Pose of each sole in the world, shape (2,).
        position_ball: Ball's centre in the world, shape (3,), [m].
    """
    load = 0.0
    cop = np.zeros(2)
    for i in range(2):
        contact, rotation = contacts[i], feet["rotation"][i]
        position = feet["position"][i]
        x, y = contact["offset"][0], contact["offset"][1]
        if contact["normal_force"] <= 0.0:
            to_ball = apply_transposed(rotation, position_ball - position)
            x, y = to_ball[0], to_ball[1]
        for j in range(3):
            place = position[j] + rotation[j, 0] * x + rotation[j, 1] * y
            estimate["contacts_in_world"][i, j] = place
            if j < 2:
                cop[j] += contact["normal_force"] * place
        estimate["normal_forces"][i] = contact["normal_force"]
        load += contact["normal_force"]
    for j in range(2):
        estimate["cop_in_world"][j] = cop[j] / load if load > 1.0 else position_ball[j]
