"""``readings.npz``: all that a controller was built from, got and answered.

The archive holds, beside one array for each field of `SensorReading` and, with the
prefix ``command_``, of `Command`, with a row for each tick:

* ``joint_targets``: what the controller returned, shape (n, n_joints), [rad];
* ``setup``: JSON text: controller, control period, ball, robot, settings,
  data sheets of the sensors;
* ``mjcf``: the robot's MJCF as text.
"""

from __future__ import annotations

import dataclasses
import json
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ballsim_controllers.commands import (
    Circle,
    Command,
    FigureEight,
    FloorPath,
    WayPoints,
)
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import (
    Array,
    BallParameters,
    ControllerSetup,
    IntArray,
    Record,
    SensorReading,
    reading_dtype,
)
from ballsim_controllers.robot import LegDescription, RobotDescription
from ballsim_controllers.sensor_figures import SensorFigures

__all__ = [
    "COMMANDS",
    "COMMAND_OF_TICK",
    "JOINT_TARGETS",
    "MJCF",
    "SETUP",
    "RecordedReadings",
    "describe_commands",
    "describe_setup",
    "load_readings",
]

COMMANDS = "commands"
COMMAND_OF_TICK = "command_of_tick"
JOINT_TARGETS = "joint_targets"
SETUP = "setup"
MJCF = "mjcf"


@dataclass(frozen=True, slots=True)
class RecordedReadings:
    """A run as the robot's computer saw it.

    Attributes:
        controller: Registered name of the controller.
        setup: What it was built from; the path of the MJCF is that of the recording.
        mjcf: The robot's MJCF as text.
        readings: Shape (n,), dtype of `reading_dtype`.
        commands: Each command that was given, once.
        command_of_tick: Place of each tick's command among them, shape (n,).
        joint_targets: What the controller returned, shape (n, n_joints), [rad].
    """

    controller: str
    setup: ControllerSetup
    mjcf: str
    readings: Record
    commands: Sequence[Command]
    command_of_tick: IntArray
    joint_targets: Array

    def __len__(self) -> int:
        """Return the number of ticks."""
        return len(self.readings)

    def ticks(self) -> Iterator[tuple[SensorReading, Command]]:
        """Yield what the controller got, tick after tick."""
        for i, place in enumerate(self.command_of_tick.tolist()):
            reading = SensorReading(self.readings[i : i + 1].copy())
            yield reading, self.commands[place]


def describe_setup(controller: str, setup: ControllerSetup) -> str:
    """Return what a controller is built from as JSON, without the MJCF.

    Args:
        controller: Registered name.
        setup: Its setup.
    """
    robot = dataclasses.asdict(setup.robot)
    robot["mjcf_path"] = setup.robot.mjcf_path.name
    table = {
        "controller": controller,
        "control_period": setup.control_period,
        "ball": dataclasses.asdict(setup.ball),
        "robot": robot,
        "settings": dict(setup.settings),
        "sensors": dataclasses.asdict(setup.sensors),
    }
    return json.dumps(table)


def describe_commands(commands: Sequence[Command]) -> str:
    """Return commands as JSON.

    Args:
        commands: The commands.
    """
    tables = []
    for command in commands:
        table = dataclasses.asdict(command)
        if command.path is not None:
            table["path"] = {type(command.path).__name__: table["path"]}
        tables.append(table)
    return json.dumps(tables)


def load_readings(path: Path) -> RecordedReadings:
    """Read a recording.

    Args:
        path: The archive.

    Raises:
        InvalidSettingError: It is no such archive, or lacks something.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (OSError, EOFError, TypeError, ValueError, zipfile.BadZipFile) as error:
        valid = f"an archive of readings that can be read ({error})"
        raise InvalidSettingError("FILE", str(path), valid) from None
    try:
        table = json.loads(str(arrays[SETUP]))
        setup = _read_setup(table)
        n_ticks, n_joints = arrays[JOINT_TARGETS].shape
        dtype = reading_dtype(n_joints)
        readings: Record = np.empty(n_ticks, dtype)
        for name in dtype.names or ():
            readings[name] = arrays[name]
        commands = [_read_command(item) for item in json.loads(str(arrays[COMMANDS]))]
        places: IntArray = arrays[COMMAND_OF_TICK]
        if places.shape != (n_ticks,) or not 0 <= places.min() <= places.max() < len(
            commands
        ):
            raise ValueError(f"{COMMAND_OF_TICK} names commands that are not there")
        return RecordedReadings(
            controller=str(table["controller"]),
            setup=setup,
            mjcf=str(arrays[MJCF]),
            readings=readings,
            commands=commands,
            command_of_tick=places,
            joint_targets=arrays[JOINT_TARGETS],
        )
    except (KeyError, TypeError, ValueError) as error:
        valid = f"an archive of readings of this version ({error})"
        raise InvalidSettingError("FILE", str(path), valid) from None


def _read_setup(table: Mapping[str, Any]) -> ControllerSetup:
    robot = dict(table["robot"])
    for leg in ("left_leg", "right_leg"):
        values = dict(robot[leg])
        robot[leg] = LegDescription(**values | {"joints": tuple(values["joints"])})
    robot["mjcf_path"] = Path(robot["mjcf_path"])
    return ControllerSetup(
        robot=RobotDescription(**robot),
        ball=BallParameters(**table["ball"]),
        control_period=float(table["control_period"]),
        settings=table["settings"],
        sensors=SensorFigures(**table["sensors"]),
    )


def _read_command(table: Mapping[str, Any]) -> Command:
    path: FloorPath | None = None
    if table["path"] is not None:
        ((kind, values),) = table["path"].items()
        if kind == WayPoints.__name__:
            path = WayPoints(tuple((x, y) for x, y in values["points"]))
        else:
            path = {c.__name__: c for c in (Circle, FigureEight)}[kind](**values)
    return Command(**{**table, "path": path})
