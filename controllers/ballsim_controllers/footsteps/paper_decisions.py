"""The paper's swing condition for a robot that has two planes."""

from __future__ import annotations

from ballsim_controllers.footsteps.conditions import (
    FootstepParameters,
    choose_swing_foot,
)
from ballsim_controllers.footsteps.decisions import StepDecisions, StepSituation
from ballsim_controllers.footsteps.gait import LEFT, RIGHT
from ballsim_controllers.settings import WheeledLipSettings

__all__ = ["PaperDecisions"]

LEVEL = 0.005
"""Feet nearer to each other than this along the ball are level, [m]."""


class PaperDecisions(StepDecisions):
    """The paper's swing condition, along the heading and across.

    Along the heading the foot behind the ideal CoP swings; where both are level,
    or the CoP leaves the soles sideways, the one farther from the CoP. Steps
    that are merely commanded follow the rules of ``wheeled-lip``.

    Args:
        settings: Settings of the pipeline.
        params: Parameters of the paper's planner.
        dt: Control period, [s].
    """

    def __init__(
        self, settings: WheeledLipSettings, params: FootstepParameters, dt: float
    ) -> None:
        """Keep half size and used share of a sole, along and across."""
        super().__init__(settings.gait, settings.forces, dt, params.ball_radius)
        across = (settings.forces.cop_half_width_m, settings.gait.trigger_share)
        self._domains = ((params.half_length, params.shrink), across)
        #: Whether the operator wants steps in place.
        self.is_stepping = False

    def first_swing(self, situation: StepSituation) -> int | None:
        """Return the foot that has to swing, or None to keep standing."""
        cops, soles = situation.ideal_cop.tolist(), situation.soles.copy()
        if abs(soles[LEFT, 0] - soles[RIGHT, 0]) < LEVEL:
            soles[:, 0] = soles[LEFT, 0]
        outer = RIGHT if cops[1] >= soles[:, 1].mean() else LEFT
        for cop, (left, right), domain in zip(
            cops, soles.T.tolist(), self._domains, strict=True
        ):
            foot = choose_swing_foot(cop, (left, right), *domain, outer)
            if foot is not None:
                return foot
        return super().first_swing(situation) if self.is_stepping else None

    def may_stop(self, situation: StepSituation, steps: int) -> bool:
        """Return whether both feet may stand: no foot has to swing."""
        return not self.is_stepping and self.first_swing(situation) is None
