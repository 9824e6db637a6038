"""What the balance controllers see of the state estimate, and what it leads to."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.balance.axis_balance import observe_axis
from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import apply, quaternion_to_rotation
from ballsim_controllers.messages import Array, Record

__all__ = ["observe_axes", "predict_ball_acceleration"]


@compiled
def observe_axes(
    states: Array, axes: Record, estimates: Record, is_single: bool
) -> None:
    """Write the observed states, one control period after the last call.

    Args:
        states: State (x, x', b, b', p, tilt, tilt rate) of the sagittal and of the
            lateral axis, shape (2, 7). The tilt is positive where the trunk's top
            moves against the axis.
        axes: Observers of both axes, shape (2,), dtype `AXIS`.
        estimates: State estimate, shape (1,), dtype `ESTIMATE`.
        is_single: True in single support.
    """
    estimate = estimates[0]
    rotation = quaternion_to_rotation(estimate["quaternion_trunk_to_world"])
    rates = apply(rotation, estimate["angular_velocity_trunk_in_trunk"])
    measured, inputs = np.empty(4), np.empty(3)
    for axis in range(2):
        measured[0] = estimate["position_com_in_world"][axis]
        measured[1] = estimate["linear_velocity_com_in_world"][axis]
        measured[2] = estimate["position_ball_in_world"][axis]
        measured[3] = estimate["linear_velocity_ball_in_world"][axis]
        inputs[0] = estimate["cop_in_world"][axis]
        inputs[1] = rotation[2, axis]
        inputs[2] = -rates[1] if axis == 0 else rates[0]
        observe_axis(axes[axis], states[axis], measured, inputs, is_single)


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
