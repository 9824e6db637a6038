"""``readings.npz``: a run as the robot's computer saw it, for playing it back."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from ballsim.preparation import make_controller_setup
from ballsim.recording.recorder import RunBlock, RunContext
from ballsim.spool import Spool, write_array
from ballsim_controllers.messages import Command
from ballsim_controllers.recorded_readings import (
    COMMAND_OF_TICK,
    COMMANDS,
    JOINT_TARGETS,
    MJCF,
    SETUP,
    describe_commands,
    describe_setup,
)

__all__ = ["ReadingsRecorder"]

# Readings are noise for the most part: more effort makes them hardly smaller.
_COMPRESSION_LEVEL = 1


class ReadingsRecorder:
    """Spools readings and joint targets into the folder of a run.

    Commands are kept when they change, which is seldom.

    Args:
        folder: Folder of the run; it exists when the run starts.
    """

    def __init__(self, folder: Path) -> None:
        """Remember the folder."""
        self._folder = folder
        self._context: RunContext | None = None
        self._readings: Spool | None = None
        self._targets: Spool | None = None
        self._commands: list[Command] = []
        self._counts: list[int] = []

    def start(self, context: RunContext) -> None:
        """Remember what does not change."""
        self._context = context

    def record(self, block: RunBlock) -> None:
        """Spool the readings, commands and targets of a block."""
        series = block.series
        rows, targets = series.readings.rows, series.ctrl
        if self._readings is None or self._targets is None:
            self._readings = Spool(self._folder, (), rows.dtype)
            self._targets = Spool(self._folder, targets.shape[1:])
        self._readings.append(rows)
        self._targets.append(targets)
        for command in series.commands:
            if not self._commands or command is not self._commands[-1]:
                self._commands.append(command)
                self._counts.append(0)
            self._counts[-1] += 1

    def close(self) -> None:
        """Do nothing yet: the run's end is not the end of the spool."""

    def write(self, file: IO[bytes]) -> None:
        """Write the archive and drop the spools.

        Args:
            file: Open for writing.
        """
        assert self._context is not None
        assert self._readings is not None
        assert self._targets is not None
        config, robot = self._context.config, self._context.robot
        setup = make_controller_setup(config, robot)
        readings, targets = self._readings, self._targets
        with zipfile.ZipFile(
            file, "w", zipfile.ZIP_DEFLATED, compresslevel=_COMPRESSION_LEVEL
        ) as archive:
            _write_text(archive, SETUP, describe_setup(config.controller.name, setup))
            _write_text(archive, MJCF, robot.mjcf_path.read_text(encoding="utf-8"))
            for name in readings.dtype.names or ():
                shape = (readings.n_rows, *readings.dtype[name].shape)
                write_array(archive, name, shape, _column(readings, name))
            _write_text(archive, COMMANDS, describe_commands(self._commands))
            places = np.repeat(np.arange(len(self._commands)), self._counts)
            write_array(
                archive, COMMAND_OF_TICK, places.shape, iter([places]), places.dtype
            )
            shape = (targets.n_rows, *targets.shape)
            write_array(archive, JOINT_TARGETS, shape, targets.read())
        readings.close()
        targets.close()


def _column(spool: Spool, name: str) -> Iterator[npt.NDArray[Any]]:
    return (rows[name] for rows in spool.read())


def _write_text(archive: zipfile.ZipFile, name: str, text: str) -> None:
    value = np.array(text)
    write_array(archive, name, (), iter([value]), value.dtype)
