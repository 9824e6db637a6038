"""What a worker does: runs one configuration after the other, with a time limit.

Workers import the simulator only; rerun is imported where a recording is kept.
"""

from __future__ import annotations

import faulthandler
import math
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ballsim.config import Config
from ballsim.errors import BallsimError, PhysicsError
from ballsim.metrics import collect_versions, summarise
from ballsim.preparation import prepare
from ballsim.recording.recorder import Recorder, RunContext
from ballsim.series import RunSeries
from ballsim.simulation import run_prepared

__all__ = [
    "ERROR",
    "FINISHED",
    "UNSTABLE",
    "Outcome",
    "Task",
    "run_chunk",
    "summarise_config",
]

FINISHED = "finished"  # the robot stayed up or fell
ERROR = "error"  # the run raised an exception

UNSTABLE = ("wall_time", "realtime_factor", "command", "versions")
"""What a repeat of a run does not give again."""

_RECORDED_TIME = 5.0  # of a fallen run, [s]


@dataclass(frozen=True, slots=True)
class Task:
    """One run.

    Attributes:
        cell: Index of its cell.
        config: The configuration, with its seed.
        is_fall_recorded: True to keep the end of the run if the robot falls.
    """

    cell: int
    config: Config
    is_fall_recorded: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a run.

    Attributes:
        cell: Index of its cell.
        seed: Its seed.
        status: FINISHED, ERROR, or what the execution makes of a lost worker.
        summary: Numbers of the summary that a repeat gives again.
        message: What went wrong, or None.
        wall_time: Time that it took, [s].
        realtime_factor: Simulated time by time of the loop, or None.
        provenance: Versions and revision of the code, on the worker.
        recording: Content of the recording, or None.
        attempts: How often the run was started.
    """

    cell: int
    seed: int
    status: str
    summary: dict[str, Any]
    message: str | None = None
    wall_time: float = 0.0
    realtime_factor: float | None = None
    provenance: dict[str, str] | None = None
    recording: bytes | None = None
    attempts: int = 1


def summarise_config(
    config: Config, recorder: Recorder | None = None
) -> dict[str, Any]:
    """Run a configuration and return its summary.

    This is the one place where a study meets the simulator.

    Args:
        config: The configuration.
        recorder: Gets the time series while they grow.

    Returns:
        The summary; failed physics count as a fall.
    """
    try:
        return summarise(run_prepared(prepare(config), recorder), "ballsim study")
    except PhysicsError as error:
        return {
            "survived": False,
            "fall_time": round(error.time, 9),
            "fall_reason": error.reason,
            "simulated_time": round(error.time, 9),
        }


def run_chunk(tasks: Sequence[Task], limit: float) -> list[Outcome]:
    """Run some tasks, one after the other.

    Args:
        tasks: The runs.
        limit: Wall-clock time that each may take, [s]; the process dies of more.

    Returns:
        Outcomes in the order of the tasks.
    """
    return [_run(task, limit) for task in tasks]


def _run(task: Task, limit: float) -> Outcome:
    config, start = task.config, time.perf_counter()
    summary: dict[str, Any] = {}
    recording = message = None
    try:
        with _time_limit(limit):
            summary = summarise_config(config)
            if task.is_fall_recorded and not summary["survived"]:
                recording = _record_end(config, summary["fall_time"])
        status = FINISHED
    except Exception as error:
        status = ERROR
        text = str(error) if isinstance(error, BallsimError) else repr(error)
        message = " ".join(text.split())
    return Outcome(
        cell=task.cell,
        seed=config.seed,
        status=status,
        summary={k: v for k, v in summary.items() if k not in UNSTABLE},
        message=message,
        wall_time=time.perf_counter() - start,
        realtime_factor=summary.get("realtime_factor"),
        provenance=describe_code(),
        recording=recording,
    )


@contextmanager
def _time_limit(limit: float) -> Iterator[None]:
    """End the process if the block takes too long, even if it hangs in C code."""
    if math.isinf(limit):
        yield
        return
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        faulthandler.dump_traceback_later(limit, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


@cache
def describe_code() -> dict[str, str]:
    """Return the versions of all packages, and the git revision if there is one."""
    versions = collect_versions()
    here = Path(__file__).resolve()

    def git(*words: str) -> str:
        command = ["git", *words]
        return subprocess.run(
            command, cwd=here.parent, capture_output=True, text=True, check=True
        ).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", here.name)  # not of a repository around us
        revision = git("describe", "--always", "--abbrev=12", "--dirty")
    except (OSError, subprocess.SubprocessError):
        return versions
    return {**versions, "revision": revision}


class _EndRecorder:
    """Passes on what follows a tick.

    Args:
        recorder: Gets it.
        first: The tick.
    """

    def __init__(self, recorder: Recorder, first: int) -> None:
        self._recorder, self._first = recorder, first

    def start(self, context: RunContext) -> None:
        """Begin."""
        self._recorder.start(context)

    def record(self, series: RunSeries, start: int, stop: int) -> None:
        """Pass the later rows on."""
        if stop > self._first:
            self._recorder.record(series, max(start, self._first), stop)

    def close(self) -> None:
        """End."""
        self._recorder.close()


def _record_end(config: Config, fall_time: float) -> bytes:
    """Repeat a run and return the recording of its last seconds."""
    from ballsim.recording.rerun_recorder import RerunRecorder  # noqa: PLC0415

    n_before = max(0.0, fall_time - _RECORDED_TIME) / config.simulation.control_period
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.rrd"
        summarise_config(config, _EndRecorder(RerunRecorder(file), round(n_before)))
        return file.read_bytes()
