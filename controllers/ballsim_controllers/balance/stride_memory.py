r"""What the CoP misses in every stride is asked for beforehand: repetitive control.

Ankles are damped, the load passes late from foot to foot, legs weigh a little other
than in the model: most of what is left of the CoP's error, and of the ball's
acceleration, comes again at the same place of the next stride. So for each place of the
stride, counted from the lift-off of each foot, a table keeps what is added to the CoP
asked for, and learns from what came of it a lead time later,

.. math:: w \leftarrow (1 - \gamma \rho) \, w + \rho \, e.

Along the heading the error e is that of the ball's acceleration, :math:`-\ddot b / c`
less its mean over a step: the ball is to roll on evenly. Across it, where the ball
is to sway, it is that of the CoP. What is beyond `_LARGEST` is a push or a stumble,
and nothing to remember.

Source:
    Bristow, Tharayil and Alleyne, A survey of iterative learning control, IEEE Control
    Systems Magazine 26(3), 2006: PD-type learning, with a filter and with forgetting.
"""

from __future__ import annotations

import numpy as np

from ballsim_controllers.body_pendulum import BALL
from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, Record

__all__ = ["STRIDE_MEMORY", "make_stride_memory", "repeat_cop"]

_PLACE = 0.005  # of a stride that has an entry of its own, [s]
_PLACES = 128  # of each foot: more than the longest step
_LARGEST = 0.02  # error that is learned from, and correction, [m]
_FORGETTING = 0.02  # share of the learning rate

#: For both axes. Feet are those that swung last: 0 = left, 1 = right, -1 before.
STRIDE_MEMORY = np.dtype(
    [
        ("period", np.float64),  # control period, [s]
        ("rate", np.float64),
        ("lead", np.int64),  # places from what is asked for to what comes of it
        ("ball_stiffness", np.float64),  # c, [1/s^2]
        ("foot", np.int64),
        ("is_swinging", np.int64),
        ("time", np.float64),  # since its lift-off, [s]
        ("length", np.int64),  # places of the step before
        ("ball_velocity", np.float64, 2),  # at the tick before, [m/s]
        ("sum", np.float64),  # of the ball's errors in this step, [m]
        ("count", np.int64),
        ("mean", np.float64),  # of the ball's errors in the step before, [m]
        ("corrections", np.float64, (2, 2, _PLACES)),  # foot, axis, place, [m]
    ]
)


def make_stride_memory(
    period: float, rate: float, lead: float, ball_stiffness: float
) -> Record:
    """Return the memory of a robot that has not stepped yet, shape (1,).

    Args:
        period: Control period, [s].
        rate: Share of an error that the next stride is spared; 0 for no learning.
        lead: Time from what is asked for to what comes of it, [s].
        ball_stiffness: c, acceleration of the ball by the CoP's way from its top,
            [1/s^2].
    """
    memory: Record = np.zeros(1, STRIDE_MEMORY)
    memory["period"] = period
    memory["rate"] = rate * min(period / _PLACE, 1.0)
    memory["lead"] = round(lead / _PLACE)
    memory["ball_stiffness"] = ball_stiffness
    memory["foot"] = -1
    return memory


@compiled
def repeat_cop(cop: Array, memories: Record, axes: Record, swing_foot: int) -> None:
    """Add what was learned to the CoP asked for, and learn from that of before.

    Args:
        cop: The CoP to ask for, shape (2,), [m]; what was learned is added.
        memories: The memory, shape (1,), dtype `STRIDE_MEMORY`.
        axes: Observers of both axes, shape (2,), dtype `AXIS`.
        swing_foot: Foot in the air: 0 = left, 1 = right, -1 for none.
    """
    memory = memories[0]
    if memory["rate"] == 0.0:
        return
    _advance(memory, swing_foot)
    error = _find_ball_error(memory, axes)
    place = int(memory["time"] / _PLACE + 0.5)
    if memory["foot"] < 0 or place >= _PLACES:
        return  # no step is under way
    _learn(memory, 0, place, error - memory["mean"], axes[0]["cop_error"])
    _learn(memory, 1, place, axes[1]["cop_error"], axes[1]["cop_error"])
    for axis in range(2):
        # The mean of three places: what changes faster the ankles cannot follow.
        first, last = max(place - 1, 0), min(place + 1, _PLACES - 1)
        total = 0.0
        for i in range(first, last + 1):
            total += memory["corrections"][memory["foot"], axis, i]
        cop[axis] += clip(total / (last - first + 1), -_LARGEST, _LARGEST)


@compiled
def _advance(memory: Record, swing_foot: int) -> None:
    """Move on by one control period; a lift-off begins a step."""
    is_swinging = swing_foot >= 0
    if is_swinging and memory["is_swinging"] == 0:
        memory["length"] = int(memory["time"] / _PLACE + 0.5) + 1
        memory["foot"], memory["time"] = swing_foot, 0.0
        memory["mean"] = memory["sum"] / max(memory["count"], 1)
        memory["sum"], memory["count"] = 0.0, 0
    else:
        memory["time"] += memory["period"]
    memory["is_swinging"] = 1 if is_swinging else 0


@compiled
def _find_ball_error(memory: Record, axes: Record) -> float:
    """Return the CoP that the ball's acceleration along the heading is worth, [m]."""
    before = memory["ball_velocity"][0]
    for axis in range(2):
        memory["ball_velocity"][axis] = axes[axis]["estimate"][BALL + 1]
    gained = memory["ball_velocity"][0] - before
    acceleration = gained / memory["period"]
    error = clip(-acceleration / memory["ball_stiffness"], -_LARGEST, _LARGEST)
    memory["sum"] += error
    memory["count"] += 1
    return error


@compiled
def _learn(
    memory: Record, axis: int, place: int, error: float, cop_error: float
) -> None:
    """Learn from an error at a place of the stride.

    Args:
        memory: The memory.
        axis: 0 along the heading, 1 across it.
        place: The place.
        error: The error, [m].
        cop_error: That of the CoP: where it is large, nothing is learned, [m].
    """
    if abs(cop_error) >= _LARGEST:
        return
    foot, cause = memory["foot"], place - memory["lead"]
    if cause < 0:  # it was asked for in the step before
        foot, cause = 1 - foot, cause + memory["length"]
    if not 0 <= cause < _PLACES:
        return
    rate = memory["rate"]
    known = memory["corrections"][foot, axis, cause]
    memory["corrections"][foot, axis, cause] = (
        1.0 - _FORGETTING * rate
    ) * known + rate * clip(error, -_LARGEST, _LARGEST)
