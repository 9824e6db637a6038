"""What the operator asks of the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

__all__ = ["Circle", "Command", "FigureEight", "FloorPath", "WayPoints"]


@dataclass(frozen=True, slots=True)
class Circle:
    """Once around a circle, from the start of the robot's world and forwards.

    Attributes:
        radius: Radius, [m]; the circle lies to the left for a positive one and to
            the right for a negative one.
    """

    radius: float


@dataclass(frozen=True, slots=True)
class FigureEight:
    """Once through a figure eight, from its crossing at the start of the world.

    Attributes:
        length: Size along x, [m].
        width: Size along y, [m]; it begins forwards and to the left for a positive
            one and forwards and to the right for a negative one.
    """

    length: float
    width: float


@dataclass(frozen=True, slots=True)
class WayPoints:
    """A smooth curve through places on the floor.

    Attributes:
        points: Places in the robot's world, x and y of each, at least two, [m]. If
            the last one is the first one again, the curve is smooth there, too.
    """

    points: tuple[tuple[float, float], ...]


FloorPath: TypeAlias = Circle | FigureEight | WayPoints


@dataclass(frozen=True, slots=True)
class Command:
    """What the operator asks of the robot at this instant.

    Attributes:
        target_ball_angle: Roll angle theta_1 that the ball shall reach along
            the robot's initial heading, [rad]. The controller shapes the way
            there (speed and acceleration limits).
        is_stepping: True to step even where balance alone would not need it.
        ball_speed: Speed at which the ball shall roll on along the robot's initial
            heading, [rad/s]; it replaces the target angle unless it is 0.
        lateral_target: Where the ball shall come to rest across the robot's initial
            heading, to the left of its start, [m].
        path: Curve on the floor along which the ball's centre shall roll, from its
            first to its last point, to rest there; it replaces all targets. The
            ball goes to the first point straight, if it is elsewhere.
        path_speed: Largest speed on the path, [m/s]; 0 for as fast as the
            controller's own limits allow.
        heading: Direction that the robot shall face, from that at its start to the
            left, [rad]. It turns the shorter way, stepping.
        is_facing_path: True to face forwards along the path, instead of the heading.
    """

    target_ball_angle: float = 0.0
    is_stepping: bool = False
    ball_speed: float = 0.0
    lateral_target: float = 0.0
    path: FloorPath | None = None
    path_speed: float = 0.0
    heading: float = 0.0
    is_facing_path: bool = False
