"""Target angles theta_1* over time: Sections VI-C and VI-D.

A target is asked once at every step of one run, in order of time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple, Protocol

from ballsim.paper.parameter_sets import StageReading
from ballsim_controllers.reference import ReferenceSample, constant_velocity_target

__all__ = [
    "STAGES",
    "TOLERANCE",
    "Moment",
    "SpeedRamp",
    "StageSwitch",
    "SteppedTarget",
    "Target",
    "VelocityStages",
]

STAGES = (0.2, 0.3, 0.35, 0.375, 0.4)
"""Intermediate and desired reference velocities of Section VI-D, [rad/s]."""

TOLERANCE = 0.01
"""epsilon of Section VI-D, [rad/s]."""


class Moment(NamedTuple):
    """What a target may look at.

    Attributes:
        time: [s].
        angle: Estimated theta_1, [rad].
        rate: Estimated theta_1', [rad/s].
        is_lifting: Whether a foot has just left the ball.
    """

    time: float
    angle: float
    rate: float
    is_lifting: bool


class Target(Protocol):
    """Target angle of one run."""

    def advance(self, moment: Moment) -> float:
        """Return theta_1* at a moment, [rad]."""
        ...


class SteppedTarget:
    """Target that changes at certain instants, Section VI-C.

    Args:
        points: Pairs (time in [s], theta_1* in [rad]), in order of time; 0
            before the first.

    Examples:
        >>> target = SteppedTarget((0.0, 0.5), (3.0, 1.0))
        >>> target.at(2.9), target.at(3.0)
        (0.5, 1.0)
    """

    def __init__(self, *points: tuple[float, float]) -> None:
        """Keep the points."""
        self._times = [time for time, _ in points]
        self._angles = [0.0, *(angle for _, angle in points)]

    def at(self, time: float) -> float:
        """Return theta_1* at a time, [rad]."""
        return self._angles[bisect_right(self._times, time)]

    def advance(self, moment: Moment) -> float:
        """Return theta_1* at a moment, [rad]."""
        return self.at(moment.time)


class StageSwitch(NamedTuple):
    """The end of a stage.

    Attributes:
        time: [s].
        stage: Reference velocity of the stage that ends, [rad/s].
        speed: Estimated theta_1' at that instant, [rad/s].
    """

    time: float
    stage: float
    speed: float


class VelocityStages:
    """Constant velocity control through intermediate velocities, Section VI-D.

    Args:
        lead_time: KT'/KT of (9), [s].
        reading: theta_1^r where the velocity changes.
        is_checked_at_lift_off: Whether theta_1' is looked at only then.
        stages: Reference velocities, [rad/s].
        tolerance: epsilon, [rad/s].
    """

    def __init__(
        self,
        lead_time: float,
        reading: StageReading = StageReading.RESTART,
        is_checked_at_lift_off: bool = False,
        stages: Sequence[float] = STAGES,
        tolerance: float = TOLERANCE,
    ) -> None:
        """Start with the first stage."""
        self._lead_time = lead_time
        self._reading = reading
        self._is_checked_at_lift_off = is_checked_at_lift_off
        self._stages = tuple(stages)
        self._tolerance = tolerance
        self._start_time, self._start_angle = 0.0, 0.0
        #: Switches so far.
        self.switches: list[StageSwitch] = []

    def advance(self, moment: Moment) -> float:
        """Return theta_1* at a moment, equation (9), [rad]."""
        stage = self._stages[len(self.switches)]
        if self._is_reached(moment, stage):
            self._start_angle = self._next_start(moment, stage)
            self._start_time = moment.time
            self.switches.append(StageSwitch(moment.time, stage, moment.rate))
            stage = self._stages[len(self.switches)]
        angle = self._start_angle + stage * (moment.time - self._start_time)
        sample = ReferenceSample(angle, stage)
        return constant_velocity_target(sample, self._lead_time)

    def _is_reached(self, moment: Moment, stage: float) -> bool:
        is_looked_at = moment.is_lifting or not self._is_checked_at_lift_off
        is_last = len(self.switches) == len(self._stages) - 1
        return is_looked_at and not is_last and moment.rate >= stage - self._tolerance

    def _next_start(self, moment: Moment, stage: float) -> float:
        """Return theta_1^r right after a switch, [rad]."""
        if self._reading is StageReading.RESTART:
            return moment.angle
        if self._reading is StageReading.INTEGRAL:
            return self._start_angle + stage * (moment.time - self._start_time)
        return self._stages[len(self.switches) + 1] * moment.time


class SpeedRamp:
    """Reference velocity that is linear between points, with the angle of (9).

    Args:
        lead_time: KT'/KT of (9), [s].
        points: Pairs (time in [s], theta_1^r' in [rad/s]), the first at time 0;
            constant after the last.

    Examples:
        >>> ramp = SpeedRamp(2.5, (0.0, 0.0), (2.0, 0.4))
        >>> ramp.sample_at(1.0).velocity
        0.2
    """

    def __init__(self, lead_time: float, *points: tuple[float, float]) -> None:
        """Integrate the velocity from point to point."""
        self._lead_time = lead_time
        self._points = points
        self._times = [time for time, _ in points]
        self._angles = [0.0]
        for (start, first), (end, second) in pairwise(points):
            way = 0.5 * (first + second) * (end - start)
            self._angles.append(self._angles[-1] + way)

    def sample_at(self, time: float) -> ReferenceSample:
        """Return theta_1^r and its rate at a time."""
        i = bisect_right(self._times, time) - 1
        start, speed = self._points[i]
        slope = 0.0
        if i + 1 < len(self._points):
            end, last = self._points[i + 1]
            slope = (last - speed) / (end - start)
        passed = time - start
        angle = self._angles[i] + (speed + 0.5 * slope * passed) * passed
        return ReferenceSample(angle, speed + slope * passed, slope)

    def advance(self, moment: Moment) -> float:
        """Return theta_1* at a moment, equation (9), [rad]."""
        return constant_velocity_target(self.sample_at(moment.time), self._lead_time)
