r"""Bias of the ball's gyro from soles that roll on the ball without slip.

Contacts and soles tell where the ball's centre is under the trunk, without any gyro.
Velocities tell how that place moves, and a wrong angular velocity of the ball takes it
elsewhere: its bias is what explains the difference. About the vertical a standing sole
turns with the ball, and friction on the floor keeps the ball from spinning: that tells
the gyros' biases about it, in the long run.
"""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.corrections import LEVEL, correct
from ballsim_controllers.estimation.error_covariance import (
    N_ERRORS,
    PLACE,
    TILT,
    weigh,
)
from ballsim_controllers.geometry import apply_transposed
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.sensor_figures import SensorFigures

__all__ = ["make_level", "roll", "spin"]

# What turns all the same, [rad/s/sqrt(Hz)].
_SOLE_SPIN = 0.01  # a sole on the ball, about the normal
_BALL_SPIN = 0.005  # the ball on the floor, about the vertical


def make_level(dt: float, figures: SensorFigures) -> Record:
    """Return the state before the first reading, shape (1,), dtype `LEVEL`.

    Args:
        dt: Control period, [s].
        figures: What the sensors are said to be.
    """
    levels: Record = np.zeros(1, LEVEL)
    trunk, ball = figures.gyro_noise**2, figures.ball_gyro_noise**2
    biases = [figures.gyro_bias**2, figures.ball_gyro_bias**2]
    levels["dt"] = dt
    levels["spin_covariance"] = np.diag(biases)
    levels["spin_process"] = (
        dt * figures.gyro_walk**2,
        dt * figures.ball_gyro_walk**2,
    )
    levels["spin_noise"] = (
        (_SOLE_SPIN**2 + trunk + ball) / dt,
        (_BALL_SPIN**2 + ball) / dt,
    )
    return levels


@compiled
def roll(
    levels: Record,
    tilts: Record,
    balls: Record,
    covariances: Record,
    place: Array,
    trunk_velocity: Array,
    height: float,
    confidence: float,
) -> None:
    """Roll the trunk's place on and correct it by the measured one (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`.
        tilts: Shape (1,), dtype `TILT_STATE`.
        balls: State of the ball's estimator.
        covariances: Shape (1,), dtype `COVARIANCE`.
        place: Of the trunk over the ball's centre, as contacts and soles tell, (3,).
        trunk_velocity: Mean of the trunk's origin since the last reading, (3,), [m/s].
        height: Of the trunk's origin over the ball's centre, [m].
        confidence: Of the contacts, 0 to 1.
    """
    state, ball = levels[0], balls[0]
    if state["has_place"] == 0:
        if confidence > 0.0:
            state["has_place"] = 1
            state["place"][:] = place[:2]
        return
    innovation = np.empty(2)
    for j in range(2):
        moved = trunk_velocity[j] - ball["mean_linear_velocity"][j]
        state["place"][j] += state["dt"] * moved
        innovation[j] = place[j] - state["place"][j]
    if confidence <= 0.0:
        return
    rows = np.zeros(N_ERRORS)
    rows[PLACE], rows[TILT] = 1.0, -height
    variance = covariances[0]["place_variance"] / confidence
    correct(
        tilts,
        levels,
        balls,
        weigh(covariances, rows, variance, True),
        innovation,
    )


@compiled
def spin(
    levels: Record, tilts: Record, balls: Record, turning: float, confidence: float
) -> None:
    """Correct both gyros' biases about the vertical (in place).

    Standing soles turn with the ball, and the ball does not spin on the floor.

    Args:
        levels: Shape (1,), dtype `LEVEL`.
        tilts: Shape (1,), dtype `TILT_STATE`.
        balls: State of the ball's estimator.
        turning: Angular velocity of soles against the ball, [rad/s].
        confidence: Of the contacts, 0 to 1.
    """
    state, tilt, ball = levels[0], tilts[0], balls[0]
    P = state["spin_covariance"]
    P[0, 0] += state["spin_process"][0]
    P[1, 1] += state["spin_process"][1]
    soles, floor = state["spin_noise"]
    if confidence > 0.0:
        row = np.array([1.0, -1.0])
        _turn(state, tilt, ball, row, turning, soles / confidence)
    row = np.array([0.0, 1.0])
    _turn(state, tilt, ball, row, ball["angular_velocity"][2], floor)


@compiled
def _turn(
    state: Record,
    tilt: Record,
    ball: Record,
    row: Array,
    rate: float,
    variance: float,
) -> None:
    """Correct the biases of trunk and ball by a rate that would be 0 without them."""
    P = state["spin_covariance"]
    seen = np.empty(2)
    for i in range(2):
        seen[i] = P[i, 0] * row[0] + P[i, 1] * row[1]
    total = row[0] * seen[0] + row[1] * seen[1] + variance
    up = np.array([0.0, 0.0, seen[0] / total * rate])
    tilt["gyro_bias"] += apply_transposed(tilt["rotation"], up)
    up[2] = seen[1] / total * rate
    ball["bias"] += apply_transposed(ball["rotation"], up)
    for i in range(2):
        for j in range(2):
            P[i, j] -= seen[i] * seen[j] / total
