"""Leg odometry: where the trunk is over the ball, and how fast, from standing legs."""

from __future__ import annotations

import math

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import apply, apply_transposed, clip, cross
from ballsim_controllers.messages import Array, Record

__all__ = ["FUSION", "fuse_legs", "is_near_ball", "move_com", "share_of_rate"]

#: Angular accelerations of trunk and ball, [rad/s^2/sqrt(Hz)].
_ANGULAR_ACCELERATION = 0.5
#: Distance of a sole's plane from the ball above which it cannot touch, [m].
_CONTACT_GAP = 0.008
#: Rate at which lasting errors of the forces are found, [1/s], and the largest one,
#: over the mass, [m/s^2].
_FORCE_RATE, _MAX_FORCE = 0.5, 1.0

#: Time for which the legs' disagreement is remembered while both carry alike, [s].
_MEMORY = 1.0

#: From what share of the load on a sole does not pivot.
_HELD_SHARE = 0.15

#: What the fusion depends on and what it keeps from tick to tick.
FUSION = np.dtype(
    [
        ("dt", np.float64),
        ("radius", np.float64),
        ("rotation_imu_to_trunk", np.float64, (3, 3)),
        ("position_imu_in_trunk", np.float64, 3),
        ("place_share", np.float64),
        ("com_share", np.float64),
        ("trunk_rate_share", np.float64),  # of a gyro's reading that is believed
        ("ball_rate_share", np.float64),
        ("angular_velocity_trunk", np.float64, 3),  # in the trunk
        ("angular_velocity_ball", np.float64, 3),  # in the world
        ("has_place", np.int64),
        ("trunk_from_ball", np.float64, 3),  # ball's centre to trunk, in the world
        ("place", np.float64, 3),  # the same as the contacts tell it
        ("disagreement", np.float64, 3),  # half of what the left leg adds, in the trunk
        ("compared", np.float64),  # readings that it is the mean of
        ("leg_velocity", np.float64, 3),  # of the trunk as the legs tell it
        ("confidence", np.float64),  # of both
        ("leg_trust", np.float64, 2),  # 0 where an encoder of the leg is ill
        ("turning", np.float64),  # of the soles on the ball, about the normal
        ("both_bear", np.int64),  # whether each of them bears much of the robot
        ("has_com_velocity", np.int64),
        ("com_velocity", np.float64, 3),
        ("force_bias", np.float64, 3),  # of the forces over the mass, [m/s^2]
    ]
)


def share_of_rate(noise: float, dt: float) -> float:
    """Return the gain of a steady-state filter for an angular velocity.

    Args:
        noise: Density of the gyro's noise, [rad/s/sqrt(Hz)].
        dt: Control period, [s].
    """
    return 1.0 - math.exp(-_ANGULAR_ACCELERATION * dt / noise) if noise > 0.0 else 1.0


@compiled
def is_near_ball(position: Array, rotation: Array, fusion: Record) -> bool:
    """Return whether a foot may touch the ball at all.

    The ankle sensor of a swinging foot shows the foot's own inertia, which
    must not be taken for a touchdown. The robot model's trunk is at the origin.

    Args:
        position: Centre of the sole from the trunk, in the world, (3,), [m].
        rotation: Sole to world, shape (3, 3).
        fusion: State of the fusion.
    """
    if fusion["has_place"] == 0:
        return True
    height = 0.0
    for i in range(3):
        height += (position[i] + fusion["trunk_from_ball"][i]) * rotation[i, 2]
    return bool(height < fusion["radius"] + _CONTACT_GAP)


@compiled
def fuse_legs(
    contacts: Record, feet: Record, ball: Record, fusion: Record, rotation_trunk: Array
) -> tuple[Array, Array, float]:
    """Return trunk place over the ball, trunk velocity and confidence.

    Means over the feet, weighted by load and confidence, without a leg that has an
    encoder which is ill. The robot model's trunk is at the origin and at rest.

    Encoders that are off make each leg tell another place, and the mean would jump
    from step to step. While both feet stand their difference is seen; the truth is
    taken to be half-way between them, and each leg's place is moved there.

    Args:
        contacts: Contact of each foot, shape (2,), dtype `CONTACT`.
        feet: Pose and velocity of the soles, dtype `FEET`.
        ball: State of the ball's estimator, dtype `BALL_STATE`.
        fusion: State of the fusion, dtype `FUSION`.
        rotation_trunk: Trunk to world, shape (3, 3).
    """
    radius = fusion["radius"]
    place, velocity, total, confidence = np.zeros(3), np.zeros(3), 0.0, 0.0
    apart, least = np.zeros(3), math.inf
    half = apply(rotation_trunk, fusion["disagreement"])
    turning, mean_turning = 0.0, 0.0
    for i in range(2):
        contact = contacts[i]
        weight = contact["confidence"] * contact["normal_force"]
        weight *= fusion["leg_trust"][i]
        least = min(least, weight)
        if weight <= 0.0:
            continue
        side = 1.0 if i == 0 else -1.0
        rotation = feet["rotation"][i]
        normal, arm = np.empty(3), np.empty(3)
        for j in range(3):
            normal[j] = radius * rotation[j, 2]
            arm[j] = (
                rotation[j, 0] * contact["offset"][0]
                + rotation[j, 1] * contact["offset"][1]
            )
        surface = cross(ball["mean_angular_velocity"], normal)
        swing = cross(feet["angular_velocity"][i], arm)
        pivoting = 0.0
        for j in range(3):
            relative = feet["angular_velocity"][i, j] - ball["mean_angular_velocity"][j]
            pivoting += rotation[j, 2] * relative
            told = normal[j] - feet["position"][i, j] - arm[j]
            apart[j] += 0.5 * side * told
            place[j] += weight * (told - side * half[j])
            velocity[j] += weight * (
                ball["mean_linear_velocity"][j]
                + surface[j]
                - feet["linear_velocity"][i, j]
                - swing[j]
            )
        total += weight
        turning += weight * pivoting
        mean_turning += 0.5 * pivoting
        confidence = max(confidence, contact["confidence"])
    fusion["both_bear"] = least > _HELD_SHARE * total
    if least > 0.0:
        # The mean of all there is, and that of the last second later.
        share = 2.0 * least / total
        fusion["compared"] = min(fusion["compared"] + share, _MEMORY / fusion["dt"])
        share /= fusion["compared"]
        found = apply_transposed(rotation_trunk, share * (apart - half))
        for j in range(3):
            fusion["disagreement"][j] += found[j]
    fusion["turning"] = turning / total if total > 0.0 else 0.0
    if fusion["both_bear"] == 1:
        # Feet that twist each other turn alike, whatever each bears.
        fusion["turning"] = mean_turning
    if total <= 0.0:
        return fusion["trunk_from_ball"].copy(), velocity, 0.0
    return place / total, velocity / total, confidence


@compiled
def move_com(
    fusion: Record, contacts: Record, kinematic: Array, mass: float, gravity: float
) -> None:
    """Move the CoM's velocity on with the forces and hold it to the legs (in place).

    While an encoder of a leg is ill, it is the forces' alone.

    Args:
        fusion: State of the fusion.
        contacts: Contact of each foot, shape (2,), dtype `CONTACT`.
        kinematic: Mean velocity of the CoM since the last reading, as trunk and joints
            tell, shape (3,), [m/s].
        mass: Of the robot, [kg].
        gravity: g, [m/s^2].
    """
    velocity, bias = fusion["com_velocity"], fusion["force_bias"]
    share = fusion["com_share"] * fusion["leg_trust"][0] * fusion["leg_trust"][1]
    if fusion["has_com_velocity"] == 0:
        fusion["has_com_velocity"] = 1
        velocity[:] = kinematic
    for i in range(3):
        force = contacts[0]["force"][i] + contacts[1]["force"][i]
        acceleration = force / mass - (gravity if i == 2 else 0.0)
        pushed = fusion["dt"] * (acceleration - bias[i])
        mean = velocity[i] + 0.5 * pushed  # as old as what the joints tell
        surprise = share * (kinematic[i] - mean)
        velocity[i] += pushed + surprise
        bias[i] = clip(bias[i] - _FORCE_RATE * surprise, -_MAX_FORCE, _MAX_FORCE)
