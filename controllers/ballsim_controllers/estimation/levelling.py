r"""Tilt from the balance of the whole body.

Accelerometer and leg odometry cannot tell a tilt from a bias: both settle where
:math:`\delta\theta \times g e_z = -b`. The ankle sensors can. The contact forces'
moment about the CoM is the change of the angular momentum L, so that

.. math:: \ddot c + \frac{\dot L \times e_z}{m h} = \frac{F_z}{m} \frac{c - p}{h},
    \quad h = c_z - p_z

with the CoP p. A tilt error turns all that is seen of robot and contacts about the
ball's centre and shows up in this acceleration as :math:`\delta\theta \times g e_z`,
whatever the accelerometer says. Added up it is compared with the CoM's place over the
ball as legs and ball measure it, to which :math:`\int L \times e_z / (m h)` belongs.

What remains is the error of torques and angles: 0.1 N m on 640 N, or 0.15 mm of CoP,
are 0.2 mrad. A CoM that is not where the model says, by o, adds :math:`g o / h` to the
same acceleration, but nothing to that of the IMU: where the CoM's place is said to be
uncertain, the difference of the two tells o, as far as the accelerometer's bias is
known. Else it is taken for a tilt.
"""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.corrections import correct
from ballsim_controllers.estimation.error_covariance import (
    FORCE_LEAD,
    FORCE_VELOCITY,
    N_ERRORS,
    loosen,
    weigh,
)
from ballsim_controllers.messages import Array, Record

__all__ = ["level"]

_LEAST_LOAD = 0.5  # of the weight, below which the forces say nothing
_GATE = 4.0  # standard deviations of an innovation that only a push explains
_UNKNOWN_ACCELERATION = 3.0  # meanwhile, [m/s^2/sqrt(Hz)]
_UNKNOWN_SPEED = 0.3  # of feet that touch nothing, [m/sqrt(s)]


@compiled
def level(
    levels: Record,
    tilts: Record,
    balls: Record,
    covariances: Record,
    estimates: Record,
    contacts: Record,
    kinematic: Array,
    momentum: Array,
    confidence: float,
    mass: float,
    gravity: float,
) -> bool:
    """Advance what the forces explain and correct with it (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`.
        tilts: Shape (1,), dtype `TILT_STATE`.
        balls: State of the ball's estimator.
        covariances: Shape (1,), dtype `COVARIANCE`.
        estimates: The tick's estimate, shape (1,), dtype `ESTIMATE`.
        contacts: Contact of each foot, shape (2,), dtype `CONTACT`.
        kinematic: Velocity of the CoM from legs and ball, shape (3,), [m/s].
        momentum: Angular momentum about the CoM, shape (3,), [N m s].
        confidence: Of the legs, 0 to 1.
        mass: Of the robot, [kg].
        gravity: g, [m/s^2].

    Returns:
        True if all that acts is seen: the feet bear the robot, and nobody pushes.
    """
    state, estimate = levels[0], estimates[0]
    dt, velocity, lead = state["dt"], state["velocity"], state["lead"]
    com, points = estimate["position_com_in_world"], estimate["contacts_in_world"]
    if state["has_started"] == 0:
        state["has_started"] = 1
        velocity[:] = kinematic[:2]
        return False
    load, height = 0.0, 0.0
    for i in range(2):
        vertical = contacts[i]["force"][2]
        load += vertical
        height += vertical * points[i, 2]
    if load < _LEAST_LOAD * mass * gravity:
        loosen(covariances, FORCE_VELOCITY, dt * _UNKNOWN_ACCELERATION**2)
        loosen(covariances, FORCE_LEAD, dt * _UNKNOWN_SPEED**2)
        return False
    height /= load
    inertia = mass * (com[2] - height)
    innovation = np.empty(2)
    for j in range(2):
        moment = 0.0  # of the contact forces about the CoM, across axis j
        for i in range(2):
            force = contacts[i]["force"]
            moment += (com[j] - points[i, j]) * force[2]
            moment += (points[i, 2] - height) * force[j]
        explained = dt * moment / inertia
        turning = momentum[1] if j == 0 else -momentum[0]
        if confidence > 0.0:
            moved = velocity[j] + 0.5 * explained
            lead[j] += dt * (kinematic[j] + turning / inertia - moved)
        velocity[j] += explained
        innovation[j] = lead[j]
    if confidence <= 0.0:
        loosen(covariances, FORCE_LEAD, dt * _UNKNOWN_SPEED**2)
        return False
    rows = np.zeros(N_ERRORS)
    rows[FORCE_LEAD] = 1.0
    variance = covariances[0]["com_variance"] / confidence
    expected = variance + covariances[0]["P"][FORCE_LEAD, FORCE_LEAD]
    is_pushed = max(innovation[0] ** 2, innovation[1] ** 2) > _GATE**2 * expected
    if is_pushed:
        # Somebody pushes: the ankles do not feel all forces.
        loosen(covariances, FORCE_VELOCITY, dt * _UNKNOWN_ACCELERATION**2)
    gains = weigh(covariances, rows, variance, False)
    correct(tilts, levels, balls, gains, innovation)
    return not is_pushed
