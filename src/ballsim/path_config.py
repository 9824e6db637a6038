"""A path on the floor, as the configuration has it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ballsim.errors import ConfigError
from ballsim.settings import Choice, Number, Points, check_table, setting
from ballsim_controllers.commands import Circle, FigureEight, FloorPath, WayPoints
from ballsim_controllers.errors import InvalidSettingError

if TYPE_CHECKING:
    from ballsim_controllers.floor_path import PathTrace

__all__ = ["PathConfig"]

_CURVES = ("none", "circle", "figure-eight", "way-points")


@dataclass(frozen=True, slots=True)
class PathConfig:
    """Path along which the ball's centre shall roll, in the robot's world.

    Attributes:
        curve: What it is; ``none`` for no path. Closed curves are rolled once.
        radius: Radius of the circle, which starts forwards; positive to the left,
            negative to the right, [m].
        length: Size of the figure eight along the heading, [m].
        width: Its size across the heading; it starts to the left for a positive one,
            to the right for a negative one, [m].
        points: Way-points, [m]. The ball goes to the first one straight.
        speed: Largest speed, [m/s]; 0 for as fast as the controller allows.
        facing: What the robot faces: its heading, as commanded, or the tangent of the
            path, forwards.
    """

    curve: str = setting(Choice(_CURVES), "none", "curve")
    radius: float = setting(Number(-1e3, 1e3, unit="m"), 1.0, "radius_m")
    length: float = setting(
        Number(0.0, 1e3, is_low_open=True, unit="m"), 2.0, "length_m"
    )
    width: float = setting(Number(-1e3, 1e3, unit="m"), 1.0, "width_m")
    points: tuple[tuple[float, float], ...] = setting(
        Points(unit="m"), tuple, "waypoints_m"
    )
    speed: float = setting(Number(0.0, 10.0, unit="m/s"), 0.0, "speed_m_s")
    facing: str = setting(Choice(("heading", "tangent")), "heading", "facing")

    def __post_init__(self) -> None:
        """Check the fields and that a ball can follow the curve."""
        check_table(self)
        if self.points and self.curve not in ("none", "way-points"):
            valid = "way-points, beside waypoints_m"
            raise ConfigError("curve", self.curve, valid)
        self.trace()

    @property
    def is_faced(self) -> bool:
        """Return whether the robot faces along the path."""
        return self.curve != "none" and self.facing == "tangent"

    def make_path(self) -> FloorPath | None:
        """Return the path as the robot is told it, None for none."""
        if self.curve == "circle":
            return Circle(self.radius)
        if self.curve == "figure-eight":
            return FigureEight(self.length, self.width)
        if self.curve == "way-points":
            return WayPoints(self.points)
        return None

    def trace(self) -> PathTrace | None:
        """Return the path by its arc length, None without one.

        Raises:
            ConfigError: It cannot be followed.
        """
        path = self.make_path()
        if path is None:
            return None
        # What has no path need not wait until SciPy is loaded.
        from ballsim_controllers.floor_path import trace_path  # noqa: PLC0415

        try:
            return trace_path(path)
        except InvalidSettingError as error:
            raise ConfigError(error.key, error.value, error.valid) from None

    def find_length(self) -> float:
        """Return the length of the path, 0 without one, [m]."""
        trace = self.trace()
        return 0.0 if trace is None else trace.length
