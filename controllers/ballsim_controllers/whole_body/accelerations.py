"""What trunk, CoM and soles shall do at this instant: PD laws on their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import (
    apply_transposed,
    clip,
    cross,
    rotation_from_vector,
    rotation_vector_between,
    sole_rotation_on_ball,
)
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.native import view_1d, view_2d
from ballsim_controllers.settings import ForceSettings

__all__ = [
    "WholeBodyAccelerations",
    "contact_acceleration",
    "find_touching_points",
    "make_gains",
    "wanted_accelerations",
]

_GAINS = np.dtype([(field.name, np.float64) for field in fields(ForceSettings)])


@dataclass(frozen=True, slots=True)
class WholeBodyAccelerations:
    """What the body shall do at this instant.

    Attributes:
        trunk_angular: Angular acceleration of the trunk, in the trunk, (3,),
            [rad/s^2].
        com_vertical: Vertical acceleration of the CoM, [m/s^2].
        horizontal_force: Contact force of the inverted pendulum, (2,), [N].
        soles: Linear and angular acceleration in the world of each foot: at the
            contact point for a standing foot, at the sole's centre for a swing
            foot, shape (2, 6), [m/s^2] and [rad/s^2].
        upper_joints: Accelerations of the joints that are not in the legs,
            [rad/s^2].
    """

    trunk_angular: Array
    com_vertical: float
    horizontal_force: Array
    soles: Array
    upper_joints: Array


def make_gains(settings: ForceSettings) -> Record:
    """Return the settings as a record, shape (1,), for the compiled functions."""
    gains: Record = np.zeros(1, _GAINS)
    for field in fields(settings):
        gains[field.name] = getattr(settings, field.name)
    return gains


@compiled
def find_touching_points(feet: Record, position_ball: Array, shares: Array) -> Array:
    """Return where each sole is nearest to the ball, shape (2, 3), [m].

    The sole's centre for a foot that carries nothing.

    Args:
        feet: Pose of the soles, dtype `FEET`.
        position_ball: Ball's centre in the world, shape (3,), [m].
        shares: Share of the load per foot, shape (2,).
    """
    points = np.empty((2, 3))
    for i in range(2):
        position, rotation = feet["position"][i], feet["rotation"][i]
        offset = apply_transposed(rotation, position_ball - position)
        if shares[i] <= 0.0:
            offset[:] = 0.0
        for j in range(3):
            points[i, j] = (
                position[j] + rotation[j, 0] * offset[0] + rotation[j, 1] * offset[1]
            )
    return points


@compiled
def contact_acceleration(
    contact: Array,
    floor_contact: Array,
    angular_acceleration_ball: Array,
    slip_velocity: Array,
    slip_gain: float,
) -> Array:
    """Return the acceleration of the ball's surface at a contact.

    Args:
        contact: Contact point in the world, shape (3,), [m].
        floor_contact: Where the ball touches the floor, shape (3,), [m].
        angular_acceleration_ball: In the world, shape (3,), [rad/s^2].
        slip_velocity: Velocity of the foot's point over the ball's surface,
            shape (3,), [m/s].
        slip_gain: Rate at which slip shall vanish, [1/s].

    Returns:
        Acceleration for the foot's contact point, shape (3,), [m/s^2].
    """
    surface = cross(angular_acceleration_ball, contact - floor_contact)
    return surface - slip_gain * slip_velocity


@compiled
def wanted_accelerations(
    gain: Record,
    estimate: Record,
    robot: Record,
    radius: float,
    com_height: float,
    heading: float,
    ball_acceleration: Array,
    stance: tuple[bool, bool],
    swing: Record,
    touching: Array,
    contacts: Array,
    shares: Array,
) -> tuple[Array, float, Array, Array, Array]:
    """Return the fields of `WholeBodyAccelerations`.

    Args:
        gain: The settings, from `make_gains`.
        estimate: State estimate, dtype `ESTIMATE`.
        robot: The robot, dtype of `robot_dtype`.
        radius: Radius of the ball, [m].
        com_height: Wanted height of the CoM over the ball's top, [m].
        heading: Direction of the trunk about the vertical, [rad].
        ball_acceleration: Of the ball's centre, predicted, shape (2,), [m/s^2].
        stance: Which feet shall stand (left, right).
        swing: Reference of the swinging sole, dtype `SWING`.
        touching: Where each sole meets the ball, shape (2, 3), [m].
        contacts: Where the forces shall act, shape (2, 3), [m].
        shares: Share of the load per foot, shape (2,).
    """
    com, feet, nv = estimate["position_com_in_world"], robot["feet"], robot["nv"]
    vertical = _vertical_acceleration(gain, estimate, com_height, radius)
    ball_alpha = np.array(
        [-ball_acceleration[1] / radius, ball_acceleration[0] / radius, 0.0]
    )
    soles = np.zeros((2, 6))
    for i in range(2):
        if shares[i] > 0.0:
            _hold_contact(soles[i], gain, estimate, feet, i, touching[i], ball_alpha)
        elif stance[i]:
            _return_to_ball(soles[i], gain, estimate, feet, i, ball_alpha, radius)
        else:
            _follow_swing(soles[i], gain, feet, i, swing, ball_acceleration)
    height = com[2] - (shares[0] * contacts[0, 2] + shares[1] * contacts[1, 2])
    push = np.empty(2)
    for i in range(2):
        cop = shares[0] * contacts[0, i] + shares[1] * contacts[1, i]
        weight = robot["mass"] * (robot["gravity"] + vertical)
        push[i] = weight * (com[i] - cop) / height
    qpos, qvel = view_1d(robot["qpos"], nv + 1), view_1d(robot["qvel"], nv)
    joints = np.empty(len(robot["upper"]))
    for i in range(len(joints)):
        dof = robot["upper"][i]
        error = robot["nominal_upper"][i] - qpos[dof + 1]
        joints[i] = gain["posture_stiffness"] * error
        joints[i] -= gain["posture_damping"] * qvel[dof]
    rotation = view_2d(robot["xmat"], robot["n_bodies"], 9)[robot["trunk_body"]]
    trunk = _trunk_acceleration(gain, estimate, rotation.reshape(3, 3), heading)
    return trunk, vertical, push, soles, joints


@compiled
def _trunk_acceleration(
    gain: Record, estimate: Record, rotation_trunk: Array, heading: float
) -> Array:
    """Return the angular acceleration that brings the trunk upright, in the trunk."""
    upright = rotation_from_vector(np.array([0.0, 0.0, heading]))
    error = apply_transposed(
        rotation_trunk, rotation_vector_between(rotation_trunk, upright)
    )
    omega = estimate["angular_velocity_trunk_in_trunk"]
    result = np.empty(3)
    for i in range(3):
        stiffness = gain["trunk_stiffness"] if i < 2 else gain["yaw_stiffness"]
        damping = gain["trunk_damping"] if i < 2 else gain["yaw_damping"]
        result[i] = stiffness * error[i] - damping * omega[i]
    return result


@compiled
def _vertical_acceleration(
    gain: Record, estimate: Record, com_height: float, radius: float
) -> float:
    """Return the CoM's vertical acceleration, limited, [m/s^2]."""
    top = estimate["position_ball_in_world"][2] + radius
    error = com_height + top - estimate["position_com_in_world"][2]
    velocity = estimate["linear_velocity_com_in_world"][2]
    limit = gain["max_com_acceleration_m_s2"]
    return clip(
        gain["height_stiffness"] * error - gain["height_damping"] * velocity,
        -limit,
        limit,
    )


@compiled
def _hold_contact(
    result: Array,
    gain: Record,
    estimate: Record,
    feet: Record,
    foot: int,
    point: Array,
    ball_alpha: Array,
) -> None:
    """Write the acceleration of a loaded sole: it keeps to the ball's surface."""
    ball = estimate["position_ball_in_world"]
    floor = np.array([ball[0], ball[1], 0.0])
    omega = feet["angular_velocity"][foot]
    surface = cross(estimate["angular_velocity_ball_in_world"], point - floor)
    turning = cross(omega, point - feet["position"][foot])
    slip = feet["linear_velocity"][foot] + turning - surface
    result[:3] = contact_acceleration(point, floor, ball_alpha, slip, gain["slip_gain"])
    for i in range(3):
        result[3 + i] = -gain["stance_rotation_damping"] * omega[i]


@compiled
def _return_to_ball(
    result: Array,
    gain: Record,
    estimate: Record,
    feet: Record,
    foot: int,
    ball_alpha: Array,
    radius: float,
) -> None:
    """Write the acceleration of a sole that should stand but does not touch."""
    ball, position = estimate["position_ball_in_world"], feet["position"][foot]
    rotation = feet["rotation"][foot]
    normal = position - ball
    distance = (normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2) ** 0.5
    normal /= distance
    lever = position - np.array([ball[0], ball[1], 0.0])
    surface = cross(estimate["angular_velocity_ball_in_world"], lever)
    carried = cross(ball_alpha, lever)
    gap = max(distance - radius, 0.0)
    heading = math.atan2(rotation[1, 0], rotation[0, 0])
    tangent = sole_rotation_on_ball(normal, heading)
    turn = rotation_vector_between(rotation, tangent)
    for i in range(3):
        wanted = surface[i] - gain["landing_speed_m_s"] * normal[i]
        result[i] = (
            carried[i]
            + gain["swing_damping"] * (wanted - feet["linear_velocity"][foot, i])
            - gain["swing_stiffness"] * gap * normal[i]
        )
        result[3 + i] = (
            gain["swing_rotation_stiffness"] * turn[i]
            - gain["swing_rotation_damping"] * feet["angular_velocity"][foot, i]
        )


@compiled
def _follow_swing(
    result: Array,
    gain: Record,
    feet: Record,
    foot: int,
    swing: Record,
    ball_acceleration: Array,
) -> None:
    """Write the acceleration of a swinging sole: it follows its reference."""
    turn = rotation_vector_between(feet["rotation"][foot], swing["rotation"])
    for i in range(3):
        result[i] = (
            swing["linear_acceleration"][i]
            + gain["swing_stiffness"]
            * (swing["position"][i] - feet["position"][foot, i])
            + gain["swing_damping"]
            * (swing["linear_velocity"][i] - feet["linear_velocity"][foot, i])
        )
        if i < 2:
            result[i] += ball_acceleration[i]
        result[3 + i] = (
            gain["swing_rotation_stiffness"] * turn[i]
            + gain["swing_rotation_damping"]
            * (swing["angular_velocity"][i] - feet["angular_velocity"][foot, i])
            + swing["angular_acceleration"][i]
        )
