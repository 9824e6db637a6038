"""How the feet share what the net contact force leaves open: squeeze, yaw, twist."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, Record

__all__ = ["limit_twist", "limit_yaw", "share_yaw", "squeeze_feet"]


@compiled
def limit_yaw(
    contacts: Array, shares: Array, force_vertical: float, limits: Record
) -> float:
    """Return the largest yaw moment that torsion and a couple can give, [N m]."""
    x, y = contacts[0, 0] - contacts[1, 0], contacts[0, 1] - contacts[1, 1]
    couple = limits["couple_friction"] * min(shares[0], shares[1])
    arm: float = limits["torsion_arm"] + couple * (x * x + y * y) ** 0.5
    return arm * force_vertical


@compiled
def squeeze_feet(
    contacts: Array,
    shares: Array,
    rotations: Array,
    forces: Array,
    wanted: float,
    friction: float,
) -> None:
    """Press the feet together as the ball's slope asks for (in place).

    Two feet beside the ball's top stand on opposite slopes; under vertical
    forces they would creep apart. An internal force along the line between
    the contacts, without effect on the body as a whole, turns the force on
    the lighter foot into the plane of its sole's normal.

    Args:
        contacts: Where the forces act, in the world, shape (2, 3), [m].
        shares: Share of the load per foot, shape (2,).
        rotations: Of the soles to the world, shape (2, 3, 3).
        forces: Force of the ball on each foot, shape (2, 3), [N].
        wanted: Force that is to press them together beside that, [N].
        friction: Largest such force over the smaller of the normal forces.
    """
    if min(shares[0], shares[1]) <= 0.0:
        return
    span = contacts[0] - contacts[1]
    length = (span[0] ** 2 + span[1] ** 2 + span[2] ** 2) ** 0.5
    pressures = np.zeros(2)
    for foot in range(2):
        along = 0.0
        for i in range(3):
            along += rotations[foot, i, 2] * span[i] / length
        sign = 1.0 if foot == 0 else -1.0
        pressures[foot] = sign * along / rotations[foot, 2, 2] * forces[foot, 2]
    limit = friction * max(min(forces[0, 2], forces[1, 2]), 0.0)
    pressure = max(min(pressures[0], pressures[1]), 0.0) + clip(wanted, -limit, limit)
    for i in range(3):
        forces[0, i] += pressure * span[i] / length
        forces[1, i] -= pressure * span[i] / length


@compiled
def share_yaw(
    contacts: Array, shares: Array, forces: Array, yaw: float, torsion_arm: float
) -> float:
    """Give the yaw moment to torsion first, then to a couple (in place).

    Returns:
        Torsional moment of both feet, to be shared as the load is, [N m].
    """
    # The shared forces act at the contacts, not at the CoP, but in
    # proportion: their own moment about the CoP is zero.
    limit = torsion_arm * (forces[0, 2] + forces[1, 2])
    torsion = clip(yaw, -limit, limit)
    rest = yaw - torsion
    if rest != 0.0 and min(shares[0], shares[1]) > 0.0:
        x, y = contacts[0, 0] - contacts[1, 0], contacts[0, 1] - contacts[1, 1]
        scale = rest / (x * x + y * y)
        forces[0, 0] -= scale * y
        forces[0, 1] += scale * x
        forces[1, 0] += scale * y
        forces[1, 1] -= scale * x
    return torsion


@compiled
def limit_twist(
    twist: float, shares: Array, forces: Array, torsion: float, torsion_arm: float
) -> float:
    """Return what the contacts can give of a twist beside their torsion, [N m].

    Args:
        twist: Torsion that the left foot is to get and the right one to give, [N m].
        shares: Share of the load per foot, shape (2,).
        forces: Force of the ball on each foot, shape (2, 3), [N].
        torsion: Of both feet together, shared as the load is, [N m].
        torsion_arm: Torsional moment over normal force of one contact, [m].
    """
    limit = max(twist, -twist)
    for foot in range(2):
        free = torsion_arm * forces[foot, 2] - shares[foot] * abs(torsion)
        limit = min(limit, max(free, 0.0))
    return clip(twist, -limit, limit)
