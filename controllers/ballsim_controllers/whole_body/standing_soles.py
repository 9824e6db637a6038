"""Soles that stand: the trunk's direction follows them, and they stay as they are.

The bias of a gyro turns the robot that is estimated, not the robot. If feedback of the
heading followed, it would twist the soles on the ball; under a torque that lasts they
give way, and the robot would turn with its estimate, unseen. A trunk that stays as it
is over soles that stay tells of the bias instead.

Joint zeros that are off twist the soles against each other just so, and part them, and
where sensors are perfect they still part slowly. That the encoders see: a twist and a
squeeze against it hold them.
"""

from __future__ import annotations

import math

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Record

__all__ = ["SETTLING", "STANDING_SOLES", "follow_soles", "make_standing_soles"]

#: Whether the sensors are such that the trunk follows the soles; how long both feet
#: have stood, [s]; direction of both soles, that of the left one against the right
#: one, [rad], and their distance, [m], when that began to count.
STANDING_SOLES = np.dtype(
    [
        ("is_followed", np.int64),
        ("stood", np.float64),
        ("direction", np.float64),
        ("splay", np.float64),
        ("distance", np.float64),
    ]
)

#: Time after which feet that stand do so for good, and do not pivot, [s].
SETTLING = 0.25


def make_standing_soles(is_followed: bool) -> Record:
    """Return the record of a robot that has not stood yet.

    Args:
        is_followed: Whether the trunk follows the soles: not where the sensors are
            perfect, and tell its heading.
    """
    standing: Record = np.zeros(1, STANDING_SOLES)
    standing["is_followed"] = is_followed
    return standing


@compiled
def follow_soles(
    standing: Record, feet: Record, stands: bool, dt: float
) -> tuple[float, float, float]:
    """Return how the soles have moved since both feet stand.

    Args:
        standing: What is kept from tick to tick, shape (1,), dtype `STANDING_SOLES`.
        feet: The feet at the estimate, dtype `FEET`.
        stands: Whether both feet shall stand.
        dt: Control period, [s].

    Returns:
        How far both together have turned, which the trunk is to follow, how far the
        left one has turned against the right one, [rad], and how far they have parted,
        [m]. All are 0 while a foot swings.
    """
    state = standing[0]
    if not stands:
        state["stood"] = 0.0
        return 0.0, 0.0, 0.0
    left, right = feet["rotation"][0], feet["rotation"][1]
    left_direction = math.atan2(left[1, 0], left[0, 0])
    right_direction = math.atan2(right[1, 0], right[0, 0])
    direction = 0.5 * (left_direction + right_direction)
    splay = left_direction - right_direction
    square = 0.0
    for i in range(3):
        square += (feet["position"][0, i] - feet["position"][1, i]) ** 2
    distance = math.sqrt(square)
    if state["stood"] < SETTLING:
        state["stood"] += dt
        state["direction"], state["splay"] = direction, splay
        state["distance"] = distance
    turn = direction - float(state["direction"]) if state["is_followed"] == 1 else 0.0
    return turn, splay - float(state["splay"]), distance - float(state["distance"])
