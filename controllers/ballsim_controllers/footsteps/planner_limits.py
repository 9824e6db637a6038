"""What the footstep planner may use of soles and legs."""

from __future__ import annotations

from dataclasses import dataclass

from ballsim_controllers.footsteps.calibration import CalibrationMargins
from ballsim_controllers.settings import WheeledLipSettings

__all__ = ["PlannerLimits", "limit_planner"]

_MOST_RESERVE = 0.9  # of a sole: a plan needs some of it


@dataclass(frozen=True, slots=True)
class PlannerLimits:
    """What the planner may use.

    A plan that needs all of the sole fails at the first CoP that comes late: feedback
    finds nothing left to answer with. So the plan gets less of it the farther it looks
    ahead.

    Attributes:
        half_length: Usable half length of a sole, [m].
        half_width: Usable half width of a sole, [m].
        sagittal_reserve: Share of the half length that is kept for feedback to come.
        lateral_reserve: Likewise of the half width.
        reserve_cells: Cells ahead from which on all of it is kept.
        nominal_lateral: Nominal lateral landing offset w, [m].
        sagittal_reach: Largest sagittal landing offset, [m].
        lateral_inward: How far a foot may land inside of w, [m].
        lateral_outward: How far a foot may land outside of w, [m].
        separation: Least lateral distance of the soles' centres at landing, [m].
        sagittal_weight: Weight of the sagittal deviation from nominal.
        lateral_weight: Weight of the lateral deviation from nominal.
    """

    half_length: float
    half_width: float
    sagittal_reserve: float
    lateral_reserve: float
    reserve_cells: int
    nominal_lateral: float
    sagittal_reach: float
    lateral_inward: float
    lateral_outward: float
    separation: float
    sagittal_weight: float
    lateral_weight: float

    def usable(self, cell: int) -> tuple[float, float]:
        """Return the half length and half width that a plan may use in a cell, [m].

        Source:
            Constraint tightening: Chisci, Rossiter and Zappa, "Systems with persistent
            disturbances: predictive control with restricted constraints", Automatica
            37 (2001).
        """
        ahead = cell / self.reserve_cells if self.reserve_cells else 1.0
        ahead = min(ahead, 1.0)
        return (
            (1.0 - self.sagittal_reserve * ahead) * self.half_length,
            (1.0 - self.lateral_reserve * ahead) * self.half_width,
        )


def limit_planner(
    settings: WheeledLipSettings,
    stance_half_width: float,
    ball_radius: float,
    margins: CalibrationMargins,
) -> PlannerLimits:
    """Return what the planner may use on a ball of some radius.

    Args:
        settings: Settings of the controller.
        stance_half_width: Half of the distance of the soles' centres, [m].
        ball_radius: Radius of the ball, [m].
        margins: What is kept back for the encoders.
    """
    planner, forces = settings.planner, settings.forces
    halves = forces.cop_half_length_m, forces.cop_half_width_m
    along, across = (
        min(planner.reserve_share + margin / half, _MOST_RESERVE)
        for margin, half in zip(margins.support, halves, strict=True)
    )
    reach = min(planner.sagittal_reach_m, planner.reach_share * ball_radius)
    separation = min(planner.separation_m, planner.separation_share * ball_radius)
    return PlannerLimits(
        half_length=halves[0],
        half_width=halves[1],
        sagittal_reserve=along,
        lateral_reserve=across,
        reserve_cells=round(planner.reserve_time_s / settings.rates.preview_period_s),
        nominal_lateral=stance_half_width,
        sagittal_reach=reach,
        lateral_inward=planner.lateral_inward_m,
        lateral_outward=planner.lateral_outward_m,
        separation=separation + margins.gap,
        sagittal_weight=planner.sagittal_weight,
        lateral_weight=planner.lateral_weight,
    )
