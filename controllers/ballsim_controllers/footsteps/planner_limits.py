"""What the footstep planner may use of soles and legs."""

from __future__ import annotations

from dataclasses import dataclass

from ballsim_controllers.settings import WheeledLipSettings

__all__ = ["PlannerLimits", "limit_planner"]


@dataclass(frozen=True, slots=True)
class PlannerLimits:
    """What the planner may use.

    Attributes:
        half_length: Usable half length of a sole, [m].
        half_width: Usable half width of a sole, [m].
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
    nominal_lateral: float
    sagittal_reach: float
    lateral_inward: float
    lateral_outward: float
    separation: float
    sagittal_weight: float
    lateral_weight: float


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
        nominal_lateral=stance_half_width,
        sagittal_reach=reach,
        lateral_inward=planner.lateral_inward_m,
        lateral_outward=planner.lateral_outward_m,
        separation=planner.separation_m,
        sagittal_weight=planner.sagittal_weight,
        lateral_weight=planner.lateral_weight,
    )
