"""Configuration of a run: frozen tables, each checked when it is made.

The TOML keys carry units; the Python fields are SI and carry none.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ballsim.errors import ConfigError
from ballsim.faults import FaultConfig
from ballsim.path_config import PathConfig
from ballsim.plant_config import (
    BallConfig,
    DrivesConfig,
    PushConfig,
    RobotConfig,
    SceneTable,
)
from ballsim.sensor_config import SensorsConfig
from ballsim.settings import (
    Flag,
    FreeTable,
    Integer,
    ListOf,
    Number,
    TableOf,
    Text,
    check_table,
    setting,
)

__all__ = [
    "BallConfig",
    "CommandConfig",
    "CommandPoint",
    "Config",
    "ControllerConfig",
    "DrivesConfig",
    "InitialConfig",
    "PathConfig",
    "PushConfig",
    "RobotConfig",
    "SceneTable",
    "SensorsConfig",
    "SimulationConfig",
    "suggest_duration",
]

_SETTLING_TIME = 12.0  # start, first second without command, coming to rest, [s]
_TIME_TOLERANCE = 1e-9  # [s]
_TICK_TOLERANCE = 1e-9
_SLOWEST_SPEED = 0.2  # ball speed that a roll surely reaches, [rad/s]
_SLOWEST_WAY = 0.035  # the same on the floor in any direction, [m/s]
_SLOWEST_TURN = 0.3  # of the heading, [rad/s]
_SLOWEST_PATH = (0.14, 0.0875)  # the same on a path, [rad/s] and [m/s]


@dataclass(frozen=True, slots=True)
class ControllerConfig:
    """The controller.

    Attributes:
        name: Registered name.
        settings: The other keys of the table: values that replace those of the
            controller's preset.
    """

    name: str = setting(Text(), "wheeled-lip", "name")
    settings: Mapping[str, Any] = setting(FreeTable(), dict, "settings")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class _ControllerReader:
    """Reads ``[controller]``: a name, and keys that are the controller's own."""

    def read(self, value: object, key: str) -> ControllerConfig:
        if isinstance(value, ControllerConfig):
            return value
        table = FreeTable().read(value, key)
        name = Text().read(table.pop("name", "wheeled-lip"), f"{key}.name")
        return ControllerConfig(name, table)

    def write(self, value: ControllerConfig) -> dict[str, Any]:
        return {"name": value.name, **value.settings}


@dataclass(frozen=True, slots=True)
class SimulationConfig:
    """The loop and what counts as a fall.

    Attributes:
        control_period: Time between two readings, [s].
        fall_tilt: Trunk tilt from the vertical that counts as a fall, [rad].
        fall_height_ratio: CoM height over the ball's top, as a part of the
            height at the start, below which the robot has fallen.
    """

    control_period: float = setting(
        Number(1e-4, 0.1, unit="s"), 0.005, "control_period_s"
    )
    fall_tilt: float = setting(Number(0.05, 3.2, unit="rad"), 1.0, "fall_tilt_rad")
    fall_height_ratio: float = setting(Number(0.0, 0.99), 0.6, "fall_height_ratio")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class InitialConfig:
    """The start; the seed draws direction and size, uniformly.

    Attributes:
        max_lean: Greatest lean of the robot about the contact, [rad].
        max_ball_offset: Greatest horizontal offset of the ball, [m].
        max_yaw: Greatest heading in the true world, [rad].
    """

    max_lean: float = setting(Number(0.0, 0.5, unit="rad"), 0.02, "max_lean_rad")
    max_ball_offset: float = setting(
        Number(0.0, 0.1, unit="m"), 0.010, "max_ball_offset_m"
    )
    max_yaw: float = setting(Number(0.0, 3.2, unit="rad"), 0.1, "max_yaw_rad")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class CommandPoint:
    """The whole command from an instant on.

    Attributes:
        time: When it is given, [s].
        target_ball_angle: Roll angle of the ball along the initial heading, [rad].
        is_stepping: True to step even where balance does not need it.
        ball_speed: Speed at which the ball shall roll on, [rad/s]; it replaces the
            target unless it is 0.
        distance: How far from its start on the floor the ball shall come to rest;
            it replaces the target angle unless it is 0, [m].
        direction: Where that is: 0 forwards, pi/2 to the left, [rad].
        heading: Direction that the robot shall face, from that at its start to the
            left, [rad].
        path: Path on the floor that the ball shall roll along; it replaces all of
            that if it has a curve.
    """

    time: float = setting(Number(0.0, 1e6, unit="s"), 0.0, "time_s")
    target_ball_angle: float = setting(
        Number(-1e3, 1e3, unit="rad"), 0.0, "target_angle_rad"
    )
    is_stepping: bool = setting(Flag(), False, "stepping")
    ball_speed: float = setting(
        Number(-10.0, 10.0, unit="rad/s"), 0.0, "ball_speed_rad_s"
    )
    distance: float = setting(Number(0.0, 1e3, unit="m"), 0.0, "distance_m")
    direction: float = setting(Number(-10.0, 10.0, unit="rad"), 0.0, "direction_rad")
    heading: float = setting(Number(-100.0, 100.0, unit="rad"), 0.0, "heading_rad")
    path: PathConfig = setting(TableOf(PathConfig), PathConfig, "path")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)
        if self.ball_speed != 0.0 and self.target_ball_angle != 0.0:
            valid = "0, or left out, beside a ball_speed_rad_s: one of them counts"
            raise ConfigError("target_angle_rad", self.target_ball_angle, valid)
        if self.distance != 0.0 and (self.ball_speed or self.target_ball_angle):
            valid = "0, or left out, beside a target_angle_rad or a ball_speed_rad_s"
            raise ConfigError("distance_m", self.distance, valid)
        has_other = self.distance or self.ball_speed or self.target_ball_angle
        if self.path.curve != "none" and has_other:
            valid = "none, beside a target_angle_rad, ball_speed_rad_s or distance_m"
            raise ConfigError("path.curve", self.path.curve, valid)

    def find_heading(self) -> float:
        """Return the direction that the robot shall face in the end, [rad]."""
        trace = self.path.trace()
        if trace is None or not self.path.is_faced:
            return self.heading
        x, y = trace.directions[-1].tolist()
        return math.atan2(y, x)

    def find_place(self, ball_radius: float) -> tuple[float, float]:
        """Return where the ball shall come to rest on the floor, [m].

        Args:
            ball_radius: Radius of the ball, [m].

        Returns:
            Along and across the robot's initial heading, from the ball's start.
        """
        trace = self.path.trace()
        if trace is not None:
            x, y = trace.points[-1].tolist()
            return x, y
        if self.distance == 0.0:
            return self.target_ball_angle * ball_radius, 0.0
        # Right angles are exact, so that straight ahead has no lateral part.
        x, y = math.cos(self.direction), math.sin(self.direction)
        x, y = (round(part, 15) + 0.0 for part in (x, y))
        return self.distance * x, self.distance * y


@dataclass(frozen=True, slots=True)
class CommandConfig:
    """What the operator asks for; before the first point: stand still.

    Attributes:
        timeline: Commands in the order of their times.
    """

    timeline: tuple[CommandPoint, ...] = setting(
        ListOf(CommandPoint), tuple, "timeline"
    )

    def __post_init__(self) -> None:
        """Check the fields and the order of the times."""
        check_table(self)
        for i in range(1, len(self.timeline)):
            time, before = self.timeline[i].time, self.timeline[i - 1].time
            if time <= before:
                valid = f"later than the point before it ({before:g} s)"
                raise ConfigError(f"timeline.{i}.time_s", time, valid)


@dataclass(frozen=True, slots=True)
class Config:
    """Everything that a run depends on.

    Attributes:
        scenario: Name of the scenario.
        description: One line about it.
        seed: Seed of everything random.
        duration: Simulated time, [s].
        parameters: Short names for dotted keys, for ``--set``.
        ball: The ball.
        scene: Contact and integration.
        robot: The robot.
        drives: The joint drives.
        controller: The controller and its settings.
        sensors: Noise and delay of the sensors.
        simulation: The loop and the fall detection.
        initial: Spread of the start.
        command: What the operator asks for, and when.
        pushes: Forces from outside, ``[[push]]`` in TOML.
        faults: Sensors that fail, ``[[fault]]`` in TOML.
    """

    scenario: str = setting(Text(), "unnamed", "scenario")
    description: str = setting(Text(), "no description", "description")
    seed: int = setting(Integer(), 0, "seed")
    duration: float = setting(
        Number(0.0, 3600.0, is_low_open=True, unit="s"), 60.0, "duration_s"
    )
    parameters: Mapping[str, str] = setting(
        FreeTable(is_text_only=True), dict, "parameters"
    )
    ball: BallConfig = setting(TableOf(BallConfig), BallConfig, "ball")
    scene: SceneTable = setting(TableOf(SceneTable), SceneTable, "scene")
    robot: RobotConfig = setting(TableOf(RobotConfig), RobotConfig, "robot")
    drives: DrivesConfig = setting(TableOf(DrivesConfig), DrivesConfig, "drives")
    controller: ControllerConfig = setting(
        _ControllerReader(), ControllerConfig, "controller"
    )
    sensors: SensorsConfig = setting(TableOf(SensorsConfig), SensorsConfig, "sensors")
    simulation: SimulationConfig = setting(
        TableOf(SimulationConfig), SimulationConfig, "simulation"
    )
    initial: InitialConfig = setting(TableOf(InitialConfig), InitialConfig, "initial")
    command: CommandConfig = setting(TableOf(CommandConfig), CommandConfig, "command")
    pushes: tuple[PushConfig, ...] = setting(ListOf(PushConfig), tuple, "push")
    faults: tuple[FaultConfig, ...] = setting(ListOf(FaultConfig), tuple, "fault")

    def __post_init__(self) -> None:
        """Check the fields and that the rates fit together."""
        check_table(self)
        period, timestep = self.simulation.control_period, self.scene.timestep
        of_timestep = (timestep, "scene.timestep_s")
        of_period = (period, "simulation.control_period_s")
        _check_multiple("simulation.control_period_s", period, *of_timestep, least=1)
        _check_multiple("sensors.delay_s", self.sensors.delay, *of_period)
        _check_multiple("drives.delay_s", self.drives.delay, *of_timestep)
        for i, push in enumerate(self.pushes):
            _check_multiple(f"push.{i}.time_s", push.time, *of_period)
            _check_multiple(f"push.{i}.time_spread_s", push.time_spread, *of_period)
            _check_multiple(f"push.{i}.duration_s", push.duration, *of_period)
        if self.duration < period:
            valid = f"at least one control period of {period:g} s"
            raise ConfigError("duration_s", self.duration, valid)

    @property
    def n_substeps(self) -> int:
        """Return the physics steps in one control period."""
        return round(self.simulation.control_period / self.scene.timestep)

    @property
    def n_late_steps(self) -> int:
        """Return the physics steps after which a set-point acts."""
        return round(self.drives.delay / self.scene.timestep)

    @property
    def n_ticks(self) -> int:
        """Return the control periods in the duration."""
        return self.count_ticks(self.duration)

    def count_ticks(self, time: float) -> int:
        """Return the control periods in a time in [s], at least one."""
        return max(1, round(time / self.simulation.control_period))

    def find_tick(self, time: float) -> int:
        """Return the first tick that is not before a time in [s]."""
        return math.ceil(time / self.simulation.control_period - _TICK_TOLERANCE)


def _check_multiple(
    key: str, value: float, step: float, name: str, least: int = 0
) -> None:
    """Refuse a time in [s] that is no whole multiple of a step."""
    count = round(value / step)
    if count < least or abs(count * step - value) > _TIME_TOLERANCE:
        raise ConfigError(key, value, f"a whole multiple of {name} = {step:g}")


def suggest_duration(command: CommandConfig, ball_radius: float) -> float:
    """Return a duration that lets the robot do all of a command, [s].

    Args:
        command: The command.
        ball_radius: Radius of the ball, [m].

    Returns:
        12 s, plus 5 s for each radian that the target moves, or 29 s for each metre
        of a distance, or the time of a path or a turn at a speed that is surely
        reached, plus the time of the last point beyond the first second.
    """
    target, travel, way, last_time, heading = 0.0, 0.0, 0.0, 1.0, 0.0
    slowest, rolling = min(_SLOWEST_PATH[0] * ball_radius, _SLOWEST_PATH[1]), 0.0
    for point in command.timeline:
        travel += abs(point.target_ball_angle - target)
        target, last_time = point.target_ball_angle, max(last_time, point.time)
        way += point.distance
        turn, heading = abs(point.heading - heading), point.heading
        rolling += (math.pi if point.path.is_faced else turn) / _SLOWEST_TURN
        rolling += point.path.find_length() / min(slowest, point.path.speed or slowest)
    rolling += travel / _SLOWEST_SPEED + way / _SLOWEST_WAY
    return _SETTLING_TIME + rolling + last_time - 1.0
