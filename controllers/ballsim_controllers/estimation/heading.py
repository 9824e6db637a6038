r"""Heading of the trunk, from the direction in which the ball rolls.

Nothing tells the heading itself. But a gyro with a bias about the vertical turns the
estimated trunk away, and with it what the legs tell of the ball, while which way the
ball rolls its own gyro tells. Where the two disagree, the ball seems to roll out from
under the trunk sideways, and does not. The ball's own direction hardly drifts: friction
on the floor keeps it from spinning, and a bias of its gyro turns with it. By how much
the axes of that gyro are off nobody tells. Besides, a standing sole turns with the
ball: that tells of both gyros without rolling, but slowly, as soles pivot.

Errors are truth less estimate: of the trunk's place over the ball :math:`(q_x, q_y)`,
of its heading :math:`\psi`, of its gyro's bias about the vertical :math:`\beta`, of the
ball's attitude :math:`\varphi`, turned in the world, and of its gyro's bias :math:`b`,
in the world. With the ball's radius r, its velocity v and angular velocity
:math:`\omega`:

.. math::
    \dot q &= (v_y, -v_x) (\psi - \varphi_z) + r (-b_y, b_x), \quad
    \dot\psi = -\beta, \quad \dot\varphi = -b, \quad \dot b = \omega \times b

    0 &= \omega_z - (b - \varphi \times \omega)_z

The horizontal part of b is left to `rolling`, but it counts how uncertain it is
[Schmidt: Application of state-space methods to navigation problems, 1966]. Of gyros
that are said to be perfect nothing changes.
"""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.corrections import N_HEADING_ERRORS
from ballsim_controllers.estimation.error_covariance import Levers
from ballsim_controllers.geometry import (
    apply_transposed,
    multiply,
    rotation_from_vector,
)
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.sensor_figures import SensorFigures

__all__ = ["correct_heading", "prepare_heading"]

# After the place, (2,); both of the ball are vectors.
_HEADING, _BIAS, _BALL, _BALL_BIAS = 2, 3, 4, 7

_CONTACT = 5e-3  # of the first place over the ball, [m]
_PLACE = 3e-3  # of a place over the ball, [m/sqrt(Hz)]
_ROLLING = 7e-4  # of what it moves by, [m/sqrt(s)]
_ROLLING_RATE = 0.4  # at which the axes of the ball's gyro matter, [rad/s]
_STANCE_TIME = 4.0  # for which what encoders get wrong of a place lasts, [s]
# What turns all the same, [rad/s/sqrt(Hz)].
_SOLE_SPIN = 0.01  # a sole on the ball, about the normal
_BALL_SPIN = 5e-3  # the ball on the floor, about the vertical


def prepare_heading(levels: Record, figures: SensorFigures, levers: Levers) -> None:
    """Write what is uncertain before the first reading (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`, its control period set.
        figures: What the sensors are said to be.
        levers: Heights in the nominal stance.
    """
    s, dt = figures, float(levels["dt"][0])
    leg = levers.com_over_contact * 2.0**0.5 * s.encoder_bias
    start, growth = np.zeros(N_HEADING_ERRORS), np.zeros(N_HEADING_ERRORS)
    start[:2], growth[:2] = _CONTACT, np.hypot(_ROLLING, leg / _STANCE_TIME**0.5)
    growth[_HEADING] = s.gyro_noise
    start[_BIAS], growth[_BIAS] = s.gyro_bias, s.gyro_walk
    growth[_BALL:_BALL_BIAS] = s.ball_gyro_noise
    # Wrong axes act as a bias does, as long as the ball rolls about one axis.
    start[_BALL_BIAS:] = np.hypot(s.ball_gyro_bias, _ROLLING_RATE * s.ball_gyro_axes)
    growth[_BALL_BIAS:] = s.ball_gyro_walk
    levels["heading_covariance"] = np.diag(start**2)
    levels["heading_process"] = dt * growth**2
    gyros = s.gyro_noise**2 + s.ball_gyro_noise**2
    levels["heading_variances"] = (
        (_PLACE**2 + 2.0 * _STANCE_TIME * leg**2) / dt,
        (_SOLE_SPIN**2 + gyros) / dt,
        (_BALL_SPIN**2 + s.ball_gyro_noise**2) / dt,
    )
    levels["radius"] = levers.radius


@compiled
def correct_heading(
    levels: Record,
    tilts: Record,
    balls: Record,
    place: Array,
    trunk_velocity: Array,
    turning: float,
    confidence: float,
) -> None:
    """Correct directions and biases about the vertical (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`.
        tilts: Shape (1,), dtype `TILT_STATE`.
        balls: State of the ball's estimator.
        place: Of the trunk over the ball's centre, as contacts and soles tell, (3,).
        trunk_velocity: Mean of the trunk's origin since the last reading, (3,), [m/s].
        turning: Angular velocity of soles against the ball, [rad/s].
        confidence: Of the contacts, 0 to 1.
    """
    state, tilt, ball = levels[0], tilts[0], balls[0]
    rolled, dt = state["heading_place"], state["dt"]
    omega = ball["mean_angular_velocity"]
    _advance(levels, omega)
    for i in range(2):
        rolled[i] += dt * (trunk_velocity[i] - ball["mean_linear_velocity"][i])
    found, row = np.zeros(N_HEADING_ERRORS), np.zeros(N_HEADING_ERRORS)
    of_place, of_soles, of_floor = state["heading_variances"]
    if confidence > 0.0:
        for axis in range(2):
            row[:] = 0.0
            row[axis] = 1.0
            _learn(
                levels, found, row, place[axis] - rolled[axis], of_place / confidence
            )
    row[:] = 0.0
    row[_BALL], row[_BALL + 1], row[_BALL_BIAS + 2] = -omega[1], omega[0], 1.0
    _learn(levels, found, row, ball["angular_velocity"][2], of_floor)
    if confidence > 0.0:
        row *= -1.0
        row[_BIAS] = 1.0
        _learn(levels, found, row, turning, of_soles / confidence)
    rolled[0] += found[0]
    rolled[1] += found[1]
    up = np.zeros(3)
    up[2] = found[_BIAS]
    tilt["gyro_bias"] += apply_transposed(tilt["rotation"], up)
    up[2] = found[_HEADING]
    tilt["rotation"][:] = multiply(rotation_from_vector(up), tilt["rotation"])
    bias, turn = found[_BALL_BIAS:], found[_BALL:_BALL_BIAS]
    ball["bias"] += apply_transposed(ball["rotation"], bias)
    ball["rotation"][:] = multiply(rotation_from_vector(turn), ball["rotation"])


@compiled
def _advance(levels: Record, omega: Array) -> None:
    """Advance the covariance by one period, P = F P F' + Q (in place)."""
    state = levels[0]
    P, dt, step = state["heading_covariance"], state["dt"], np.empty(3)
    reach = dt * state["radius"]
    F = np.eye(N_HEADING_ERRORS)
    # v = r (omega_y, -omega_x)
    for i in range(2):
        F[i, _HEADING], F[i, _BALL + 2] = -reach * omega[i], reach * omega[i]
    F[0, _BALL_BIAS + 1], F[1, _BALL_BIAS] = -reach, reach
    F[_HEADING, _BIAS] = -dt
    for i in range(3):
        F[_BALL + i, _BALL_BIAS + i] = -dt
        step[i] = dt * omega[i]
    F[_BALL_BIAS:, _BALL_BIAS:] = rotation_from_vector(step)
    P[:] = multiply(multiply(F, P), F.T)
    for i in range(N_HEADING_ERRORS):
        P[i, i] += state["heading_process"][i]


@compiled
def _learn(
    levels: Record, found: Array, row: Array, measured: float, variance: float
) -> None:
    """Add what a measurement tells to what has been found (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`; its covariance shrinks.
        found: Corrections so far, shape (10,).
        row: What is measured of each error, shape (10,).
        measured: Less what was expected before any correction.
        variance: Of the measurement.
    """
    P = levels[0]["heading_covariance"]
    seen, gains = np.zeros(N_HEADING_ERRORS), np.zeros(N_HEADING_ERRORS)
    innovation, total = measured, variance
    for i in range(N_HEADING_ERRORS):
        innovation -= row[i] * found[i]
        for j in range(N_HEADING_ERRORS):
            seen[i] += P[i, j] * row[j]
    for i in range(N_HEADING_ERRORS):
        total += row[i] * seen[i]
    for i in range(N_HEADING_ERRORS):
        if i not in (_BALL_BIAS, _BALL_BIAS + 1):
            gains[i] = seen[i] / total
            found[i] += gains[i] * innovation
    # Joseph's form, for the gains that are held at 0.
    for i in range(N_HEADING_ERRORS):
        for j in range(N_HEADING_ERRORS):
            P[i, j] += (
                gains[i] * total * gains[j] - gains[i] * seen[j] - seen[i] * gains[j]
            )
