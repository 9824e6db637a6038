r"""Heading of the trunk, from the direction in which the ball rolls.

Nothing tells the heading itself. But a gyro with a bias about the vertical turns the
estimated trunk away, and with it what the legs tell of the ball, while which way the
ball rolls its own gyro tells. Where the two disagree, the ball seems to roll out from
under the trunk sideways, and does not. The ball's own direction is held by the floor:
friction does not let it spin, so what it seems to have spun is what its gyro gets
wrong. (It turns to and fro with each step and creeps, by two milliradians in all.)
Besides, soles turn with the ball. While the robot steps they creep a little on it, and
seem to where zero positions of the legs are off: that tells of both gyros before the
ball rolls. Where both stand for good they hardly do, and hold the heading.

Errors are truth less estimate: of the trunk's place over the ball :math:`(q_x, q_y)`,
of its heading :math:`\psi`, of its gyro's bias about the vertical :math:`\beta`, of the
ball's place on the floor :math:`(p_x, p_y)`, of its attitude :math:`\varphi`, turned in
the world, in the ball of its gyro's bias :math:`b` and of the scale and the axes
:math:`E` of that gyro, which reads :math:`(1 + E) \Omega + b`, and of the angles
:math:`\varsigma` by which the ball has spun and :math:`\tau` by which soles have
turned on it. With the radius r of the ball, its
velocity v, its attitude R and its angular velocity :math:`\omega = R \Omega`, the
angular velocity in the world is off by :math:`\epsilon = R (b + E \Omega)`, and

.. math::
    \dot p &= (-v_y, v_x) \varphi_z + r (-\epsilon_y, \epsilon_x), \quad
    \dot q = \dot p - (-v_y, v_x) \psi

    \dot\psi &= -\beta, \quad \dot\varphi = -\epsilon, \quad
    \dot\varsigma = -(\epsilon - \varphi \times \omega)_z, \quad
    \dot\tau = -\beta - \dot\varsigma

So a direction that is found out late still corrects the way that was rolled before. Of
gyros that are said to be perfect nothing changes.

On a ball that stays where it is nothing tells a bias of its gyro from a tilt of the
trunk but `rolling`, which knows both. So until it rolls, what is horizontal of b is
found there, and taken from there, as is how uncertain it still is.
"""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.corrections import N_HEADING_ERRORS
from ballsim_controllers.estimation.error_covariance import Levers
from ballsim_controllers.geometry import (
    apply,
    apply_transposed,
    multiply,
    rotation_from_vector,
)
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.sensor_figures import SensorFigures
from ballsim_controllers.whole_body.standing_soles import SETTLING

__all__ = ["correct_heading", "prepare_heading"]

# After the place over the ball, (2,); of the ball its place, (2,), vectors, E by rows.
_HEADING, _BIAS, _FLOOR, _BALL, _BALL_BIAS, _AXES, _SPIN = 2, 3, 4, 6, 9, 12, 21
_PIVOT = 22

_CONTACT = 0.02  # of the first place over the ball, [m]
_PLACE = 3e-3  # of a place over the ball, [m/sqrt(Hz)]
_ROLLING = 7e-4  # of what it moves by, [m/sqrt(s)]
_STANCE_TIME = 4.0  # for which what encoders get wrong of a place lasts, [s]
# Soles of a robot that steps creep on the ball, on the flank of a small one more,
# divided by the cube of its radius in [m], and seem to by so many times what zero
# positions of the legs are off. With each step they turn to and fro.
_SOLE_CREEP, _FLANK_CREEP = 4e-4, 2e-4  # [rad/sqrt(s)]
_ZERO_CREEP = 1.1  # [1/sqrt(s)]
_SOLE_WOBBLE = 1.5e-3  # [rad/sqrt(Hz)]
# The ball turns to and fro with each step, soles with each sway, and both hardly creep.
_WOBBLE = 4e-4  # [rad/sqrt(Hz)]
_CREEP = 2e-4  # [rad/sqrt(s)]
_TURN = 2e-3  # by which it may have turned all the same, [rad]
_OUTLIER = 5.0  # how many times more than expected is no error of its gyro
_REST_TIME = 1.0  # over which the ball's rate is taken, so that sway is no rolling, [s]
_REST_RATE = 0.05  # of a ball that stays where it is, at most, [rad/s]


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
    start[_BALL_BIAS:_AXES] = s.ball_gyro_bias
    growth[_BALL_BIAS:_AXES] = s.ball_gyro_walk
    start[_AXES:_SPIN] = s.ball_gyro_axes
    start[_AXES:_SPIN:4] = s.ball_gyro_scale
    growth[_SPIN] = np.hypot(_CREEP, s.ball_gyro_noise)
    growth[_PIVOT] = np.hypot(growth[_SPIN], s.gyro_noise)
    uncertain = start[_HEADING:].any() or growth[_HEADING:_SPIN].any()
    levels["heading_is_uncertain"] = uncertain
    levels["heading_covariance"] = np.diag(start**2)
    levels["heading_process"] = dt * growth**2
    creep = np.hypot(_SOLE_CREEP, _FLANK_CREEP / levers.radius**3)
    creep = np.hypot(creep, _ZERO_CREEP * s.encoder_bias)
    levels["heading_variances"] = (
        (_PLACE**2 + 2.0 * _STANCE_TIME * leg**2) / dt,
        _WOBBLE**2 / dt,
        (_WOBBLE**2 + _SOLE_WOBBLE**2) / dt,
    )
    levels["sole_creep"] = dt * creep**2
    levels["radius"] = levers.radius


@compiled
def correct_heading(
    levels: Record,
    tilts: Record,
    balls: Record,
    place: Array,
    trunk_velocity: Array,
    turning: float,
    both_bear: bool,
    confidence: float,
    bias_variance: float,
) -> None:
    """Correct directions, biases and the ball's place and gyro (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`.
        tilts: Shape (1,), dtype `TILT_STATE`.
        balls: State of the ball's estimator.
        place: Of the trunk over the ball's centre, as contacts and soles tell, (3,).
        trunk_velocity: Mean of the trunk's origin since the last reading, (3,), [m/s].
        turning: Angular velocity of soles against the ball, [rad/s].
        both_bear: Whether each of them bears much of the robot.
        confidence: Of the contacts, 0 to 1.
        bias_variance: Of the ball gyro's bias about a horizontal axis, as `rolling`
            has found it so far.
    """
    state, tilt, ball = levels[0], tilts[0], balls[0]
    if state["heading_is_uncertain"] == 0:
        return
    rolled, dt = state["heading_place"], state["dt"]
    omega, attitude = ball["mean_angular_velocity"], ball["rotation"]
    rate = apply_transposed(attitude, omega)
    P = state["heading_covariance"]
    _predict(P, state["heading_process"], omega, attitude, rate, dt, state["radius"])
    state["spin"] += dt * omega[2]
    state["pivot"] += dt * turning
    if _has_turned(state["spin"], P[_SPIN, _SPIN]):
        state["spin"] = 0.0
        _forget(P, _SPIN)
    if _has_turned(state["pivot"], P[_PIVOT, _PIVOT]):
        state["stood"] = -SETTLING
    elif both_bear or state["stood"] < 0.0:
        state["stood"] += dt
    else:
        state["stood"] = 0.0
    if state["stood"] < 0.0 or confidence <= 0.0:  # they slip, or do not bear
        state["pivot"] = 0.0
        _forget(P, _PIVOT)
    steps = state["stood"] <= SETTLING
    if steps and confidence > 0.0:
        P[_PIVOT, _PIVOT] += state["sole_creep"] / confidence
    for i in range(2):
        rolled[i] += dt * (trunk_velocity[i] - ball["mean_linear_velocity"][i])
    rests = not _note_rolling(state, omega)
    if rests:
        _take(P, attitude, bias_variance)
    found, row = np.zeros(N_HEADING_ERRORS), np.zeros(N_HEADING_ERRORS)
    of_place, of_ball, of_soles = state["heading_variances"]
    up = attitude[2]
    if confidence > 0.0:
        for axis in range(2):
            row[:] = 0.0
            row[axis] = 1.0
            missed = place[axis] - rolled[axis]
            _learn(P, found, row, missed, of_place / confidence, up, rests)
    row[:] = 0.0
    row[_SPIN] = 1.0
    _learn(P, found, row, -state["spin"], of_ball, up, rests)
    if confidence > 0.0:
        row[:] = 0.0
        row[_PIVOT] = 1.0
        of_pivot = of_soles if steps else of_ball
        _learn(P, found, row, -state["pivot"], of_pivot, up, rests)
    _mend(state, tilt, ball, found)


@compiled
def _mend(state: Record, tilt: Record, ball: Record, found: Array) -> None:
    """Add the errors that were found to what they are errors of (in place)."""
    turn = np.zeros(3)
    turn[2] = found[_BIAS]
    tilt["gyro_bias"] += apply_transposed(tilt["rotation"], turn)
    turn[2] = found[_HEADING]
    tilt["rotation"][:] = multiply(rotation_from_vector(turn), tilt["rotation"])
    for i in range(2):
        state["heading_place"][i] += found[i]
        ball["position"][i] += found[_FLOOR + i]
    ball["bias"] += found[_BALL_BIAS:_AXES]
    ball["axes"] += found[_AXES:_SPIN].reshape((3, 3))
    state["spin"] += found[_SPIN]
    state["pivot"] += found[_PIVOT]
    turn = found[_BALL:_BALL_BIAS]
    ball["rotation"][:] = multiply(rotation_from_vector(turn), ball["rotation"])


@compiled
def _has_turned(angle: float, variance: float) -> bool:
    """Return whether an angle is too large for an error of gyros: of what slips."""
    return bool(angle**2 > _OUTLIER**2 * (variance + _TURN**2))


@compiled
def _forget(P: Array, error: int) -> None:
    """Set an error to 0 that begins anew (in place)."""
    P[error] = 0.0
    P[:, error] = 0.0


@compiled
def _note_rolling(state: Record, omega: Array) -> bool:
    """Note whether the ball rolls, and return it.

    Args:
        state: Of dtype `LEVEL`.
        omega: Angular velocity of the ball in the world, (3,), [rad/s].
    """
    mean = state["mean_rolling"]
    mean += state["dt"] / _REST_TIME * (omega[:2] - mean)
    rolls = mean[0] ** 2 + mean[1] ** 2 > _REST_RATE**2
    state["ball_is_rolling"] = rolls
    return bool(rolls)


@compiled
def _predict(
    P: Array,
    process: Array,
    omega: Array,
    attitude: Array,
    rate: Array,
    dt: float,
    radius: float,
) -> None:
    """Advance the covariance by one period (in place).

    Args:
        P: Covariance of the errors.
        process: What adds to their variances in a period.
        omega: Angular velocity of the ball in the world, (3,), [rad/s].
        attitude: Of the ball, to the world.
        rate: Angular velocity in the ball, (3,), [rad/s].
        dt: The period, [s].
        radius: Of the ball, [m].
    """
    turned = _advance(P, omega, attitude, rate, dt, radius).T
    P[:] = _advance(turned, omega, attitude, rate, dt, radius)
    for i in range(N_HEADING_ERRORS):
        P[i, i] += process[i]
    # Noise of the ball's gyro is the same in its attitude and in its spin.
    shared = process[_BALL + 2]
    P[_BALL + 2, _SPIN] += shared
    P[_SPIN, _BALL + 2] += shared
    for i in (_BALL + 2, _SPIN):
        P[i, _PIVOT] -= shared
        P[_PIVOT, i] -= shared
    # So is that of the trunk's gyro in its heading and in how it turns over the soles.
    P[_HEADING, _PIVOT] += process[_HEADING]
    P[_PIVOT, _HEADING] += process[_HEADING]


@compiled
def _advance(
    matrix: Array, omega: Array, attitude: Array, rate: Array, dt: float, radius: float
) -> Array:
    """Return F M: how errors advance by one period.

    Args:
        matrix: M, its rows are of the errors.
        omega: Angular velocity of the ball in the world, (3,), [rad/s].
        attitude: Of the ball, to the world.
        rate: Angular velocity in the ball, (3,), [rad/s].
        dt: The period, [s].
        radius: Of the ball, [m].
    """
    moved = matrix.copy()
    wrong = matrix[_BALL_BIAS:_AXES].copy()  # b + E Omega
    for i in range(3):
        for j in range(3):
            wrong[i] += rate[j] * matrix[_AXES + 3 * i + j]
    wrong = multiply(dt * attitude, wrong)
    for i in range(2):
        reach = dt * radius * omega[i]
        rolls = reach * matrix[_BALL + 2]
        rolls += radius * wrong[0] if i == 1 else -radius * wrong[1]
        moved[_FLOOR + i] += rolls
        moved[i] += rolls - reach * matrix[_HEADING]
    moved[_HEADING] -= dt * matrix[_BIAS]
    moved[_BALL:_BALL_BIAS] -= wrong
    spun = omega[0] * matrix[_BALL + 1] - omega[1] * matrix[_BALL]
    moved[_SPIN] -= dt * spun + wrong[2]
    moved[_PIVOT] += dt * (spun - matrix[_BIAS]) + wrong[2]
    return moved


@compiled
def _take(P: Array, attitude: Array, variance: float) -> None:
    """Let the bias be no less certain than `rolling` has it (in place).

    Args:
        P: Covariance of the errors.
        attitude: Of the ball, to the world.
        variance: Of the bias about a horizontal axis.
    """
    axis = np.zeros((2, N_HEADING_ERRORS))
    mine = 0.0
    for k in range(2):
        axis[k, _BALL_BIAS:_AXES] = attitude[k]
        mine += 0.5 * np.sum(axis[k] * apply(P, axis[k]))
    if mine <= variance:
        return
    # Of errors along these axes this much goes, and of what goes along with them.
    lost = 1.0 - np.sqrt(variance / mine)
    for k in range(2):
        seen = apply(P, axis[k])
        both = lost**2 * np.sum(axis[k] * seen)
        for i in range(N_HEADING_ERRORS):
            for j in range(N_HEADING_ERRORS):
                P[i, j] += both * axis[k, i] * axis[k, j] - lost * (
                    axis[k, i] * seen[j] + seen[i] * axis[k, j]
                )


@compiled
def _learn(
    P: Array,
    found: Array,
    row: Array,
    measured: float,
    variance: float,
    up: Array,
    rests: bool,
) -> None:
    """Add what a measurement tells to what has been found (in place).

    Args:
        P: Covariance of the errors; it shrinks.
        found: Corrections so far, shape (23,).
        row: What is measured of each error, shape (23,).
        measured: Less what was expected before any correction.
        variance: Of the measurement.
        up: Of the world, in the ball, shape (3,).
        rests: Whether of the ball gyro's bias only what is along `up` is to be found.
    """
    seen = apply(P, row)
    innovation, total = measured, variance
    for i in range(N_HEADING_ERRORS):
        innovation -= row[i] * found[i]
        total += row[i] * seen[i]
    gains = seen / total
    if rests:
        along = 0.0
        for i in range(3):
            along += up[i] * gains[_BALL_BIAS + i]
        gains[_BALL_BIAS:_AXES] = along * up
    found += innovation * gains
    # Joseph's form, which holds of any gains
    for i in range(N_HEADING_ERRORS):
        for j in range(N_HEADING_ERRORS):
            P[i, j] += (
                gains[i] * total * gains[j] - gains[i] * seen[j] - seen[i] * gains[j]
            )
