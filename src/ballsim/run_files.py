"""The folder of a run: what is in it, and that nothing is left half-written."""

from __future__ import annotations

import io
import json
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from ballsim.config import Config
from ballsim.config_io import format_config
from ballsim.controls_file import ControlsRecorder
from ballsim.errors import ConfigError, PhysicsError
from ballsim.metrics import run_and_summarise
from ballsim.outcome import RunOutcome
from ballsim.preparation import PreparedRun
from ballsim.readings_file import ReadingsRecorder
from ballsim.recording.encoder_process import EncoderProcess
from ballsim.recording.recorder import Recorder, RunBlock, RunContext
from ballsim.recording.recording_process import RecordingProcess
from ballsim.simulation import Conductor, Progress

__all__ = [
    "CONFIG_FILE",
    "CONTROLS_FILE",
    "LAST_STATES_FILE",
    "READINGS_FILE",
    "RECORDING_FILE",
    "SCENE_FILE",
    "SUMMARY_FILE",
    "VIDEO_FILE",
    "FinishedRun",
    "check_out_dir",
    "choose_out_dir",
    "open_whole",
    "run_with_files",
    "write_file",
]

CONFIG_FILE = "config.toml"
SCENE_FILE = "scene.xml"
CONTROLS_FILE = "controls.npz"
READINGS_FILE = "readings.npz"
SUMMARY_FILE = "summary.json"
RECORDING_FILE = "run.rrd"
LAST_STATES_FILE = "last_states.npz"
VIDEO_FILE = "run.mp4"

_ALL_FILES = (
    CONFIG_FILE,
    SCENE_FILE,
    CONTROLS_FILE,
    READINGS_FILE,
    SUMMARY_FILE,
    RECORDING_FILE,
    LAST_STATES_FILE,
    VIDEO_FILE,
)


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """A run whose files are written.

    Attributes:
        outcome: How the run ended.
        summary: What stands in ``summary.json``.
        folder: Folder of the files.
    """

    outcome: RunOutcome
    summary: dict[str, Any]
    folder: Path


def choose_out_dir(scenario: str, parent: Path = Path("runs")) -> Path:
    """Return the first free folder ``runs/<scenario>-<number>``.

    Args:
        scenario: Name of the scenario.
        parent: Where the folders of runs are.
    """
    number = 1
    while (folder := parent / f"{scenario}-{number:03d}").exists():
        number += 1
    return folder


def check_out_dir(folder: Path) -> None:
    """Check that a folder can be written, without creating anything.

    Raises:
        ConfigError: It cannot.
    """
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        valid = f"a folder, but {existing} is a file"
        raise ConfigError("--out", str(folder), valid, "command line")
    if not os.access(existing, os.W_OK | os.X_OK):
        valid = f"a folder that can be written, but {existing} cannot"
        raise ConfigError("--out", str(folder), valid, "command line")


def write_file(path: Path, content: bytes) -> None:
    """Write a file so that it is there as a whole or not at all.

    Args:
        path: The file; replaced if it exists.
        content: What it shall hold.
    """
    with open_whole(path) as file:
        file.write(content)


@contextmanager
def open_whole(path: Path) -> Iterator[IO[bytes]]:
    """Open a file to be there as a whole, when it is closed, or not at all.

    Args:
        path: The file; replaced if it exists.

    Yields:
        A file to write to.
    """
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            os.fchmod(file.fileno(), 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def run_with_files(
    prepared: PreparedRun,
    folder: Path,
    is_logged: bool = True,
    progress: Progress | None = None,
    command: str = "ballsim.simulation.run",
    recorders: Iterable[Recorder] = (),
    encoder: EncoderProcess | None = None,
    conductor: Conductor | None = None,
) -> FinishedRun:
    """Run what has been prepared and write the files of the run.

    A folder of an earlier run is used again: its files are replaced.

    Args:
        prepared: The run.
        folder: Folder of the files, created if need be.
        is_logged: True to write the rerun recording too.
        progress: Called with ticks done and ticks in all, now and then.
        command: Command line, for the summary.
        recorders: Get the run block by block, too.
        encoder: A process for the recording, if one has been started early. It
            is used up.
        conductor: Who conducts the run, if anybody does. What he asks for stands in
            the configuration in the end, so that the run can be repeated.

    Raises:
        ConfigError: The folder cannot be written; nothing is written then.
        PhysicsError: The physics failed; the folder holds the last states.
        BallsimError: The recording failed.
    """
    _make_folder(folder)
    with ExitStack() as stack:
        controls, readings = ControlsRecorder(folder), ReadingsRecorder(folder)
        configuration = _ConfigRecorder(folder / CONFIG_FILE)
        all_recorders: list[Recorder] = [controls, readings, configuration, *recorders]
        if is_logged:
            recording = RecordingProcess(folder / RECORDING_FILE, encoder)
            stack.callback(recording.close)
            all_recorders.append(recording)
        configuration.write(prepared.config)
        write_file(folder / SCENE_FILE, prepared.scene_xml.encode())
        try:
            outcome, summary = run_and_summarise(
                prepared, command, all_recorders, progress, conductor
            )
        except PhysicsError as error:
            write_file(folder / LAST_STATES_FILE, _pack(error.last_states))
            raise
    configuration.write(outcome.config)
    with open_whole(folder / CONTROLS_FILE) as file:
        controls.write(file)
    with open_whole(folder / READINGS_FILE) as file:
        readings.write(file)
    text = json.dumps(summary, indent=2, allow_nan=False) + "\n"
    write_file(folder / SUMMARY_FILE, text.encode())
    return FinishedRun(outcome, summary, folder)


class _ConfigRecorder:
    """Writes the configuration whenever it has changed.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._config: Config | None = None

    def start(self, context: RunContext) -> None:
        """Do nothing."""

    def record(self, block: RunBlock) -> None:
        """Write what somebody has asked for while the block was made."""
        self.write(block.context.config)

    def close(self) -> None:
        """Do nothing."""

    def write(self, config: Config) -> None:
        """Write a configuration, if it is not that in the file."""
        if config is not self._config:
            self._config = config
            write_file(self._path, format_config(config).encode())


def _make_folder(folder: Path) -> None:
    """Create the folder of a run, or empty that of an earlier one."""
    check_out_dir(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in _ALL_FILES:
            (folder / name).unlink(missing_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        valid = f"a folder that can be written ({error.strerror})"
        raise ConfigError("--out", str(folder), valid, "command line") from error


def _pack(arrays: Mapping[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()
