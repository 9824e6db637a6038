"""Attitude and velocity of the trunk: IMU fused with leg odometry."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.corrections import correct
from ballsim_controllers.estimation.error_covariance import (
    LEAD,
    N_ERRORS,
    VELOCITY,
    loosen,
    weigh,
)
from ballsim_controllers.geometry import apply, clip, integrate_rotation
from ballsim_controllers.messages import Array, Record

__all__ = ["correct_tilt", "predict_tilt"]

_BIAS_RATE = 0.2  # at which the vertical bias follows, [1/s]
_MAX_BIAS = 1.0  # [m/s^2]
_UNKNOWN_SPEED = 0.3  # of feet that touch nothing, [m/sqrt(s)]


@compiled
def predict_tilt(
    states: Record, gyro: Array, specific_force: Array, dt: float, gravity: float
) -> None:
    """Advance attitude and velocity by one period with the IMU (in place).

    Means of two readings hold between them. The first reading only starts it.

    Args:
        states: Shape (1,), dtype `TILT_STATE`.
        gyro: Angular velocity of the trunk, in the trunk, (3,), [rad/s].
        specific_force: Accelerometer, in the trunk, (3,), [m/s^2].
        dt: Time since the last reading, [s].
        gravity: g, [m/s^2].
    """
    state = states[0]
    last = state["gyro"]
    is_first = state["has_started"] == 0
    if not is_first:
        mean = np.empty(3)
        for i in range(3):
            mean[i] = 0.5 * (last[i] + gyro[i])
        state["rotation"][:] = integrate_rotation(state["rotation"], mean, dt)
    state["has_started"] = 1
    last[:] = gyro
    acceleration = apply(state["rotation"], specific_force)
    acceleration[2] -= gravity
    for i in range(3):
        state["last_velocity"][i] = state["velocity"][i]
        if not is_first:
            before = state["acceleration"][i]
            state["velocity"][i] += dt * 0.5 * (before + acceleration[i])
    state["acceleration"][:] = acceleration


@compiled
def correct_tilt(
    states: Record,
    levels: Record,
    balls: Record,
    covariances: Record,
    velocity: Array,
    confidence: float,
    dt: float,
) -> None:
    r"""Correct with the velocity that the standing legs measure (in place).

    The IMU predicts, leg odometry corrects: a tilt error turns the measured specific
    force and shows up as a growing velocity error,

    .. math:: \delta \dot v = \delta\theta \times g e_z,

    which makes tilt observable without mistaking acceleration for gravity. What is
    compared are places, the sums of velocities: joint velocities are differences of
    angles, whose noise adds up to nothing. Heading is not observable and is only
    integrated.

    Args:
        states: Shape (1,), dtype `TILT_STATE`.
        levels: See `correct`, as the next one.
        balls: State of the ball's estimator.
        covariances: Shape (1,), dtype `COVARIANCE`.
        velocity: Mean of the IMU since the last reading, in the world, (3,), [m/s].
        confidence: 0 to 1; scales the information of the measurement.
        dt: Time since the last reading, [s].
    """
    state = states[0]
    if confidence <= 0.0:
        loosen(covariances, LEAD, dt * _UNKNOWN_SPEED**2)
        return
    lead = state["lead"]
    innovation = np.empty(2)
    for i in range(3):
        moved = 0.5 * (state["last_velocity"][i] + state["velocity"][i])
        lead[i] += dt * (velocity[i] - moved)
        if i < 2:
            innovation[i] = lead[i]
    rows = np.zeros(N_ERRORS)
    rows[LEAD] = 1.0
    variance = covariances[0]["leg_variance"] / confidence
    gains = weigh(covariances, rows, variance, False)
    # Upwards the same gains serve; gravity's part of the bias shows at once.
    up = lead[2]
    lead[2] -= gains[LEAD] * up
    state["velocity"][2] += gains[VELOCITY] * up
    bias = state["accelerometer_bias"]
    found = bias[2] - _BIAS_RATE * gains[VELOCITY] * up
    bias[2] = clip(found, -_MAX_BIAS, _MAX_BIAS)
    correct(states, levels, balls, gains, innovation)
