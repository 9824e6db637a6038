"""Attitude and velocity of the trunk: IMU fused with leg odometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import (
    apply,
    integrate_rotation,
    multiply,
    rotation_from_vector,
)
from ballsim_controllers.messages import Array, Record

__all__ = ["TILT_STATE", "TiltFilter", "TiltNoise", "correct_tilt", "predict_tilt"]

#: What the filter keeps: attitude (trunk to world), velocity of the IMU, last gyro
#: reading, covariance of (velocity, tilt) along one axis, and its noise model: the
#: process noise of one period and the variance of one velocity from the legs.
TILT_STATE = np.dtype(
    [
        ("has_started", np.int64),
        ("rotation", np.float64, (3, 3)),
        ("velocity", np.float64, 3),
        ("gyro", np.float64, 3),
        ("covariance", np.float64, (2, 2)),
        ("process", np.float64, 2),
        ("measurement", np.float64),
    ]
)


@dataclass(frozen=True, slots=True)
class TiltNoise:
    """What the filter believes of its sensors.

    Attributes:
        accelerometer: Density of the accelerometer's noise, [m/s^2/sqrt(Hz)].
        gyro: Density of the gyro's noise, [rad/s/sqrt(Hz)].
        odometry: Standard deviation of one velocity from the legs, [m/s].
        initial_velocity: Standard deviation at the start, [m/s].
        initial_tilt: Standard deviation at the start, [rad].
    """

    accelerometer: float = 0.1
    gyro: float = 2e-3
    odometry: float = 0.01
    initial_velocity: float = 0.02
    initial_tilt: float = 0.02


class TiltFilter:
    r"""Kalman filter for horizontal velocity and tilt.

    The IMU predicts, the velocity of the trunk over the ball (no slip) corrects.
    A tilt error :math:`\delta\theta` tilts the measured specific force and
    shows up as a growing velocity error,

    .. math:: \delta \dot v = \delta\theta \times g e_z,

    which makes tilt observable without mistaking acceleration for gravity.
    Both horizontal axes obey the same equations and share one covariance.
    Heading is not observable and is only integrated.

    Args:
        dt: Control period, [s].
        gravity: g, [m/s^2].
        noise: Noise model.

    Attributes:
        state: Shape (1,), dtype `TILT_STATE`.
        rotation: Trunk to world, shape (3, 3).
        velocity: Velocity of the IMU in the world, shape (3,), [m/s].
        covariance: Of velocity and tilt along one axis, shape (2, 2).
    """

    def __init__(self, dt: float, gravity: float, noise: TiltNoise) -> None:
        """Start upright and at rest."""
        self._dt = dt
        self._gravity = gravity
        self.state: Record = np.zeros(1, TILT_STATE)
        self.rotation: Array = self.state["rotation"][0]
        self.velocity: Array = self.state["velocity"][0]
        self.covariance: Array = self.state["covariance"][0]
        self.rotation[:] = np.eye(3)
        self.covariance[:] = np.diag([noise.initial_velocity**2, noise.initial_tilt**2])
        self.state["process"] = dt * np.array([noise.accelerometer**2, noise.gyro**2])
        self.state["measurement"] = noise.odometry**2

    def predict(self, gyro: Array, specific_force: Array) -> None:
        """Advance by one period with the IMU.

        Args:
            gyro: Angular velocity of the trunk, in the trunk, (3,), [rad/s].
            specific_force: Accelerometer, in the trunk, (3,), [m/s^2].
        """
        predict_tilt(self.state, gyro, specific_force, self._dt, self._gravity)

    def correct(self, velocity: Array, confidence: float) -> None:
        """Correct with the velocity that the standing legs measure.

        Args:
            velocity: Of the IMU in the world, shape (3,), [m/s].
            confidence: 0 to 1; scales the information of the measurement.
        """
        correct_tilt(self.state, velocity, confidence)


@compiled
def predict_tilt(
    states: Record, gyro: Array, specific_force: Array, dt: float, gravity: float
) -> None:
    """Advance the filter by one period with the IMU (in place).

    The first reading only starts it.

    Args:
        states: Shape (1,), dtype `TILT_STATE`.
        gyro: Angular velocity of the trunk, in the trunk, (3,), [rad/s].
        specific_force: Accelerometer, in the trunk, (3,), [m/s^2].
        dt: Time since the last reading, [s].
        gravity: g, [m/s^2].
    """
    state = states[0]
    last = state["gyro"]
    if state["has_started"] == 0:
        state["has_started"] = 1
        last[:] = gyro
        return
    mean = np.empty(3)
    for i in range(3):
        mean[i] = 0.5 * (last[i] + gyro[i])
    last[:] = gyro
    rotation = integrate_rotation(state["rotation"], mean, dt)
    state["rotation"][:] = rotation
    acceleration = apply(rotation, specific_force)
    acceleration[2] -= gravity
    for i in range(3):
        state["velocity"][i] += dt * acceleration[i]
    # P = A P A' + Q with A = [[1, g dt], [0, 1]].
    P, process, slope = state["covariance"], state["process"], gravity * dt
    p01 = P[0, 1] + slope * P[1, 1]
    P[0, 0] += slope * (P[0, 1] + p01) + process[0]
    P[0, 1] = P[1, 0] = p01
    P[1, 1] += process[1]


@compiled
def correct_tilt(states: Record, velocity: Array, confidence: float) -> None:
    """Correct with the velocity that the standing legs measure (in place).

    Args:
        states: Shape (1,), dtype `TILT_STATE`.
        velocity: Of the IMU in the world, shape (3,), [m/s].
        confidence: 0 to 1; scales the information of the measurement.
    """
    if confidence <= 0.0:
        return
    state = states[0]
    P = state["covariance"]
    variance = state["measurement"] / confidence
    p00, p01, p11 = P[0, 0], P[0, 1], P[1, 1]
    total = p00 + variance
    gain_velocity, gain_tilt = p00 / total, p01 / total
    innovation = np.empty(3)
    for i in range(3):
        innovation[i] = velocity[i] - state["velocity"][i]
        state["velocity"][i] += gain_velocity * innovation[i]
    turn = np.array([-gain_tilt * innovation[1], gain_tilt * innovation[0], 0.0])
    state["rotation"][:] = multiply(rotation_from_vector(turn), state["rotation"])
    # Joseph form: (I - K H) P (I - K H)' + K R K'.
    keep = 1.0 - gain_velocity
    q01 = keep * (p01 - gain_tilt * p00) + gain_velocity * gain_tilt * variance
    P[0, 0] = keep * keep * p00 + gain_velocity**2 * variance
    P[0, 1] = P[1, 0] = q01
    P[1, 1] = p11 - 2.0 * gain_tilt * p01 + gain_tilt**2 * (p00 + variance)
