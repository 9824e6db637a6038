"""What the filters keep, and how a correction along the horizontal axes changes it."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.error_covariance import (
    ACCELEROMETER_BIAS,
    BALL_BIAS,
    COM_OFFSET,
    FORCE_LEAD,
    FORCE_VELOCITY,
    GYRO_BIAS,
    LEAD,
    PLACE,
    TILT,
    VELOCITY,
)
from ballsim_controllers.geometry import (
    apply_transposed,
    multiply,
    rotation_from_vector,
)
from ballsim_controllers.messages import Array, Record

__all__ = ["LEVEL", "N_HEADING_ERRORS", "TILT_STATE", "correct"]

#: Trunk to world, velocity of the IMU in the world now and before the last prediction,
#: last angular velocity in the trunk and acceleration in the world, what leg odometry
#: is ahead of the IMU's place, [m], and biases of gyro and accelerometer in the trunk.
TILT_STATE = np.dtype(
    [
        ("has_started", np.int64),
        ("rotation", np.float64, (3, 3)),
        ("velocity", np.float64, 3),
        ("last_velocity", np.float64, 3),
        ("gyro", np.float64, 3),
        ("acceleration", np.float64, 3),
        ("lead", np.float64, 3),
        ("gyro_bias", np.float64, 3),
        ("accelerometer_bias", np.float64, 3),
    ]
)
#: Errors that `heading` names.
N_HEADING_ERRORS = 23

#: Velocity of the CoM that the forces explain, [m/s], what the legs' place is ahead of
#: theirs, [m], both horizontal in the world; the trunk's rolled place over the ball,
#: [m]; the CoM's offset from where the model has it, in the trunk, [m]. Of
#: `floor_balance`: the ball's momentum about its foot over its velocity and the robot's
#: mass, [m], gains, the momentum that the CoM's place explains over the weight, [m s],
#: how far the robot is from where contacts place it, in the world, [m]. Of `heading`:
#: whether a gyro is not perfect, the ball's mean rate about the horizontal axes of the
#: world, [rad/s], and whether it rolls by that, a place of its own, [m], by how much
#: the ball and soles on it seem to have turned, [rad], for how long these have stood,
#: less than 0 where they slip, [s], covariance of its errors, what adds to it in a
#: period, and what soles that step do, variances of place, of the ball's turn, and of
#: such soles'.
LEVEL = np.dtype(
    [
        ("has_started", np.int64),
        ("dt", np.float64),
        ("velocity", np.float64, 2),
        ("lead", np.float64, 2),
        ("has_place", np.int64),
        ("place", np.float64, 2),
        ("com_offset", np.float64, 2),
        ("ball_lever", np.float64),
        ("momentum_gain", np.float64),
        ("offset_gain", np.float64),
        ("floor_momentum", np.float64, 2),
        ("offset", np.float64, 2),
        ("radius", np.float64),
        ("heading_is_uncertain", np.int64),
        ("mean_rolling", np.float64, 2),
        ("ball_is_rolling", np.int64),
        ("heading_place", np.float64, 2),
        ("spin", np.float64),
        ("pivot", np.float64),
        ("stood", np.float64),
        ("heading_covariance", np.float64, (N_HEADING_ERRORS, N_HEADING_ERRORS)),
        ("heading_process", np.float64, N_HEADING_ERRORS),
        ("sole_creep", np.float64),
        ("heading_variances", np.float64, 3),
    ]
)


@compiled
def correct(
    tilts: Record, levels: Record, balls: Record, gains: Array, innovation: Array
) -> None:
    """Change the estimates by gains times a horizontal innovation (in place).

    Args:
        tilts: Shape (1,), dtype `TILT_STATE`.
        levels: Shape (1,), dtype `LEVEL`.
        balls: State of the ball's estimator, shape (1,), dtype `BALL_STATE`.
        gains: Of each error, shape (10,), see `error_covariance`.
        innovation: In the world, shape (2,), [m].
    """
    tilt, lvl, ball = tilts[0], levels[0], balls[0]
    x, y = innovation[0], innovation[1]
    for j in range(2):
        z = innovation[j]
        tilt["lead"][j] -= gains[LEAD] * z
        tilt["velocity"][j] += gains[VELOCITY] * z
        lvl["lead"][j] -= gains[FORCE_LEAD] * z
        lvl["velocity"][j] += gains[FORCE_VELOCITY] * z
        lvl["place"][j] += gains[PLACE] * z
    # A vector (x, y) that is turned like the tilt stands for the rotation (-y, x).
    rotation, k = tilt["rotation"], gains[GYRO_BIAS]
    tilt["gyro_bias"] += apply_transposed(rotation, np.array([-k * y, k * x, 0.0]))
    k = gains[ACCELEROMETER_BIAS]
    tilt["accelerometer_bias"] += apply_transposed(
        rotation, np.array([k * x, k * y, 0.0])
    )
    if lvl["ball_is_rolling"] == 0:  # else `heading` finds it, and scale and axes
        k, attitude = gains[BALL_BIAS], ball["rotation"]
        ball["bias"] += apply_transposed(attitude, np.array([-k * y, k * x, 0.0]))
    k = gains[COM_OFFSET]
    aside = apply_transposed(rotation, np.array([k * x, k * y, 0.0]))
    lvl["com_offset"][0] += aside[0]
    lvl["com_offset"][1] += aside[1]
    k = gains[TILT]
    turn = rotation_from_vector(np.array([-k * y, k * x, 0.0]))
    tilt["rotation"][:] = multiply(turn, rotation)
