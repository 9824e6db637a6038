"""Where CoM, soles and trunk will be after one period of the inverse kinematics."""

from __future__ import annotations

import math

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import (
    apply,
    apply_transposed,
    cross,
    multiply,
    rotation_from_vector,
    sole_rotation_on_ball,
)
from ballsim_controllers.messages import Array, Record

__all__ = ["predict_motion"]


@compiled
def predict_motion(
    estimates: Record,
    feet: Record,
    radius: float,
    mass: float,
    gravity: float,
    horizon: float,
    rotation_trunk: Array,
    sole_accelerations: Array,
    trunk_acceleration: Array,
    forces: Array,
    contacts: Array,
    shares: Array,
) -> tuple[Array, Array, Array, Array]:
    """Carry the present motion on with the accelerations of the force distribution.

    So the two roads to the joints agree; only a loaded sole is aimed at the place
    where, rolling without slip, it meets the ball at the commanded contact.

    Args:
        estimates: State estimate, shape (1,), dtype `ESTIMATE`.
        feet: Pose and motion of the soles, shape (1,), dtype `FEET`.
        radius: Radius of the ball, [m].
        mass: Mass of the robot, [kg].
        gravity: g, [m/s^2].
        horizon: How far ahead, [s].
        rotation_trunk: Trunk to world, shape (3, 3).
        sole_accelerations: Linear and angular, in the world, shape (2, 6).
        trunk_acceleration: Angular, in the trunk, shape (3,), [rad/s^2].
        forces: Force of the ball on each foot, shape (2, 3), [N].
        contacts: Where they act, shape (2, 3), [m].
        shares: Share of the load per foot, shape (2,).

    Returns:
        CoM, shape (3,); sole centres, shape (2, 3), and soles to world, shape
        (2, 3, 3); trunk to world, shape (3, 3).
    """
    estimate, half = estimates[0], 0.5 * horizon * horizon
    com = np.empty(3)
    for i in range(3):
        acceleration = (forces[0, i] + forces[1, i]) / mass
        acceleration -= gravity if i == 2 else 0.0
        com[i] = (
            estimate["position_com_in_world"][i]
            + horizon * estimate["linear_velocity_com_in_world"][i]
            + half * acceleration
        )
    positions, rotations = np.empty((2, 3)), np.empty((2, 3, 3))
    for i in range(2):
        if shares[i] > 0.0:
            _roll_sole(
                positions[i],
                rotations[i],
                estimate,
                feet[0]["position"][i],
                feet[0]["rotation"][i],
                contacts[i],
                radius,
                horizon,
            )
            continue
        turn = np.empty(3)
        for j in range(3):
            positions[i, j] = (
                feet[0]["position"][i, j]
                + horizon * feet[0]["linear_velocity"][i, j]
                + half * sole_accelerations[i, j]
            )
            turn[j] = (
                horizon * feet[0]["angular_velocity"][i, j]
                + half * sole_accelerations[i, 3 + j]
            )
        rotations[i] = multiply(rotation_from_vector(turn), feet[0]["rotation"][i])
    turn = np.empty(3)
    for j in range(3):
        turn[j] = (
            horizon * estimate["angular_velocity_trunk_in_trunk"][j]
            + half * trunk_acceleration[j]
        )
    trunk = multiply(rotation_trunk, rotation_from_vector(turn))
    return com, positions, rotations, trunk


@compiled
def _roll_sole(
    new_position: Array,
    new_rotation: Array,
    estimate: Record,
    position: Array,
    rotation: Array,
    contact: Array,
    radius: float,
    horizon: float,
) -> None:
    """Write the pose of a loaded sole after it has rolled to its contact."""
    ball = estimate["position_ball_in_world"]
    velocity = estimate["linear_velocity_ball_in_world"]
    offset = apply_transposed(rotation, contact - position)
    spin = cross(estimate["angular_velocity_ball_in_world"], contact - ball)
    normal = np.empty(3)
    for i in range(3):
        normal[i] = contact[i] + horizon * spin[i] - ball[i]
    normal /= (normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2) ** 0.5
    heading = math.atan2(rotation[1, 0], rotation[0, 0])
    new_rotation[:] = sole_rotation_on_ball(normal, heading)
    arm = apply(new_rotation, offset)
    for i in range(3):
        centre = ball[i] + horizon * velocity[i]
        new_position[i] = centre + radius * normal[i] - arm[i]
