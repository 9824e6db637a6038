"""What the footstep planner may use of soles and legs."""

from __future__ import annotations

from dataclasses import dataclass

from ballsim_controllers.settings import WheeledLipSettings

__all__ = ["PlannerLimits", "limit_planner"]


@dataclass(frozen=True, slots=True)
class PlannerLimits:
    """What the planner may use.

    A plan that needs all of the sole fails at the first CoP that comes late: feedback
    finds nothing left to answer with. So the plan gets less of it the farther it looks
    ahead.

    Attributes:
        half_length: Usable half length of a sole, [m].
        half_width: Usable half width of a sole, [m].
        reserve_share: Share of the usable sole that is kept for feedback to come.
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
    reserve_share: float
    reserve_cells: int
    nominal_lateral: float
    sagittal_reach: float
    lateral_inward: float
    lateral_outward: float
    separation: float
    sagittal_weight: float
    lateral_weight: float

    def usable(self, cell: int) -> float:
        """Return the share of the sole that a plan may use in a cell.

        Source:
            Constraint tightening: Chisci, Rossiter and Zappa, "Systems with persistent
            disturbances: predictive control with restricted constraints", Automatica
            37 (2001).
        """
        ahead = cell / self.reserve_cells if self.reserve_cells else 1.0
        return 1.0 - self.reserve_share * min(ahead, 1.0)


def limit_planner(
    settings: WheeledLipSettings, stance_half_width: float, ball_radius: float
) -> PlannerLimits:
    """Return what the planner may use on a ball of some radius.

    Args:
        settings: Settings of the controller.
        stance_half_width: Half of the distance of the soles' centres, [m].
        ball_radius: Radius of the ball, [m].
    """
    planner, forces = settings.planner, settings.forces
    reach = min(planner.sagittal_reach_m, planner.reach_share * ball_radius)
    return PlannerLimits(
        half_length=forces.cop_half_length_m,
        half_width=forces.cop_half_width_m,
        reserve_share=planner.reserve_share,
        reserve_cells=round(planner.reserve_time_s / settings.rates.preview_period_s),
        nominal_lateral=stance_half_width,
        sagittal_reach=reach,
        lateral_inward=planner.lateral_inward_m,
        lateral_outward=planner.lateral_outward_m,
        separation=planner.separation_m,
        sagittal_weight=planner.sagittal_weight,
        lateral_weight=planner.lateral_weight,
    )
