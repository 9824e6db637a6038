"""Attitude and motion of the ball from its gyro."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.geometry import integrate_rotation
from ballsim_controllers.messages import Array

__all__ = ["BallEstimator"]


class BallEstimator:
    """Integrates the ball's gyro: it rolls on the floor without slipping.

    The gyro measures in the ball's own rotating frame, so the ball's attitude
    must be carried along to bring the reading into the world. Spin about the
    vertical does not move the ball and is integrated with the rest.

    Args:
        radius: Radius of the ball, [m].
        dt: Control period, [s].
    """

    def __init__(self, radius: float, dt: float) -> None:
        """Start at the world's origin."""
        self._radius = radius
        self._dt = dt
        self._rotation = np.eye(3)
        self._last: Array | None = None
        #: Centre of the ball in the world, shape (3,), [m].
        self.position = np.array([0.0, 0.0, radius])
        #: Velocity of the centre in the world, shape (3,), [m/s].
        self.linear_velocity = np.zeros(3)
        #: Angular velocity in the world, shape (3,), [rad/s].
        self.angular_velocity = np.zeros(3)

    def update(self, angular_velocity_in_ball: Array) -> None:
        """Advance to the time of a gyro reading.

        Args:
            angular_velocity_in_ball: Reading in the ball's frame, (3,), [rad/s].
        """
        if self._last is not None:
            mean = 0.5 * (self._last + angular_velocity_in_ball)
            self._rotation = integrate_rotation(self._rotation, mean, self._dt)
        self._last = angular_velocity_in_ball.copy()
        omega = self._rotation @ angular_velocity_in_ball
        velocity = self._radius * np.array([omega[1], -omega[0], 0.0])
        self.position = self.position + 0.5 * self._dt * (
            self.linear_velocity + velocity
        )
        self.linear_velocity = velocity
        self.angular_velocity = omega
