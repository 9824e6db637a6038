"""Footstep planner: CoP within the soles and where the next feet land."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ballsim_controllers.body_pendulum import BALL
from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.axis_model import AxisModel
from ballsim_controllers.footsteps.bounds import (
    PreviewStructure,
    SeparationRow,
    SupportRow,
)
from ballsim_controllers.footsteps.gait import LEFT, RIGHT
from ballsim_controllers.footsteps.planner_limits import PlannerLimits
from ballsim_controllers.footsteps.preview import (
    AxisPreview,
    PreviewProblem,
    PreviewSolution,
)
from ballsim_controllers.footsteps.side_steps import LateralMotion, plan_side_steps
from ballsim_controllers.footsteps.stride import StrideMotion, StrideReference
from ballsim_controllers.footsteps.timeline import Timeline
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, IntArray

__all__ = [
    "ANYWHERE",
    "FootstepPlanner",
    "LandingRange",
    "Plan",
]


_NO_SWING = np.zeros((3, 2))
_NO_SWING.setflags(write=False)
#: Least and greatest offset of a landing along each axis, [m].
LandingRange = tuple[tuple[float, float], tuple[float, float]]
#: Range of a landing that nothing limits.
ANYWHERE: LandingRange = ((-math.inf, math.inf), (-math.inf, math.inf))


@dataclass(frozen=True, slots=True)
class Plan:
    """Result of the planner at one instant.

    Attributes:
        sagittal: Preview along the heading.
        lateral: Preview across the heading.
        command: CoP that keeps to the soles, shape (2,), [m].
        ideal_cop: CoP of the unconstrained feedback, shape (2,), [m].
        landing: Offset of the next landing from the ball's centre, (2,), [m];
            None where no foot lands within the horizon.
        capture: Capture point on the floor while both feet stand, shape (2,), [m].
    """

    sagittal: PreviewSolution
    lateral: PreviewSolution
    command: Array
    ideal_cop: Array
    landing: Array | None
    capture: Array

    @property
    def effort(self) -> float:
        """Return what both previews minimise, [m^2]."""
        return self.sagittal.effort + self.lateral.effort


@dataclass(frozen=True, slots=True)
class _Previews:
    """Both axes for one timeline, and what of the lateral problem is known."""

    sagittal: AxisPreview
    lateral: AxisPreview
    landing_cells: IntArray
    roll: Array
    lift: Array
    sway: Array
    sway_response: Array
    lateral_landings: Array


class FootstepPlanner:
    """Plans both axes over a common timeline.

    Args:
        sagittal: Model of the sagittal axis.
        lateral: Model of the lateral axis.
        limits: What the planner may use.
        stride: Motion along the sagittal axis over a step.
    """

    def __init__(
        self,
        sagittal: AxisModel,
        lateral: AxisModel,
        limits: PlannerLimits,
        stride: StrideReference,
    ) -> None:
        """Keep the models; previews are made where they are first needed."""
        self.limits = limits
        self._stride = stride
        self._models = (sagittal, lateral)
        self._captures = np.array([sagittal.capture, lateral.capture])
        #: Those for a robot that is to step, and those for one that is to rest.
        self._previews: dict[Timeline, tuple[_Previews, _Previews]] = {}

    def plan(
        self,
        timeline: Timeline,
        states: Array,
        soles: Array,
        sagittal_states: Array,
        sagittal_inputs: Array,
        stance_delay: float,
        swing: Array = _NO_SWING,
        landing_range: LandingRange = ANYWHERE,
        lateral_motion: LateralMotion | None = None,
        is_resting: bool = False,
    ) -> Plan:
        """Return CoP and footholds.

        Args:
            timeline: Support over the horizon.
            states: State of each axis, shape (2, 7).
            soles: Sole centres in the world (left, right), shape (2, 2), [m].
            sagittal_states: Sagittal reference per cell, shape (N, 7).
            sagittal_inputs: Sagittal CoP reference per cell, shape (N,), [m].
            stance_delay: Time from a landing to the middle of the single
                support that follows, [s].
            swing: Offset of the swinging sole from the ball's centre, its velocity
                and its acceleration, shape (3, 2); without meaning if both stand.
            landing_range: Least and greatest offset of the next landing along each
                axis, [m].
            lateral_motion: Reference across the heading; None to stay in place.
            is_resting: True where the robot stands, or steps until it can stand.

        Returns:
            The plan.
        """
        both = self._previews.get(timeline) or self.prepare(timeline)
        previews = both[is_resting]
        landings = np.empty(len(timeline.landings))
        _centre_landings(
            landings,
            previews.landing_cells,
            sagittal_states,
            sagittal_inputs,
            stance_delay,
            self.limits.sagittal_reach,
        )
        reference = previews.sagittal.refer(sagittal_states, sagittal_inputs)
        reference += sagittal_states[:, BALL + 1] * previews.roll + previews.lift
        sagittal = previews.sagittal.solve(
            PreviewProblem(
                state=states[0],
                reference=reference,
                soles=soles[:, 0],
                swing=swing[:, 0],
                landing_nominal=landings,
                landing_range=landing_range[0],
            )
        )
        lateral = self._solve_lateral(
            previews,
            PreviewProblem(
                state=states[1],
                reference=previews.sway,
                soles=soles[:, 1],
                swing=swing[:, 1],
                landing_nominal=previews.lateral_landings,
                landing_range=landing_range[1],
            ),
            stance_delay,
            lateral_motion,
        )
        landing = None
        if timeline.landings:
            landing = np.array([sagittal.landings[0], lateral.landings[0]])
        return Plan(
            sagittal=sagittal,
            lateral=lateral,
            command=np.array([sagittal.command, lateral.command]),
            ideal_cop=np.array([sagittal.ideal_cop, lateral.ideal_cop]),
            landing=landing,
            capture=_find_capture_points(self._captures, states),
        )

    def _solve_lateral(
        self,
        previews: _Previews,
        in_place: PreviewProblem,
        stance_delay: float,
        motion: LateralMotion | None,
    ) -> PreviewSolution:
        """Return the preview across the heading; see `plan`."""
        if motion is None:
            return previews.lateral.solve(in_place, previews.sway_response)
        side = plan_side_steps(
            motion,
            previews.lateral_landings,
            previews.landing_cells,
            stance_delay,
            self.limits.separation,
        )
        reference = previews.lateral.refer(motion.states, motion.inputs)
        reference += side.widening * previews.sway
        return previews.lateral.solve(
            replace(
                in_place,
                reference=reference,
                landing_nominal=side.landings,
                landing_play=side.play,
            )
        )

    def prepare(self, timeline: Timeline) -> tuple[_Previews, _Previews]:
        """Return a timeline's previews: of stepping, and of coming to rest."""
        limits, count = self.limits, len(timeline.landings)
        cells = tuple(landing.cell for landing in timeline.landings)
        sagittal = PreviewStructure(
            is_double=timeline.is_double,
            rows=self._sagittal_rows(timeline, count),
            landing_cells=cells,
            landing_lower=(-limits.sagittal_reach,) * count,
            landing_upper=(limits.sagittal_reach,) * count,
            landing_weights=(limits.sagittal_weight,) * count,
            swings=timeline.swings,
            lift_cells=timeline.lift_cells,
            lifting=self._stride.lifting,
        )
        signs = [1.0 if landing.foot == LEFT else -1.0 for landing in timeline.landings]
        inner = limits.nominal_lateral - limits.lateral_inward
        outer = limits.nominal_lateral + limits.lateral_outward
        lateral = PreviewStructure(
            is_double=timeline.is_double,
            rows=self._lateral_rows(timeline, count),
            landing_cells=cells,
            landing_lower=tuple(min(s * inner, s * outer) for s in signs),
            landing_upper=tuple(max(s * inner, s * outer) for s in signs),
            landing_weights=(limits.lateral_weight,) * count,
            separations=self._separations(timeline),
            swings=timeline.swings,
            lift_cells=timeline.lift_cells,
        )
        along = AxisPreview(self._models[0], sagittal)
        roll, lift = (
            self._refer_stride(along, motion, timeline.phases)
            for motion in (self._stride.roll, self._stride.lift)
        )
        found: list[_Previews] = []
        stepping, resting = self._models[1], self._models[1].rest()
        for model in (stepping,) if resting is stepping else (stepping, resting):
            across = AxisPreview(model, lateral)
            sway = across.refer(timeline.sway_states, timeline.sway_inputs)
            previews = _Previews(
                sagittal=along,
                lateral=across,
                landing_cells=np.array(cells, dtype=np.int_),
                roll=roll,
                lift=lift,
                sway=sway,
                sway_response=across.respond(sway),
                lateral_landings=np.array([s * limits.nominal_lateral for s in signs]),
            )
            found.append(previews)
        self._previews[timeline] = found[0], found[-1]
        return self._previews[timeline]

    @staticmethod
    def _refer_stride(
        preview: AxisPreview, motion: StrideMotion, phases: IntArray
    ) -> Array:
        """Return what a motion over a step adds to the reference, shape (N,)."""
        states, inputs = motion.states[phases], motion.inputs[phases]
        states[phases < 0], inputs[phases < 0] = 0.0, 0.0
        return preview.refer(states, inputs)

    def _sagittal_rows(self, timeline: Timeline, count: int) -> tuple[SupportRow, ...]:
        """Bound the CoP by the sole, or around the mean of two soles."""
        rows = []
        for k, cell in enumerate(timeline.cells):
            half, _ = self.limits.usable(k)
            feet = [
                (foot, place)
                for foot, place in ((LEFT, cell.left), (RIGHT, cell.right))
                if place is not None
            ]
            weight = 1.0 / len(feet)
            standing, landings = [0.0, 0.0], [0.0] * count
            for foot, place in feet:
                if place < 0:
                    standing[foot] = weight
                else:
                    landings[place] += weight
            # Between two feet that stand already the hull is known exactly; a
            # foot that is yet to land may be on either side of the other.
            spread = 1.0 if min(standing) > 0.0 else 0.0
            shares = (standing[LEFT], standing[RIGHT])
            rows.append(SupportRow(k, shares, tuple(landings), -half, half, spread))
        return tuple(rows)

    def _lateral_rows(self, timeline: Timeline, count: int) -> tuple[SupportRow, ...]:
        """Bound the CoP by the outer edges of the standing soles."""
        rows = []
        for k, cell in enumerate(timeline.cells):
            _, half = self.limits.usable(k)
            for foot, place, lower, upper in (
                (LEFT, cell.left, -half if cell.right is None else -1e3, half),
                (RIGHT, cell.right, -half, half if cell.left is None else 1e3),
            ):
                if place is None:
                    continue
                standing, landings = [0.0, 0.0], [0.0] * count
                if place < 0:
                    standing[foot] = 1.0
                else:
                    landings[place] = 1.0
                shares = (standing[LEFT], standing[RIGHT])
                rows.append(SupportRow(k, shares, tuple(landings), lower, upper))
        return tuple(rows)

    def _separations(self, timeline: Timeline) -> tuple[SeparationRow, ...]:
        """Keep each landing foot clear of the other one."""
        rows = []
        for index, landing in enumerate(timeline.landings):
            cell = timeline.cells[landing.cell]
            other = cell.right if landing.foot == LEFT else cell.left
            if other is None:
                continue
            sign = 1.0 if landing.foot == LEFT else -1.0
            rows.append(
                SeparationRow(
                    index, other, 1 - landing.foot, sign, self.limits.separation
                )
            )
        return tuple(rows)


@compiled
def _find_capture_points(captures: Array, states: Array) -> Array:
    """Return the capture point along each axis, shape (2,), [m].

    Args:
        captures: Capture point by the state, less twice the ball's place, (2, 7).
        states: State of each axis, shape (2, 7).
    """
    result = np.empty(2)
    for axis in range(2):
        result[axis] = 2.0 * states[axis, BALL]
        for i in range(captures.shape[1]):
            result[axis] += captures[axis, i] * states[axis, i]
    return result


@compiled
def _centre_landings(
    landings: Array,
    cells: IntArray,
    states: Array,
    inputs: Array,
    delay: float,
    reach: float,
) -> None:
    """Write landing offsets that centre the reference CoP in the sole.

    The sole is carried at the ball's speed relative to the ball's centre,
    so it lands behind the place where it is to be in the middle of its
    single support.
    """
    for i, cell in enumerate(cells):
        position, velocity = states[cell, 2], states[cell, 3]
        landings[i] = clip(inputs[cell] - position - delay * velocity, -reach, reach)
