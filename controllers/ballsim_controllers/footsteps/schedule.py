"""Which foot swings next, and when: the schedule whose plan costs the least.

A regular gait follows the clock. After a push no plan may be good that keeps to it: the
foot that is due would leave the other one where the CoP cannot go. In double support
both are open yet, the foot and the time of its lift-off, and the preview tells what
each choice costs. Few choices are worth a look, so all of them are looked at.
"""

from __future__ import annotations

from collections.abc import Callable

from ballsim_controllers.footsteps.gait import LEFT, RIGHT, GaitClock
from ballsim_controllers.footsteps.planner import Plan
from ballsim_controllers.footsteps.timeline import Timeline, Timelines

__all__ = ["StepSchedule"]

Planning = Callable[[Timeline], Plan]


class StepSchedule:
    """Chooses foot and lift-off among those of the near future.

    Args:
        timelines: What lies ahead, by foot and time.
        latest: Latest lift-off from now on, [s]; no double support is drawn out
            beyond twice this time.
        cell: Length of a cell of the preview, [s].
        open_effort: Effort of the scheduled plan up to which it is kept, [m^2].
    """

    def __init__(
        self,
        timelines: Timelines,
        latest: float,
        cell: float,
        open_effort: float,
    ) -> None:
        """List the times."""
        self._timelines = timelines
        count = max(round(latest / cell), 1)
        self._choices = [
            (foot, (i + 1) * cell) for foot in (LEFT, RIGHT) for i in range(count)
        ]
        self._longest = 2.0 * latest
        self._open_effort = open_effort

    def begin(self, make_plan: Planning) -> int:
        """Return the foot that a standing robot best swings first.

        Args:
            make_plan: Returns the plan for a timeline.
        """
        efforts = [
            (make_plan(self._timelines.begin(*choice)).effort, choice[0])
            for choice in self._choices
        ]
        return min(efforts)[1]

    def revise(
        self, clock: GaitClock, plan: Plan, timeline: Timeline, make_plan: Planning
    ) -> tuple[Plan, Timeline]:
        """Set the clock to the best schedule; return its plan and timeline.

        Args:
            clock: The clock, in double support.
            plan: Plan of the present schedule.
            timeline: Timeline of the present schedule.
            make_plan: Returns the plan for a timeline.
        """
        if plan.effort <= self._open_effort:
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
