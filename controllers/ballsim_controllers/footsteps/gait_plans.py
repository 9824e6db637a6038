"""Timelines and planner of a gait, shared by the controllers of a process.

Both hold no state but tables, which depend on the design alone. In a study many
controllers of the same design follow one another: the tables are made once.
"""

from __future__ import annotations

from dataclasses import dataclass

from ballsim_controllers.footsteps.axis_model import AxisModel
from ballsim_controllers.footsteps.calibration import CalibrationMargins
from ballsim_controllers.footsteps.gait import GaitTiming
from ballsim_controllers.footsteps.planner import FootstepPlanner
from ballsim_controllers.footsteps.planner_limits import limit_planner
from ballsim_controllers.footsteps.stride import compute_stride
from ballsim_controllers.footsteps.swing import mean_lifting
from ballsim_controllers.footsteps.timeline import Timelines
from ballsim_controllers.frontal.sway import compute_sway
from ballsim_controllers.messages import ControllerSetup
from ballsim_controllers.settings import WheeledLipSettings

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
    settings: WheeledLipSettings,
    timing: GaitTiming,
    setup: ControllerSetup,
    margins: CalibrationMargins,
) -> GaitPlans:
    """Return the plans of a design, made at its first call.

    Not to be shared between threads.

    Args:
        axes: Model of the sagittal and of the lateral axis.
        settings: Settings of the controller.
        timing: Durations of the gait.
        setup: Robot and ball.
        margins: What the planner keeps back for the encoders.
    """
    stance_half_width, ball_radius = setup.robot.stance_half_width, setup.ball.radius
    gait, cell = settings.gait, settings.rates.preview_period_s
    count = settings.planner.cells
    double = round(timing.double_support / cell)
    single = round(timing.single_support / cell)
    lifting = mean_lifting(gait.lift_m, single, cell)
    sway = compute_sway(axes[1], stance_half_width, double, single)
    stride = compute_stride(axes[0], double, lifting)
    limits = limit_planner(settings, stance_half_width, ball_radius, margins)
    cells = [
        model
        for axis in axes
        for model in (axis.double, axis.single, axis.rest().double)
    ]
    arrays = [a for c in cells for a in (c.transition, c.input, c.gain)]
    arrays += [
        a for m in (sway, stride.roll, stride.lift) for a in (m.states, m.inputs)
    ]
    numbers = tuple(array.tobytes() for array in arrays)
    key = (numbers, limits, double, count, cell)
    plans = _made.get(key)
    if plans is None:
        if len(_made) == _LARGEST_COUNT:
            _made.pop(next(iter(_made)))
        timelines, planner = (
            Timelines(sway, count, cell),
            FootstepPlanner(*axes, limits, stride),
        )
        for timeline in timelines.foresee_all():  # none is to be made during a walk
            planner.prepare(timeline)
        plans = _made[key] = GaitPlans(timelines, planner)
    return plans
