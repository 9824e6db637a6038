"""Which foot swings next, when and how long: the schedule whose plan costs the least.

A regular gait follows the clock. After a push no plan may be good that keeps to it: the
foot that is due would leave the other one where the CoP cannot go. In double support
all is open yet, the foot and the time of its lift-off and of its landing, and the
preview tells what each choice costs. Few are worth a look, so all are looked at.
"""

from __future__ import annotations

from collections.abc import Callable

from ballsim_controllers.footsteps.gait import LEFT, RIGHT, GaitClock, GaitTiming
from ballsim_controllers.footsteps.planner import Plan
from ballsim_controllers.footsteps.timeline import Timeline, Timelines
from ballsim_controllers.settings import GaitSettings

__all__ = ["StepSchedule"]

Planning = Callable[[Timeline], Plan]


class StepSchedule:
    """Chooses foot, lift-off and landing among those of the near future.

    A swing may be shorter than that of the regular gait: the ball gets less far away
    meanwhile. It comes last among the choices, to be taken only where it costs less.

    On a ball that rolls fast each step takes some effort, and a foot that leaves out of
    turn is carried off farther than its drives bring it back in time, which no plan
    knows of. There the schedule is kept up to a larger effort.

    Args:
        timelines: What lies ahead, by foot and times.
        timing: Durations of the regular gait.
        settings: Effort up to which the scheduled plan is kept, and that on a fast
            ball, latest lift-off from now on and by how much a swing may be shorter.
            No double support is drawn out beyond twice that latest time.
        cell: Length of a cell of the preview, [s].
    """

    def __init__(
        self,
        timelines: Timelines,
        timing: GaitTiming,
        settings: GaitSettings,
        cell: float,
    ) -> None:
        """List the choices."""
        self._timelines = timelines
        count = max(round(settings.reschedule_time_s / cell), 1)
        self._choices = [
            (foot, (i + 1) * cell, timing.single_support - less * cell)
            for less in range(round(settings.reschedule_swing_s / cell) + 1)
            for foot in (LEFT, RIGHT)
            for i in range(count)
        ]
        self._regular = self._choices[: 2 * count]
        self._longest = 2.0 * settings.reschedule_time_s
        self._open_effort = settings.reschedule_effort_m2
        self._fast_speed = settings.fast_speed_m_s
        self._fast_effort = max(settings.fast_effort_m2, self._open_effort)

    def begin(self, make_plan: Planning) -> int:
        """Return the foot that a standing robot best swings first.

        Args:
            make_plan: Returns the plan for a timeline.
        """
        efforts = [
            (make_plan(self._timelines.begin(*choice)).effort, choice[0])
            for choice in self._regular
        ]
        return min(efforts)[1]

    def revise(
        self,
        clock: GaitClock,
        plan: Plan,
        timeline: Timeline,
        make_plan: Planning,
        speed: float,
    ) -> tuple[Plan, Timeline]:
        """Set the clock to the best schedule; return its plan and timeline.

        Args:
            clock: The clock, in double support.
            plan: Plan of the present schedule.
            timeline: Timeline of the present schedule.
            make_plan: Returns the plan for a timeline.
            speed: Asked of the ball, [m/s].
        """
        is_fast = speed > self._fast_speed
        if plan.effort <= (self._fast_effort if is_fast else self._open_effort):
            return plan, timeline
        best, kept = plan.effort, timeline
        left = self._longest - clock.time_in_phase
        for choice in self._choices:
            other = self._timelines.begin(*choice)
            if other is kept or choice[1] > left:
                continue
            candidate = make_plan(other)
            if candidate.effort < best:
                best, plan, timeline = candidate.effort, candidate, other
                clock.reschedule(*choice)
        return plan, timeline
