"""When to begin and when to end stepping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.gait import LEFT, RIGHT
from ballsim_controllers.messages import Array, Record, StateEstimate
from ballsim_controllers.settings import ForceSettings, GaitSettings

__all__ = ["StepDecisions", "StepSituation"]


@dataclass(frozen=True, slots=True)
class StepSituation:
    """What the decisions look at.

    Attributes:
        estimate: State estimate.
        soles: Sole centres in the world (left, right), shape (2, 2), [m].
        ideal_cop: CoP of the balance controller, shape (2,), [m].
        capture: Capture point, shape (2,), [m].
        find_reference: Returns where the ball shall be, shape (2,), [m].
        is_wanted: True where the operator's command needs steps.
        find_swing: Returns the foot whose swing the preview prefers.
    """

    estimate: StateEstimate
    soles: Array
    ideal_cop: Array
    capture: Array
    find_reference: Callable[[], Array]
    is_wanted: bool
    find_swing: Callable[[], int]


class StepDecisions:
    """Swing condition of the standing robot and the rule that ends a walk.

    The paper's swing condition: a foot swings once the ideal CoP has left the
    reduced hull of the standing soles. Here the capture point stands for the CoP, the
    hull is widened by a share of a sole, and the point must stay outside for a time; a
    step that is merely commanded waits until the robot rests over the ball.

    Args:
        gait: Thresholds.
        forces: Usable size of a sole.
        dt: Control period, [s].
        ball_radius: Radius of the ball, [m].
    """

    def __init__(
        self, gait: GaitSettings, forces: ForceSettings, dt: float, ball_radius: float
    ) -> None:
        """Start with nothing pending."""
        self._gait = gait
        self._stop_reach = gait.stop_reach_share * ball_radius
        self._stand_reach = gait.stand_reach_share * ball_radius
        half = np.array([forces.cop_half_length_m, forces.cop_half_width_m])
        self._margin = gait.trigger_share * half
        self._rest_margin = gait.rest_share * half
        self._dt = dt
        self._lost_time = 0.0
        self._patience = 0.0

    def first_swing(self, situation: StepSituation) -> int | None:
        """Return the foot to swing first, or None to keep standing."""
        gait = self._gait
        ball = situation.estimate.position_ball_in_world[:2]
        capture, soles = situation.capture, situation.soles
        is_lost = _is_outside(capture, soles, self._margin)
        if is_lost and self._is_resting(situation):
            is_lost = _is_outside(capture, soles, self._rest_margin)
        is_lost |= _find_reach(situation.soles - ball) > self._stand_reach
        self._lost_time = self._lost_time + self._dt if is_lost else 0.0
        if self._lost_time >= gait.trigger_time_s:
            self._lost_time = self._patience = 0.0
            return situation.find_swing()
        if not situation.is_wanted:
            self._patience = 0.0
            return None
        self._patience += self._dt
        is_due = self._patience > gait.start_patience_s
        if not is_due and not self._is_settled(situation):
            return None
        self._patience = 0.0
        # The foot farther from the ideal CoP is free to go.
        middle = float(situation.soles[:, 1].mean())
        return RIGHT if situation.ideal_cop[1] >= middle else LEFT

    def may_stop(self, situation: StepSituation, steps: int) -> bool:
        """Return whether the robot may stay on both feet after a touchdown.

        Args:
            situation: What to look at.
            steps: Steps since stepping began.
        """
        gait, soles = self._gait, situation.soles
        if situation.is_wanted or steps < gait.stop_steps:
            return False
        if _is_outside(situation.capture, soles, 0.5 * self._margin):
            return False
        # Standing soles are carried at twice the ball's speed: where they will be,
        # seen from the ball, once it has come to rest at its reference.
        ball = situation.estimate.position_ball_in_world[:2]
        offsets = soles - 2.0 * ball + situation.find_reference()
        speed = np.abs(situation.estimate.linear_velocity_ball_in_world[:2]).max()
        apart = abs(float(soles[0, 0] - soles[1, 0]))
        return bool(
            np.abs(offsets.mean(axis=0)).max() < gait.stop_offset_m
            and _find_reach(offsets) < self._stop_reach
            and speed < gait.stop_speed_m_s
            and apart < gait.stop_offset_m
        )

    def _is_resting(self, situation: StepSituation) -> bool:
        """Return whether the robot balances over the ball's top, wherever its feet."""
        gait, estimate = self._gait, situation.estimate
        offset = situation.capture - estimate.position_ball_in_world[:2]
        velocity = estimate.linear_velocity_ball_in_world[:2]
        return bool(
            np.abs(offset).max() < gait.start_offset_m
            and np.abs(velocity).max() < gait.rest_speed_m_s
        )

    def _is_settled(self, situation: StepSituation) -> bool:
        """Return whether the robot rests over the ball's top."""
        gait = self._gait
        return _is_settled(
            situation.estimate.record,
            situation.soles,
            gait.start_offset_m,
            gait.start_speed_m_s,
        )


def _find_reach(offsets: Array) -> float:
    """Return how far from the ball's top, across the heading, a foot stands, [m].

    Args:
        offsets: Sole centres seen from the ball's centre, shape (2, 2), [m].
    """
    return max(abs(float(offsets[0, 1])), abs(float(offsets[1, 1])))


@compiled
def _is_outside(cop: Array, soles: Array, margin: Array) -> bool:
    """Return whether a CoP has left the soles' hull, widened by a margin.

    Args:
        cop: Shape (2,), [m].
        soles: Sole centres (left, right), shape (2, 2), [m].
        margin: Along and across the soles, shape (2,), [m].
    """
    for i in range(2):
        low, high = min(soles[0, i], soles[1, i]), max(soles[0, i], soles[1, i])
        if cop[i] < low - margin[i] or cop[i] > high + margin[i]:
            return True
    return False


@compiled
def _is_settled(
    estimates: Record, soles: Array, largest_offset: float, largest_speed: float
) -> bool:
    """Return whether CoM and feet are near the ball's top, and CoM and ball slow.

    Args:
        estimates: State estimate, shape (1,), dtype `ESTIMATE`.
        soles: Sole centres (left, right), shape (2, 2), [m].
        largest_offset: From the ball's centre along either axis, [m].
        largest_speed: Along either axis, [m/s].
    """
    estimate = estimates[0]
    for i in range(2):
        ball = estimate["position_ball_in_world"][i]
        offset = max(
            abs(0.5 * (soles[0, i] + soles[1, i]) - ball),
            abs(estimate["position_com_in_world"][i] - ball),
        )
        speed = max(
            abs(estimate["linear_velocity_com_in_world"][i]),
            abs(estimate["linear_velocity_ball_in_world"][i]),
        )
        if not (offset < largest_offset and speed < largest_speed):
            return False
    return True
