"""Footstep planner: CoP within the soles and where the next feet land."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import BALL
from ballsim_controllers.footsteps.gait import LEFT, RIGHT
from ballsim_controllers.footsteps.preview import (
    AxisModel,
    AxisPreview,
    PreviewProblem,
    PreviewSolution,
    SeparationRow,
    SupportRow,
)
from ballsim_controllers.footsteps.timeline import Timeline
from ballsim_controllers.messages import Array

__all__ = ["FootstepPlanner", "Plan", "PlannerLimits"]


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


@dataclass(frozen=True, slots=True)
class Plan:
    """Result of the planner at one instant.

    Attributes:
        sagittal: Preview along the heading.
        lateral: Preview across the heading.
        ideal_cop: CoP of the unconstrained feedback, shape (2,), [m].
        landing: Offset of the next landing from the ball's centre, (2,), [m];
            None where no foot lands within the horizon.
    """

    sagittal: PreviewSolution
    lateral: PreviewSolution
    ideal_cop: Array
    landing: Array | None

    @property
    def escape(self) -> float:
        """Return how far the CoM is from the ball's centre at the end, [m]."""
        ends = (self.sagittal.states[-1], self.lateral.states[-1])
        return max(abs(float(end[0] - end[BALL])) for end in ends)


class FootstepPlanner:
    """Plans both axes over a common timeline.

    Args:
        sagittal: Model of the sagittal axis.
        lateral: Model of the lateral axis.
        limits: What the planner may use.
        cells: Number of cells of the horizon.
    """

    def __init__(
        self, sagittal: AxisModel, lateral: AxisModel, limits: PlannerLimits, cells: int
    ) -> None:
        """Build both previews."""
        self.limits = limits
        self.cells = cells
        self._axes = (AxisPreview(sagittal, cells), AxisPreview(lateral, cells))

    def plan(
        self,
        timeline: Timeline,
        states: tuple[Array, Array],
        soles: Array,
        sagittal_states: Array,
        sagittal_inputs: Array,
        stance_delay: float,
    ) -> Plan:
        """Return CoP and footholds.

        Args:
            timeline: Support over the horizon.
            states: State of each axis, shape (7,) each.
            soles: Sole centres in the world (left, right), shape (2, 2), [m].
            sagittal_states: Sagittal reference per cell, shape (N, 7).
            sagittal_inputs: Sagittal CoP reference per cell, shape (N,), [m].
            stance_delay: Time from a landing to the middle of the single
                support that follows, [s].

        Returns:
            The plan.
        """
        limits = self.limits
        count = len(timeline.landings)
        cells = tuple(landing.cell for landing in timeline.landings)
        is_double = timeline.is_double
        sagittal = PreviewProblem(
            is_double=is_double,
            state=states[0],
            state_reference=sagittal_states,
            input_reference=sagittal_inputs,
            rows=self._sagittal_rows(timeline, soles[:, 0], count),
            landing_cells=cells,
            landing_nominal=self._sagittal_landings(
                cells, sagittal_states, sagittal_inputs, stance_delay
            ),
            landing_lower=(-limits.sagittal_reach,) * count,
            landing_upper=(limits.sagittal_reach,) * count,
            landing_weights=(limits.sagittal_weight,) * count,
        )
        signs = [1.0 if landing.foot == LEFT else -1.0 for landing in timeline.landings]
        inner = limits.nominal_lateral - limits.lateral_inward
        outer = limits.nominal_lateral + limits.lateral_outward
        lateral = PreviewProblem(
            is_double=is_double,
            state=states[1],
            state_reference=timeline.sway_states,
            input_reference=timeline.sway_inputs,
            rows=self._lateral_rows(timeline, soles[:, 1], count),
            landing_cells=cells,
            landing_nominal=tuple(s * limits.nominal_lateral for s in signs),
            landing_lower=tuple(min(s * inner, s * outer) for s in signs),
            landing_upper=tuple(max(s * inner, s * outer) for s in signs),
            landing_weights=(limits.lateral_weight,) * count,
            separations=self._separations(timeline, soles[:, 1]),
        )
        problems = (sagittal, lateral)
        solutions = [
            axis.solve(problem)
            for axis, problem in zip(self._axes, problems, strict=True)
        ]
        ideal = np.array(
            [
                axis.ideal_cop(problem)
                for axis, problem in zip(self._axes, problems, strict=True)
            ]
        )
        landing = np.array([s.landings[0] for s in solutions]) if count else None
        return Plan(solutions[0], solutions[1], ideal, landing)

    def _sagittal_landings(
        self, cells: tuple[int, ...], states: Array, inputs: Array, delay: float
    ) -> tuple[float, ...]:
        """Return landing offsets that centre the reference CoP in the sole.

        The sole is carried at the ball's speed relative to the ball's centre,
        so it lands behind the place where it is to be in the middle of its
        single support.
        """
        reach = self.limits.sagittal_reach
        result = []
        for cell in cells:
            position, velocity = states[cell, 2:4]
            offset = float(inputs[cell] - position - delay * velocity)
            result.append(min(max(offset, -reach), reach))
        return tuple(result)

    def _sagittal_rows(
        self, timeline: Timeline, soles: Array, count: int
    ) -> list[SupportRow]:
        """Bound the CoP by the sole, or around the mean of two soles."""
        half = self.limits.half_length
        rows = []
        for k, cell in enumerate(timeline.cells):
            feet = [
                (place, float(soles[foot]))
                for foot, place in ((LEFT, cell.left), (RIGHT, cell.right))
                if place is not None
            ]
            weight = 1.0 / len(feet)
            standing = sum(weight * sole for place, sole in feet if place < 0)
            carried = sum(weight for place, _ in feet if place < 0)
            landings = [0.0] * count
            for place, _ in feet:
                if place >= 0:
                    landings[place] += weight
            # Between two feet that stand already the hull is known exactly; a
            # foot that is yet to land may be on either side of the other.
            both_stand = len(feet) == 2 and carried == 1.0
            reach = half + (0.5 * abs(feet[0][1] - feet[1][1]) if both_stand else 0.0)
            rows.append(
                SupportRow(k, standing, carried, tuple(landings), -reach, reach)
            )
        return rows

    def _lateral_rows(
        self, timeline: Timeline, soles: Array, count: int
    ) -> list[SupportRow]:
        """Bound the CoP by the outer edges of the standing soles."""
        half = self.limits.half_width
        rows = []
        for k, cell in enumerate(timeline.cells):
            for foot, place, lower, upper in (
                (LEFT, cell.left, -half if cell.right is None else -1e3, half),
                (RIGHT, cell.right, -half, half if cell.left is None else 1e3),
            ):
                if place is None:
                    continue
                landings = [0.0] * count
                if place >= 0:
                    landings[place] = 1.0
                stands = place < 0
                rows.append(
                    SupportRow(
                        k,
                        float(soles[foot]) if stands else 0.0,
                        1.0 if stands else 0.0,
                        tuple(landings),
                        lower,
                        upper,
                    )
                )
        return rows

    def _separations(self, timeline: Timeline, soles: Array) -> list[SeparationRow]:
        """Keep each landing foot clear of the other one."""
        rows = []
        for index, landing in enumerate(timeline.landings):
            cell = timeline.cells[landing.cell]
            other = cell.right if landing.foot == LEFT else cell.left
            if other is None:
                continue
            standing = float(soles[1 - landing.foot]) if other < 0 else 0.0
            sign = 1.0 if landing.foot == LEFT else -1.0
            rows.append(
                SeparationRow(index, other, standing, sign, self.limits.separation)
            )
        return rows
