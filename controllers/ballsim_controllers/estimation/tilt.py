"""Attitude and velocity of the trunk: IMU fused with leg odometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.geometry import integrate_rotation, rotation_from_vector
from ballsim_controllers.messages import Array

__all__ = ["TiltFilter", "TiltNoise"]


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
    """

    def __init__(self, dt: float, gravity: float, noise: TiltNoise) -> None:
        """Start upright and at rest."""
        self._dt = dt
        self._gravity = gravity
        self._transition = np.array([[1.0, gravity * dt], [0.0, 1.0]])
        self._process = np.diag([noise.accelerometer**2, noise.gyro**2]) * dt
        self._measurement = noise.odometry**2
        self.covariance = np.diag([noise.initial_velocity**2, noise.initial_tilt**2])
        #: Trunk to world, shape (3, 3).
        self.rotation = np.eye(3)
        #: Velocity of the IMU in the world, shape (3,), [m/s].
        self.velocity = np.zeros(3)
        self._last_gyro: Array | None = None

    def predict(self, gyro: Array, specific_force: Array) -> None:
        """Advance by one period with the IMU.

        Args:
            gyro: Angular velocity of the trunk, in the trunk, (3,), [rad/s].
            specific_force: Accelerometer, in the trunk, (3,), [m/s^2].
        """
        if self._last_gyro is None:
            self._last_gyro = gyro
            return
        mean = 0.5 * (self._last_gyro + gyro)
        self._last_gyro = gyro
        self.rotation = integrate_rotation(self.rotation, mean, self._dt)
        acceleration = self.rotation @ specific_force
        acceleration[2] -= self._gravity
        self.velocity = self.velocity + self._dt * acceleration
        self.covariance = (
            self._transition @ self.covariance @ self._transition.T + self._process
        )

    def correct(self, velocity: Array, confidence: float) -> None:
        """Correct with the velocity that the standing legs measure.

        Args:
            velocity: Of the IMU in the world, shape (3,), [m/s].
            confidence: 0 to 1; scales the information of the measurement.
        """
        if confidence <= 0.0:
            return
        variance = self._measurement / confidence
        p00, p01 = self.covariance[0]
        p11 = self.covariance[1, 1]
        total = p00 + variance
        gain_velocity, gain_tilt = p00 / total, p01 / total
        innovation = velocity - self.velocity
        self.velocity = self.velocity + gain_velocity * innovation
        turn = gain_tilt * np.array([-innovation[1], innovation[0], 0.0])
        self.rotation = rotation_from_vector(turn) @ self.rotation
        # Joseph form: (I - K H) P (I - K H)' + K R K'.
        keep = 1.0 - gain_velocity
        q00 = keep * keep * p00 + gain_velocity**2 * variance
        q01 = keep * (p01 - gain_tilt * p00) + gain_velocity * gain_tilt * variance
        q11 = p11 - 2.0 * gain_tilt * p01 + gain_tilt**2 * (p00 + variance)
        self.covariance = np.array([[q00, q01], [q01, q11]])
