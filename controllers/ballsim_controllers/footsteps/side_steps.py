"""Stepping sideways: how the lateral preview changes while the ball rolls that way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import BALL
from ballsim_controllers.messages import Array, IntArray

__all__ = ["LateralMotion", "SideSteps", "plan_side_steps"]

_PLAY_TIME = 0.3
"""How far a landing may stray from its nominal place per lateral speed, [s]."""


@dataclass(frozen=True, slots=True)
class LateralMotion:
    """Reference across the heading, on which the periodic sway is laid.

    Attributes:
        states: At the start of each cell, shape (N, 7).
        inputs: Commanded CoP of each cell, shape (N,), [m].
        step_time: Time from a landing to the next one, [s].
    """

    states: Array
    inputs: Array
    step_time: float


@dataclass(frozen=True, slots=True)
class SideSteps:
    """What it changes in the lateral preview.

    Attributes:
        widening: Stance and sway as a multiple of those of steps in place.
        landings: Nominal landing offsets from the ball's centre, [m].
        play: By how much the bounds of the landings move, lower and upper, shape
            (2, n_landings), [m].
    """

    widening: float
    landings: Array
    play: Array


def plan_side_steps(
    motion: LateralMotion,
    in_place: Array,
    cells: IntArray,
    stance_delay: float,
    separation: float,
) -> SideSteps:
    """Return how the feet land while the ball rolls sideways.

    A standing foot is carried at the ball's speed relative to the ball's centre.
    So a foot lands behind the place where it is to be in the middle of its single
    support, as it does along the heading; and between two landings the foot that
    stands moves towards the place of the other one, or away from it. For both
    landings to keep the separation, the stance must be wider by half of that way.

    Args:
        motion: Reference across the heading.
        in_place: Landing offsets of steps in place, [m].
        cells: Cell at whose start each foot lands.
        stance_delay: Time from a landing to the middle of the single support that
            follows, [s].
        separation: Least lateral distance of the soles' centres at landing, [m].

    Returns:
        The side steps; those in place where the ball rests at its origin.

    Source:
        full-physics.md section 7, mechanism 7.
    """
    speed = abs(float(motion.states[0, BALL + 1]))
    carried = motion.step_time * speed
    widening = 1.0
    if len(in_place):
        widening = max(1.0, 0.5 * (separation + carried) / abs(float(in_place[0])))
    position, velocity = motion.states[cells, BALL], motion.states[cells, BALL + 1]
    centres = motion.inputs[cells] - position - stance_delay * velocity
    landings = widening * in_place + centres
    shift, play = landings - in_place, _PLAY_TIME * speed
    return SideSteps(widening, landings, np.array([shift - play, shift + play]))
