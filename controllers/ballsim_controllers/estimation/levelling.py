r"""Tilt from the balance of the whole body, and the accelerometer's bias with it.

Accelerometer and leg odometry cannot tell a tilt from a bias: both settle where
:math:`\delta\theta \times g e_z = -b`. The ankle sensors can. Without angular
momentum about the CoM the contact forces point through it, so that

.. math:: \ddot c = \frac{F_z}{m} \frac{c - p}{c_z - p_z}

with the CoP p. A tilt error turns all that is seen of robot and contacts about the
ball's centre and shows up in this acceleration as :math:`\delta\theta \times g e_z`,
whatever the accelerometer says; an observer compares it with the CoM's velocity over
the ball. What is left over, slowly, levels the attitude and is taken for bias.

What remains is the error of torques and angles: 0.1 N m on 640 N, or 0.15 mm of CoP,
are 0.2 mrad; a CoM that is not where the model says is taken for a tilt.
"""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import (
    apply_transposed,
    clip,
    multiply,
    rotation_from_vector,
)
from ballsim_controllers.messages import Array, Record

__all__ = ["LEVEL", "level", "make_level"]

_OBSERVER_RATE = 2.0  # double pole of the observer, [rad/s]
_TILT_RATE = 0.5  # at which the attitude follows, [1/s]
_BIAS_RATE = 0.5  # at which the bias follows, [1/s]
_MAX_BIAS = 0.5  # [m/s^2]
_LEAST_LOAD = 0.5  # of the weight, below which the forces say nothing

#: What levelling keeps: velocity that the forces explain [m/s], acceleration that they
#: leave over [m/s^2], both horizontal in the world, and the accelerometer's bias in the
#: trunk, [m/s^2].
LEVEL = np.dtype(
    [
        ("has_started", np.int64),
        ("dt", np.float64),
        ("velocity", np.float64, 2),
        ("rest", np.float64, 2),
        ("bias", np.float64, 3),
    ]
)


def make_level(dt: float) -> Record:
    """Return the state before the first reading, shape (1,).

    Args:
        dt: Control period, [s].
    """
    levels: Record = np.zeros(1, LEVEL)
    levels["dt"] = dt
    return levels


@compiled
def level(
    levels: Record,
    tilts: Record,
    estimates: Record,
    contacts: Record,
    kinematic: Array,
    mass: float,
    gravity: float,
) -> None:
    """Advance the observer and correct attitude and bias (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`.
        tilts: State of the tilt filter, shape (1,), dtype `TILT_STATE`.
        estimates: The tick's estimate, shape (1,), dtype `ESTIMATE`.
        contacts: Contact of each foot, shape (2,), dtype `CONTACT`.
        kinematic: Velocity of the CoM from legs and ball, shape (3,), [m/s].
        mass: Of the robot, [kg].
        gravity: g, [m/s^2].
    """
    state, estimate = levels[0], estimates[0]
    dt, velocity, rest = state["dt"], state["velocity"], state["rest"]
    com, points = estimate["position_com_in_world"], estimate["contacts_in_world"]
    load, height = 0.0, 0.0
    for i in range(2):
        vertical = contacts[i]["force"][2]
        load += vertical
        height += vertical * points[i, 2]
    if load < _LEAST_LOAD * mass * gravity or state["has_started"] == 0:
        state["has_started"] = 1
        velocity[:] = kinematic[:2]
        return
    height /= load
    rotation = tilts[0]["rotation"]
    for j in range(2):
        moment = 0.0  # of the contact forces about the CoM, across axis j
        for i in range(2):
            force = contacts[i]["force"]
            moment += (com[j] - points[i, j]) * force[2]
            moment += (points[i, 2] - height) * force[j]
        acceleration = moment / (mass * (com[2] - height))
        velocity[j] += dt * (acceleration + rest[j])
        innovation = kinematic[j] - velocity[j]
        velocity[j] += 2.0 * _OBSERVER_RATE * dt * innovation
        rest[j] += _OBSERVER_RATE**2 * dt * innovation
    share = _TILT_RATE * dt
    turn = np.array([-share * rest[1] / gravity, share * rest[0] / gravity, 0.0])
    rotation[:] = multiply(rotation_from_vector(turn), rotation)
    bias = apply_transposed(rotation, np.array([rest[0], rest[1], 0.0]))
    for i in range(3):
        moved = state["bias"][i] + _BIAS_RATE * dt * bias[i]
        state["bias"][i] = clip(moved, -_MAX_BIAS, _MAX_BIAS)
    for j in range(2):
        rest[j] *= 1.0 - share
