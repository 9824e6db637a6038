"""Feeds recorded readings to the controller and compares what it answers.

``python -m ballsim_controllers.playback DIR/readings.npz`` needs the robot's package
and nothing of the simulator: it is what runs on the robot, fed from a file. Exit code
0 = the joint targets are the recorded ones bit for bit, 4 = they differ, 2 = bad
input, 1 = internal error.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from importlib.metadata import entry_points
from pathlib import Path
from typing import NoReturn, cast

import numpy as np

from ballsim_controllers.errors import (
    ControllerError,
    InvalidSettingError,
    UnknownControllerError,
)
from ballsim_controllers.messages import Array, Controller, ControllerSetup
from ballsim_controllers.recorded_readings import RecordedReadings, load_readings

__all__ = ["build_controller", "find_difference", "main", "play"]

EXIT_DONE, EXIT_INTERNAL_ERROR, EXIT_BAD_INPUT, EXIT_DIFFERS = 0, 1, 2, 4
_GROUP = "ballsim.controllers"


def build_controller(recorded: RecordedReadings, mjcf: Path) -> Controller:
    """Build the controller that a recording is of.

    Args:
        recorded: The recording.
        mjcf: File of the robot's MJCF.

    Raises:
        UnknownControllerError: It is not registered here.
        InvalidSettingError: A setting does not fit.
    """
    entries = {entry.name: entry for entry in entry_points(group=_GROUP)}
    if recorded.controller not in entries:
        raise UnknownControllerError(recorded.controller, entries)
    factory = cast(
        "Callable[[ControllerSetup], Controller]", entries[recorded.controller].load()
    )
    robot = dataclasses.replace(recorded.setup.robot, mjcf_path=mjcf)
    return factory(dataclasses.replace(recorded.setup, robot=robot))


def play(recorded: RecordedReadings, mjcf: Path | None = None) -> Array:
    """Feed a recording to its controller.

    Args:
        recorded: The recording.
        mjcf: File of the robot's MJCF, if it is not to be the recorded one, as
            where that one refers to other files.

    Returns:
        The joint targets, shape (n, n_joints), [rad].
    """
    with tempfile.TemporaryDirectory() as folder:
        if mjcf is None:
            mjcf = Path(folder) / recorded.setup.robot.mjcf_path.name
            mjcf.write_text(recorded.mjcf, encoding="utf-8")
        controller = build_controller(recorded, mjcf)
        answers = np.empty_like(recorded.joint_targets)
        for i, (reading, command) in enumerate(recorded.ticks()):
            answers[i] = controller.step(reading, command).positions
    return answers


def find_difference(recorded: RecordedReadings, answers: Array) -> str | None:
    """Return where answers first differ from the recorded ones, or None.

    Args:
        recorded: The recording.
        answers: Joint targets, shape (n, n_joints), [rad].
    """
    differs = recorded.joint_targets.view(np.int64) != answers.view(np.int64)
    if not differs.any():
        return None
    tick = int(differs.any(axis=1).argmax())
    joint = int(differs[tick].argmax())
    was, now = recorded.joint_targets[tick, joint], answers[tick, joint]
    time = float(recorded.readings["time"][tick])
    return (
        f"joint_targets differ in {int(differs.any(axis=1).sum())} of {len(recorded)} "
        f"ticks, first at {time:g} s: joint {joint} is {now!r}, was {was!r}"
    )


class _Parser(argparse.ArgumentParser):
    """A parser whose complaints take one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_BAD_INPUT, f"{self.prog}: {message}\n")


def main(words: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code.

    Args:
        words: Command line without the program; that of the process if None.
    """
    name = "ballsim_controllers.playback"
    parser = _Parser(prog=name, description="Recorded readings to joint targets.")
    parser.add_argument("file", metavar="FILE", type=Path, help="readings.npz of a run")
    parser.add_argument("--out", metavar="FILE", type=Path, help="write the answers")
    parser.add_argument("--mjcf", metavar="FILE", type=Path, help="the robot's MJCF")
    options = parser.parse_args(words)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        recorded = load_readings(options.file)
        if options.mjcf is not None and not options.mjcf.is_file():
            raise InvalidSettingError("--mjcf", str(options.mjcf), "an existing file")
        answers = play(recorded, options.mjcf)
        if options.out is not None:
            np.savez(options.out, joint_targets=answers)
    except (ControllerError, OSError) as error:
        print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_BAD_INPUT
    difference = find_difference(recorded, answers)
    if difference is not None:
        print(f"{name}: {difference}", file=sys.stderr)
        return EXIT_DIFFERS
    print(f"identical: {len(recorded)} ticks, {answers.shape[1]} joint targets each")
    return EXIT_DONE


if __name__ == "__main__":
    sys.exit(main())
