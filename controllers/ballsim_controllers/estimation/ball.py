"""Attitude and motion of the ball from its gyro."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import apply, integrate_rotation
from ballsim_controllers.messages import Array, Record

__all__ = ["BALL_STATE", "BallEstimator", "update_ball"]

#: What the ball's estimator keeps: the ball's attitude (ball to world), the last
#: gyro reading without its errors, its bias, and the motion in the world as in
#: `BallEstimator`.
BALL_STATE = np.dtype(
    [
        ("has_started", np.int64),
        ("rotation", np.float64, (3, 3)),
        ("gyro", np.float64, 3),
        ("bias", np.float64, 3),  # of the gyro, in the ball
        ("axes", np.float64, (3, 3)),  # errors of its scale and axes, E
        ("position", np.float64, 3),
        ("linear_velocity", np.float64, 3),
        ("angular_velocity", np.float64, 3),
        ("mean_linear_velocity", np.float64, 3),  # since the last reading
        ("mean_angular_velocity", np.float64, 3),
    ]
)


class BallEstimator:
    """Integrates the ball's gyro: it rolls on the floor without slipping.

    The gyro measures in the ball's own rotating frame, so the ball's attitude
    must be carried along to bring the reading into the world. Spin about the
    vertical does not move the ball and is integrated with the rest.

    Args:
        radius: Radius of the ball, [m].
        dt: Control period, [s].

    Attributes:
        state: Shape (1,), dtype `BALL_STATE`.
        position: Centre of the ball in the world, shape (3,), [m].
        linear_velocity: Velocity of the centre in the world, shape (3,), [m/s].
        angular_velocity: In the world, shape (3,), [rad/s].
    """

    def __init__(self, radius: float, dt: float) -> None:
        """Start at the world's origin."""
        self._radius = radius
        self._dt = dt
        self.state: Record = np.zeros(1, BALL_STATE)
        self.state["rotation"] = np.eye(3)
        self.position: Array = self.state["position"][0]
        self.linear_velocity: Array = self.state["linear_velocity"][0]
        self.angular_velocity: Array = self.state["angular_velocity"][0]
        self.position[2] = radius

    def update(self, angular_velocity_in_ball: Array) -> None:
        """Advance to the time of a gyro reading.

        Args:
            angular_velocity_in_ball: Reading in the ball's frame, (3,), [rad/s].
        """
        update_ball(self.state, angular_velocity_in_ball, self._radius, self._dt)


@compiled
def update_ball(
    states: Record, angular_velocity_in_ball: Array, radius: float, dt: float
) -> None:
    """Advance the ball's state to the time of a gyro reading (in place).

    Attitude by the mean of two readings, place by the mean of two velocities.

    Args:
        states: Shape (1,), dtype `BALL_STATE`.
        angular_velocity_in_ball: Reading in the ball's frame, (3,), [rad/s].
        radius: Radius of the ball, [m].
        dt: Time since the last reading, [s].
    """
    state = states[0]
    gyro = state["gyro"]
    rate = angular_velocity_in_ball - state["bias"]
    rate -= apply(state["axes"], rate)  # 1 / (1 + E) = 1 - E, as E is small
    if state["has_started"] != 0:
        mean = np.empty(3)
        for i in range(3):
            mean[i] = 0.5 * (gyro[i] + rate[i])
        state["rotation"][:] = integrate_rotation(state["rotation"], mean, dt)
    state["has_started"] = 1
    gyro[:] = rate
    omega = apply(state["rotation"], rate)
    velocity = state["linear_velocity"]
    new_velocity = np.array([radius * omega[1], -radius * omega[0], 0.0])
    for i in range(3):
        mean_velocity = 0.5 * (velocity[i] + new_velocity[i])
        state["position"][i] += dt * mean_velocity
        state["mean_linear_velocity"][i] = mean_velocity
        state["mean_angular_velocity"][i] = 0.5 * (
            state["angular_velocity"][i] + omega[i]
        )
    velocity[:] = new_velocity
    state["angular_velocity"][:] = omega
