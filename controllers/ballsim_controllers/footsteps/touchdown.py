"""What landings that come late or early teach about where the ball is under a foot."""

from __future__ import annotations

from ballsim_controllers.geometry import clip

__all__ = ["TouchdownMemory"]


class TouchdownMemory:
    """How far below the ball, as it seems, each foot has to aim to land in time.

    A joint whose zero position is off makes a foot seem nearer to the ball than it is,
    and its drive holds the foot above its path; the same at each step. A landing that
    comes later than planned by t shows a height of v t, with v the speed of descent:

        depth <- depth + v t,   from 0 to a limit

    Args:
        descent_speed: Speed v at which a sole that meets nothing goes on down, [m/s].
        tolerance: Time up to which a landing counts as in time, [s].
        limit: Greatest depth, [m].
    """

    def __init__(self, descent_speed: float, tolerance: float, limit: float) -> None:
        """Know nothing yet."""
        self._descent_speed = descent_speed
        self._tolerance = tolerance
        self._limit = limit
        self._depths = [0.0, 0.0]

    def depth(self, foot: int) -> float:
        """Return how far below the ball's surface a foot has to aim, [m]."""
        return self._depths[foot]

    def learn(self, foot: int, lateness: float) -> None:
        """Take in a landing.

        Args:
            foot: The foot.
            lateness: Time from the planned landing to it, [s].
        """
        if abs(lateness) > self._tolerance:
            depth = self._depths[foot] + self._descent_speed * lateness
            self._depths[foot] = clip(depth, 0.0, self._limit)
