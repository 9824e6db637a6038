"""What the balance controllers see of the state estimate, and what it leads to."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import apply, quaternion_to_rotation
from ballsim_controllers.messages import Array, Record

__all__ = ["measure_axes", "predict_ball_acceleration"]


@compiled
def measure_axes(estimates: Record) -> tuple[Array, Array]:
    """Return the measured state of the sagittal and of the lateral axis.

    Args:
        estimates: State estimate, shape (1,), dtype `ESTIMATE`.

    Returns:
        CoM and ball with their velocities, (x, x', b, b') per axis, shape (2, 4), in
        [m] and [m/s]; and CoP, tilt of the trunk and its rate per axis, shape (2, 3),
        in [m], [rad] and [rad/s]. The tilt is positive where the trunk's top moves
        against the axis.
    """
    estimate = estimates[0]
    rotation = quaternion_to_rotation(estimate["quaternion_trunk_to_world"])
    rates = apply(rotation, estimate["angular_velocity_trunk_in_trunk"])
    states, others = np.empty((2, 4)), np.empty((2, 3))
    for axis in range(2):
        states[axis, 0] = estimate["position_com_in_world"][axis]
        states[axis, 1] = estimate["linear_velocity_com_in_world"][axis]
        states[axis, 2] = estimate["position_ball_in_world"][axis]
        states[axis, 3] = estimate["linear_velocity_ball_in_world"][axis]
        others[axis, 0] = estimate["cop_in_world"][axis]
        others[axis, 1] = rotation[2, axis]
    others[0, 2], others[1, 2] = -rates[1], rates[0]
    return states, others


@compiled
def predict_ball_acceleration(
    estimates: Record, cop: Array, ball_stiffness: float, tilt: float
) -> Array:
    r"""Return the ball's acceleration that the ball pendulum has for a CoP.

    .. math:: \ddot b = c \, [(p - b) - (2 r_0 / h) (x - p)]

    Args:
        estimates: State estimate, shape (1,), dtype `ESTIMATE`.
        cop: CoP p, shape (2,), [m].
        ball_stiffness: c, [1/s^2].
        tilt: 2 r_0 / h.

    Returns:
        Shape (2,), [m/s^2].

    Source:
        full-physics.md section 1.
    """
    estimate, result = estimates[0], np.empty(2)
    for i in range(2):
        com = estimate["position_com_in_world"][i]
        ball = estimate["position_ball_in_world"][i]
        result[i] = ball_stiffness * ((cop[i] - ball) - tilt * (com - cop[i]))
    return result
