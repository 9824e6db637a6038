"""What the operator asks for at each tick: the timeline of the configuration."""

from __future__ import annotations

from ballsim.config import CommandPoint, Config
from ballsim_controllers.messages import Command

__all__ = ["CommandSchedule"]


class CommandSchedule:
    """The command at each tick.

    Args:
        config: The run.
    """

    def __init__(self, config: Config) -> None:
        """Take the points of the timeline."""
        self._ball_radius = config.ball.radius
        self._points = [
            (config.find_tick(point.time), self._make_command(point))
            for point in config.command.timeline
        ]
        self._present = Command()

    def at(self, tick: int) -> Command:
        """Return the command at a tick; ticks must not decrease."""
        while self._points and self._points[0][0] <= tick:
            self._present = self._points.pop(0)[1]
        return self._present

    def take_over(self, tick: int, point: CommandPoint) -> None:
        """Let a point count from a tick on, and none of those after it.

        Args:
            tick: The present tick, or a later one.
            point: What is asked for from then on.
        """
        kept = [entry for entry in self._points if entry[0] < tick]
        self._points = [*kept, (tick, self._make_command(point))]

    def _make_command(self, point: CommandPoint) -> Command:
        path = point.path.make_path()
        if path is not None:
            return Command(
                is_stepping=point.is_stepping,
                path=path,
                path_speed=point.path.speed,
                heading=point.heading,
                is_facing_path=point.path.is_faced,
            )
        radius, stepping = self._ball_radius, point.is_stepping
        x, y = point.find_place(radius)
        angle = point.target_ball_angle if point.distance == 0.0 else x / radius
        return Command(angle, stepping, point.ball_speed, y, heading=point.heading)
