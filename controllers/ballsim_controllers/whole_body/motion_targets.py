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
from ballsim_controllers.native import view_2d

__all__ = ["predict_motion"]


@compiled
def predict_motion(
    estimates: Record,
    robots: Record,
    bodies: Record,
    radius: float,
    horizon: float,
) -> tuple[Array, Array, Array, Array]:
    """Carry the present motion on with the accelerations of the force distribution.

    So the two roads to the joints agree; only a loaded sole is aimed at the place
    where, rolling without slip, it meets the ball at the commanded contact. The IK
    takes its way for a straight line in joint space: what a swinging sole accelerates
    without its joints doing so is left out.

    Args:
        estimates: State estimate, shape (1,), dtype `ESTIMATE`.
        robots: The robot, shape (1,), dtype of `robot_dtype`.
        bodies: Accelerations and forces, shape (1,), dtype of `body_dtype`.
        radius: Radius of the ball, [m].
        horizon: How far ahead, [s].

    Returns:
        CoM, shape (3,); sole centres, shape (2, 3), and soles to world, shape
        (2, 3, 3); trunk to world, shape (3, 3).
    """
    estimate, robot, body = estimates[0], robots[0], bodies[0]
    half, feet, contacts = 0.5 * horizon * horizon, robot["feet"], body["contacts"]
    com = np.empty(3)
    for i in range(3):
        acceleration = (body["forces"][0, i] + body["forces"][1, i]) / robot["mass"]
        acceleration -= robot["gravity"] if i == 2 else 0.0
        com[i] = (
            estimate["position_com_in_world"][i]
            + horizon * estimate["linear_velocity_com_in_world"][i]
            + half * acceleration
        )
    positions, rotations = np.empty((2, 3)), np.empty((2, 3, 3))
    for i in range(2):
        if body["shares"][i] > 0.0:
            _roll_sole(
                positions[i],
                rotations[i],
                estimate,
                feet["position"][i],
                feet["rotation"][i],
                contacts[i],
                radius,
                horizon,
            )
            continue
        turn = np.empty(3)
        for j in range(3):
            positions[i, j] = (
                feet["position"][i, j]
                + horizon * feet["linear_velocity"][i, j]
                + half * (body["soles"][i, j] - body["sole_biases"][i, j])
            )
            turn[j] = horizon * feet["angular_velocity"][i, j] + half * (
                body["soles"][i, 3 + j] - body["sole_biases"][i, 3 + j]
            )
        rotations[i] = multiply(rotation_from_vector(turn), feet["rotation"][i])
    turn = np.empty(3)
    for j in range(3):
        turn[j] = (
            horizon * estimate["angular_velocity_trunk_in_trunk"][j]
            + half * body["accelerations"][3 + j]
        )
    attitudes = view_2d(robot["xmat"], robot["n_bodies"], 9)
    present = attitudes[robot["trunk_body"]].reshape(3, 3)
    trunk = multiply(present, rotation_from_vector(turn))
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
