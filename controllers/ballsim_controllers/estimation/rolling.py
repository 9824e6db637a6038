r"""Errors that show where soles roll on the ball without slip.

Contacts and soles tell where the ball's centre is under the trunk, without any gyro.
Velocities tell how that place moves, and a wrong angular velocity of the ball takes it
elsewhere. What the difference tells of tilt, velocity and leads is found here, and of
the bias of the ball's gyro as long as the ball stays where it is. What it tells of
directions, and of that gyro once the ball rolls, is found in `heading`, which has a
place of its own: a bias that seems to carry the ball aside may be a heading that is
off. The covariance here takes the bias for found all the same.
"""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.corrections import LEVEL, correct
from ballsim_controllers.estimation.error_covariance import (
    BALL_BIAS,
    N_ERRORS,
    PLACE,
    TILT,
    Levers,
    weigh,
)
from ballsim_controllers.estimation.heading import correct_heading, prepare_heading
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.sensor_figures import SensorFigures

__all__ = ["make_level", "roll"]


def make_level(dt: float, figures: SensorFigures, levers: Levers) -> Record:
    """Return the state before the first reading, shape (1,), dtype `LEVEL`.

    Args:
        dt: Control period, [s].
        figures: What the sensors are said to be.
        levers: Heights in the nominal stance.
    """
    levels: Record = np.zeros(1, LEVEL)
    levels["dt"] = dt
    prepare_heading(levels, figures, levers)
    return levels


@compiled
def roll(
    levels: Record,
    tilts: Record,
    balls: Record,
    covariances: Record,
    fusion: Record,
    trunk_velocity: Array,
    height: float,
) -> None:
    """Roll the trunk's place on and correct it by the measured one (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`.
        tilts: Shape (1,), dtype `TILT_STATE`.
        balls: State of the ball's estimator.
        covariances: Shape (1,), dtype `COVARIANCE`.
        fusion: What contacts and soles tell, see `legs.FUSION`.
        trunk_velocity: Mean of the trunk's origin since the last reading, (3,), [m/s].
        height: Of the trunk's origin over the ball's centre, [m].
    """
    state, ball = levels[0], balls[0]
    place, confidence = fusion["place"], fusion["confidence"]
    if state["has_place"] == 0:
        if confidence > 0.0:
            state["has_place"] = 1
            state["place"][:] = state["heading_place"][:] = place[:2]
        return
    correct_heading(
        levels,
        tilts,
        balls,
        place,
        trunk_velocity,
        fusion["turning"],
        fusion["both_bear"] == 1,
        confidence,
        covariances[0]["P"][BALL_BIAS, BALL_BIAS],
    )
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
