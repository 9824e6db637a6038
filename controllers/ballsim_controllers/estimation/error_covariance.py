r"""Covariance of the estimate's errors along one horizontal axis.

Errors are truth less estimate, written as horizontal vectors. Both axes obey the same
equations and share one covariance:

==================  =========================================================
LEAD                what leg odometry is ahead of the IMU's place, [m]
VELOCITY            of the IMU, [m/s]
TILT                :math:`\delta\theta \times e_z`, [rad]
GYRO_BIAS           of the trunk's gyro, turned like the tilt, [rad/s]
ACCELEROMETER_BIAS  [m/s^2]
FORCE_LEAD          what leg odometry is ahead of the forces' CoM, [m]
FORCE_VELOCITY      of the CoM as the contact forces explain it, [m/s]
PLACE               of the trunk over the ball, rolled, [m]
BALL_BIAS           of the ball's gyro, turned like the tilt, [rad/s]
COM_OFFSET          of the CoM from where the model has it, [m]
==================  =========================================================

.. math::
    \dot\lambda &= \nu + l \beta + 2 r \gamma, \quad
    \dot\nu = g \tau - \alpha, \quad \dot\tau = -\beta \\
    \dot\lambda_f &= \nu_f + l_c \beta + 2 r \gamma, \quad
    \dot\nu_f = g \tau + (g / l_c) o \\
    \dot\pi &= \nu + l_i \beta + r \gamma

in the order of the table, with the heights of IMU (l) and CoM (l_c) over the contacts
and of the IMU over the trunk's origin (l_i). Biases walk. Gains are the optimal ones
where nothing else is said; Joseph's form holds for any [Bar-Shalom, Li, Kirubarajan:
Estimation with Applications to Tracking and Navigation, 2001, eq. 5.2.3-18].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import multiply
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.sensor_figures import SensorFigures

__all__ = [
    "ACCELEROMETER_BIAS",
    "BALL_BIAS",
    "COM_OFFSET",
    "COVARIANCE",
    "FORCE_LEAD",
    "FORCE_VELOCITY",
    "GYRO_BIAS",
    "LEAD",
    "N_ERRORS",
    "PLACE",
    "TILT",
    "VELOCITY",
    "Levers",
    "advance_covariance",
    "loosen",
    "make_covariance",
    "weigh",
]

N_ERRORS = 10
(
    LEAD,
    VELOCITY,
    TILT,
    GYRO_BIAS,
    ACCELEROMETER_BIAS,
    FORCE_LEAD,
    FORCE_VELOCITY,
    PLACE,
    BALL_BIAS,
    COM_OFFSET,
) = range(N_ERRORS)

# What the model behind the estimator gets wrong, whatever the sensors are.
_ACCELERATION = 0.05  # of the trunk between two samples, [m/s^2/sqrt(Hz)]
_ROTATION = 5e-4  # likewise, [rad/s/sqrt(Hz)]
_SLIP = 7e-4  # of soles on the ball, [m/sqrt(s)]
_FORCE = 0.01  # of the balance of forces, [m/s^2/sqrt(Hz)]
_ROLLING = 2e-4  # of the place over the ball, [m/sqrt(s)]
_LEG = 1e-4  # of a place from the legs, [m]
_MOMENTUM = 2e-4  # of a place of the CoM, [m]
_CONTACT = 5e-3  # of a place over the ball from contacts and soles, [m]
_STEP_TIME = 0.26  # for which what encoders get wrong at a foot lasts, [s]
_TURNING = 0.5  # of trunk and ball meanwhile, [rad/s]
_START_VELOCITY, _START_TILT = 0.02, 0.01  # [m/s], [rad]
_GYRO_BIAS, _GYRO_WALK = 1e-5, 1e-6  # [rad/s], [rad/s^2/sqrt(Hz)]
_ACCELEROMETER_BIAS, _ACCELEROMETER_WALK = 1e-3, 1e-5  # [m/s^2], [m/s^3/sqrt(Hz)]

#: Covariance P, its transition F over one period and what that adds, and the variances
#: of the three places that are measured: by the legs, of the CoM, over the ball.
COVARIANCE = np.dtype(
    [
        ("P", np.float64, (N_ERRORS, N_ERRORS)),
        ("F", np.float64, (N_ERRORS, N_ERRORS)),
        ("Q", np.float64, (N_ERRORS, N_ERRORS)),
        ("leg_variance", np.float64),
        ("com_variance", np.float64),
        ("place_variance", np.float64),
    ]
)


@dataclass(frozen=True, slots=True)
class Levers:
    """Heights that errors of angular velocities act on, [m].

    Attributes:
        imu_over_contact: IMU over the contacts.
        imu_over_trunk: IMU over the trunk's origin.
        trunk_over_ball: Trunk's origin over the ball's centre.
        com_over_contact: CoM over the contacts.
        radius: Of the ball.
    """

    imu_over_contact: float
    imu_over_trunk: float
    trunk_over_ball: float
    com_over_contact: float
    radius: float


def make_covariance(
    dt: float,
    gravity: float,
    weight: float,
    levers: Levers,
    figures: SensorFigures,
    com_offset: float = 0.0,
) -> Record:
    """Return the covariance before the first reading, shape (1,).

    Args:
        dt: Control period, [s].
        gravity: g, [m/s^2].
        weight: Of the robot, [N].
        levers: Heights in the nominal stance.
        figures: What the sensors are said to be.
        com_offset: Standard deviation of the CoM's place along each axis, [m].
    """
    record: Record = np.zeros(1, COVARIANCE)
    r, s = levers.radius, figures
    A = np.zeros((N_ERRORS, N_ERRORS))
    A[LEAD, [VELOCITY, GYRO_BIAS, BALL_BIAS]] = 1.0, levers.imu_over_contact, 2.0 * r
    A[VELOCITY, [TILT, ACCELEROMETER_BIAS]] = gravity, -1.0
    A[TILT, GYRO_BIAS] = -1.0
    com = levers.com_over_contact
    A[FORCE_LEAD, [FORCE_VELOCITY, GYRO_BIAS, BALL_BIAS]] = 1.0, com, 2.0 * r
    A[FORCE_VELOCITY, [TILT, COM_OFFSET]] = gravity, gravity / com
    A[PLACE, [VELOCITY, GYRO_BIAS, BALL_BIAS]] = 1.0, levers.imu_over_trunk, r
    record["F"] = np.eye(N_ERRORS) + dt * A
    cop = 2.0**0.5 * s.torque_noise / weight  # two feet with half the weight each
    by_forces = gravity / com * cop * dt**0.5
    # Encoders that are off show the CoM beside where it is over a foot, knee and ankle
    # about alike, and over the next foot elsewhere: noise with the memory of a step.
    aside = com * 2.0**0.5 * s.encoder_bias * (2.0 * _STEP_TIME) ** 0.5
    by_forces = np.hypot(by_forces, gravity / com * aside)
    density = np.zeros(N_ERRORS)
    density[[LEAD, FORCE_LEAD]] = np.hypot(_SLIP, _TURNING * aside)
    density[VELOCITY] = np.hypot(_ACCELERATION, s.accelerometer_noise)
    density[TILT] = _ROTATION
    density[GYRO_BIAS] = max(_GYRO_WALK, s.gyro_walk)
    density[ACCELEROMETER_BIAS] = max(_ACCELEROMETER_WALK, s.accelerometer_walk)
    density[FORCE_VELOCITY] = np.hypot(_FORCE, by_forces)
    density[PLACE] = _ROLLING
    density[BALL_BIAS] = max(_GYRO_WALK, s.ball_gyro_walk)
    # A gyro's noise acts as its bias does, on everything at once.
    noise = np.column_stack(
        [
            np.diag(density),
            s.gyro_noise * A[:, GYRO_BIAS],
            s.ball_gyro_noise * A[:, BALL_BIAS],
        ]
    )
    record["Q"] = dt * noise @ noise.T
    start = np.zeros(N_ERRORS)
    start[[VELOCITY, FORCE_VELOCITY]], start[TILT] = _START_VELOCITY, _START_TILT
    start[GYRO_BIAS] = max(_GYRO_BIAS, s.gyro_bias)
    start[ACCELEROMETER_BIAS] = max(_ACCELEROMETER_BIAS, s.accelerometer_bias)
    start[BALL_BIAS] = max(_GYRO_BIAS, s.ball_gyro_bias)
    start[COM_OFFSET] = com_offset
    leg = levers.imu_over_contact * s.encoder_noise
    start[[LEAD, FORCE_LEAD]] = leg
    P: Array = np.diag(start**2)
    # Nothing is known of the place: the first contacts tell it, tilted as they are.
    H = levers.trunk_over_ball
    P[PLACE, PLACE] = (H * start[TILT]) ** 2 + _CONTACT**2
    P[PLACE, TILT] = P[TILT, PLACE] = H * start[TILT] ** 2
    record["P"] = P
    record["leg_variance"] = _LEG**2 + leg**2
    record["com_variance"] = _MOMENTUM**2 + leg**2
    record["place_variance"] = _CONTACT**2 + (H * s.encoder_noise) ** 2 + cop**2
    return record


@compiled
def advance_covariance(covariances: Record) -> None:
    """Advance by one period, P = F P F' + Q (in place).

    Args:
        covariances: Shape (1,), dtype `COVARIANCE`.
    """
    record = covariances[0]
    P, F, Q = record["P"], record["F"], record["Q"]
    moved = multiply(F, P)
    for i in range(N_ERRORS):
        for j in range(i, N_ERRORS):
            total = 0.0
            for k in range(N_ERRORS):
                total += moved[i, k] * F[j, k]
            P[i, j] = P[j, i] = total + Q[i, j]


@compiled
def loosen(covariances: Record, error: int, variance: float) -> None:
    """Add to the variance of one error, of which more has become unknown (in place)."""
    covariances[0]["P"][error, error] += variance


@compiled
def weigh(
    covariances: Record, rows: Array, variance: float, only_rolling: bool
) -> Array:
    """Return the gains of a measurement, and what it leaves of the covariance.

    Args:
        covariances: Shape (1,), dtype `COVARIANCE`, changed in place.
        rows: What is measured of each error, shape (10,).
        variance: Of the measurement.
        only_rolling: True if it is to correct `PLACE` and `BALL_BIAS` alone.

    Returns:
        Gains, shape (10,).
    """
    P = covariances[0]["P"]
    seen = np.zeros(N_ERRORS)  # P H'
    for i in range(N_ERRORS):
        for j in range(N_ERRORS):
            seen[i] += P[i, j] * rows[j]
    total = variance
    for i in range(N_ERRORS):
        total += rows[i] * seen[i]
    gains = np.zeros(N_ERRORS)
    for i in range(N_ERRORS):
        if not only_rolling or i in (PLACE, BALL_BIAS):
            gains[i] = seen[i] / total
    # (I - K H) P (I - K H)' + K R K' for any gain.
    for i in range(N_ERRORS):
        for j in range(i, N_ERRORS):
            P[i, j] += (
                gains[i] * total * gains[j] - gains[i] * seen[j] - seen[i] * gains[j]
            )
            P[j, i] = P[i, j]
    return gains
