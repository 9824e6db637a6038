"""Timelines and planner of a gait, shared by the controllers of a process.

Both hold no state but tables, which depend on the design alone. In a study many
controllers of the same design follow one another: the tables are made once.
"""

from __future__ import annotations

from dataclasses import dataclass

from ballsim_controllers.footsteps.axis_model import AxisModel
from ballsim_controllers.footsteps.planner import FootstepPlanner
from ballsim_controllers.footsteps.planner_limits import PlannerLimits
from ballsim_controllers.footsteps.timeline import Timelines
from ballsim_controllers.frontal.sway import SwayReference

__all__ = ["GaitPlans", "find_gait_plans"]

_LARGEST_COUNT = 16  # designs that are kept
_made: dict[object, GaitPlans] = {}


@dataclass(frozen=True, slots=True)
class GaitPlans:
    """What a gait needs to plan ahead.

    Attributes:
        timelines: What the gait clock foresees.
        planner: CoP and footholds for it.
    """

    timelines: Timelines
    planner: FootstepPlanner


def find_gait_plans(
    axes: tuple[AxisModel, AxisModel],
    limits: PlannerLimits,
    sway: SwayReference,
    count: int,
    cell: float,
) -> GaitPlans:
    """Return the plans of a design, made at its first call.

    Not to be shared between threads.

    Args:
        axes: Model of the sagittal and of the lateral axis.
        limits: What the planner may use.
        sway: Periodic lateral reference.
        count: Number of cells of the horizon.
        cell: Length of a cell, [s].
    """
    cells = [model for axis in axes for model in (axis.double, axis.single)]
    arrays = [a for c in cells for a in (c.transition, c.input, c.gain)]
    arrays += [sway.states, sway.inputs]
    numbers = tuple(array.tobytes() for array in arrays)
    key = (numbers, limits, sway.double_cells, count, cell)
    plans = _made.get(key)
    if plans is None:
        if len(_made) == _LARGEST_COUNT:
            _made.pop(next(iter(_made)))
        timelines, planner = (
            Timelines(sway, count, cell),
            FootstepPlanner(*axes, limits),
        )
        for timeline in timelines.foresee_all():  # none is to be made during a walk
            planner.prepare(timeline)
        plans = _made[key] = GaitPlans(timelines, planner)
    return plans
