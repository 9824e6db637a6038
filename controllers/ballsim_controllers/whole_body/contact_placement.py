"""Where the feet's contact forces shall act, and which foot carries how much."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, Record

__all__ = ["place_contacts"]


@compiled
def place_contacts(
    feet: Record,
    cop: Array,
    stance: tuple[bool, bool],
    transfer: tuple[float, float],
    half_size: tuple[float, float],
    minimal_share: float,
) -> tuple[Array, Array]:
    """Choose contact points and load shares that give a CoP.

    Each contact goes from its sole's centre towards the CoP by the foot's
    transfer: 0 = the centre, 1 = as near to the CoP as the sole allows. A
    foot that is about to carry alone (or has just done so) has transfer 1,
    so that its contact need not jump when the other foot lifts off. The
    CoP is then projected on the line between the contacts; the rest moves
    both contacts alike, within the soles.

    Args:
        feet: Pose of the soles, dtype `FEET`.
        cop: Wanted CoP, shape (2,), [m].
        stance: Which feet stand (left, right); at least one.
        transfer: Transfer of each foot, 0 to 1.
        half_size: Usable half length and half width of a sole, [m].
        minimal_share: Smallest share of the load on a standing foot.

    Returns:
        Contact points in the world, shape (2, 3), [m], and the share of the
        load of each foot, shape (2,).
    """
    positions, rotations = feet["position"], feet["rotation"]
    contacts, shares = np.empty((2, 3)), np.zeros(2)
    for i in range(2):
        shares[i] = 1.0 if stance[i] else 0.0
        x, y = _clip_to_sole(
            rotations[i], cop[0] - positions[i, 0], cop[1] - positions[i, 1], half_size
        )
        _put_on_sole(
            contacts[i], positions[i], rotations[i], transfer[i] * x, transfer[i] * y
        )
    if stance[0] and stance[1]:
        span_x = contacts[0, 0] - contacts[1, 0]
        span_y = contacts[0, 1] - contacts[1, 1]
        along = span_x * (cop[0] - contacts[1, 0]) + span_y * (cop[1] - contacts[1, 1])
        share = along / max(span_x * span_x + span_y * span_y, 1e-6)
        shares[0] = clip(share, minimal_share, 1.0 - minimal_share)
        shares[1] = 1.0 - shares[0]
    # What a sole's edge cuts off is lost: to make up for it with the other
    # foot would make that contact jump.
    shift_x = cop[0] - (shares[0] * contacts[0, 0] + shares[1] * contacts[1, 0])
    shift_y = cop[1] - (shares[0] * contacts[0, 1] + shares[1] * contacts[1, 1])
    for i in range(2):
        x, y = _clip_to_sole(
            rotations[i],
            contacts[i, 0] + shift_x - positions[i, 0],
            contacts[i, 1] + shift_y - positions[i, 1],
            half_size,
        )
        _put_on_sole(contacts[i], positions[i], rotations[i], x, y)
    return contacts, shares


@compiled
def _clip_to_sole(
    rotation: Array, shift_x: float, shift_y: float, half_size: tuple[float, float]
) -> tuple[float, float]:
    """Return sole coordinates of a horizontal shift, within the usable sole."""
    a, b, c, d = rotation[0, 0], rotation[0, 1], rotation[1, 0], rotation[1, 1]
    determinant = a * d - b * c
    x = (d * shift_x - b * shift_y) / determinant
    y = (a * shift_y - c * shift_x) / determinant
    length, width = half_size
    return clip(x, -length, length), clip(y, -width, width)


@compiled
def _put_on_sole(
    point: Array, position: Array, rotation: Array, x: float, y: float
) -> None:
    """Write the place in the world of a point in sole coordinates."""
    for i in range(3):
        point[i] = position[i] + rotation[i, 0] * x + rotation[i, 1] * y
