"""How fast the ball's reference may move, by ball and direction."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ballsim_controllers.settings import ReferenceSettings

__all__ = ["MotionLimits", "PathLimits"]

_LEAST_SHARE = 1e-6
"""Of an axis in a straight way: a limit must not be 0."""


@dataclass(frozen=True, slots=True)
class PathLimits:
    """Limits of the motion along a path.

    Attributes:
        speeds: Largest speeds along and across the heading, [m/s]; those of other
            directions lie on the ellipse through them.
        top: Largest speed in every direction, [m/s].
        acceleration: Largest acceleration on the floor, [m/s^2]; bends may take
            half of its square.
        smoothing_time: Window over which the acceleration is smoothed, [s].
        heading: Direction that the robot faces, [rad]; None for that of the path.
        turn_rate: Largest rate of a heading that is that of the path, [rad/s].
    """

    speeds: tuple[float, float]
    top: float
    acceleration: float
    smoothing_time: float
    heading: float | None = 0.0
    turn_rate: float = math.inf


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of the reference along and across the heading.

    Attributes:
        speeds: Largest speeds on the way to a target, [rad/s].
        accelerations: Largest accelerations, [rad/s^2].
        cruise: Largest commanded speed, [rad/s].
        smoothing: Window over which the acceleration is smoothed, [s].
        heading: Direction that the robot faces, [rad].
    """

    speeds: tuple[float, float]
    accelerations: tuple[float, float]
    cruise: float
    smoothing: float
    heading: float = 0.0

    @classmethod
    def of(cls, settings: ReferenceSettings, radius: float) -> MotionLimits:
        """Return the limits on a ball of some radius, [m]."""
        acceleration = min(
            settings.max_acceleration_rad_s2, settings.max_acceleration_m_s2 / radius
        )
        forwards = min(settings.max_speed_rad_s, settings.max_speed_m_s / radius)
        sideways = min(settings.max_lateral_rad_s, settings.max_lateral_m_s / radius)
        return cls(
            (forwards, sideways),
            (acceleration, acceleration),
            min(settings.max_cruise_rad_s, settings.max_cruise_m_s / radius),
            settings.smoothing_time_s,
        )

    def face(self, heading: float | None) -> MotionLimits:
        """Return the limits along the world's axes for a robot that faces aside.

        Args:
            heading: Direction that it faces, [rad]; None while it turns.
        """
        if heading == 0.0:
            return self
        slowest = min(self.speeds)
        if heading is None:
            heading, speeds = 0.0, (slowest, slowest)
        else:
            speeds = self.speeds
        cruise = min(self.cruise, slowest)
        return replace(self, speeds=speeds, cruise=cruise, heading=heading)

    def on_floor(
        self, radius: float, top_speed: float, turn_rate: float | None = None
    ) -> PathLimits:
        """Return the limits on a path.

        Args:
            radius: Radius of the ball, [m].
            top_speed: Largest speed in every direction, [m/s]; 0 for no other one.
            turn_rate: Largest rate of the heading, [rad/s], if the robot faces along
                the path; else None.
        """
        along, across = self.speeds
        top = top_speed or max(self.speeds) * radius
        rate = self.accelerations[0] * radius
        return PathLimits(
            (along * radius, across * radius),
            top,
            rate,
            self.smoothing,
            self.heading if turn_rate is None else None,
            math.inf if turn_rate is None else turn_rate,
        )

    def share(self, way: tuple[float, float]) -> MotionLimits:
        """Return limits by which both axes need the same time for a straight way.

        What a direction allows lies on the ellipse through what the robot can do
        forwards and sideways.

        Args:
            way: Along the world's axes, not 0, [rad].
        """
        length, (x, y) = math.hypot(*way), way
        cosine, sine = math.cos(self.heading), math.sin(self.heading)
        forwards, sideways = cosine * x + sine * y, cosine * y - sine * x
        shares = [
            max(abs(part) / length, _LEAST_SHARE) for part in (forwards, sideways)
        ]
        speed, acceleration = (
            1.0 / math.hypot(shares[0] / along, shares[1] / across)
            for along, across in (self.speeds, self.accelerations)
        )
        along, across = (max(abs(part) / length, _LEAST_SHARE) for part in way)
        return MotionLimits(
            (speed * along, speed * across),
            (acceleration * along, acceleration * across),
            self.cruise,
            self.smoothing,
        )
