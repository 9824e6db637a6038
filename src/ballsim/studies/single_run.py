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
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ballsim.config import Config
from ballsim.errors import BallsimError, PhysicsError
from ballsim.metrics import collect_versions, run_and_summarise
from ballsim.preparation import prepare
from ballsim.recording.recorder import Recorder, RunBlock, RunContext

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
    config: Config, recorders: Iterable[Recorder] = ()
) -> dict[str, Any]:
    """Run a configuration and return its summary.

    This is the one place where a study meets the simulator.

    Args:
        config: The configuration.
        recorders: Get the run block by block.

    Returns:
        The summary; failed physics count as a fall.
    """
    try:
        return run_and_summarise(prepare(config), "ballsim study", recorders)[1]
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
            end = _EndKeeper(config)
            recorders = [end] if task.is_fall_recorded else []
            summary = summarise_config(config, recorders)
            if task.is_fall_recorded and not summary["survived"]:
                recording = end.pack()
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


class _EndKeeper:
    """Keeps the last seconds of a run, to be logged if it ends with a fall.

    Args:
        config: Configuration of the run.
    """

    def __init__(self, config: Config) -> None:
        self._n_ticks = config.count_ticks(_RECORDED_TIME)
        self._context: RunContext | None = None
        self._blocks: deque[RunBlock] = deque()

    def start(self, context: RunContext) -> None:
        """Begin."""
        self._context = context

    def record(self, block: RunBlock) -> None:
        """Keep a block, and forget those before that are not needed any more."""
        self._blocks.append(block)
        n_ticks = sum(block.series.n_ticks for block in self._blocks)
        while n_ticks - self._blocks[0].series.n_ticks >= self._n_ticks:
            n_ticks -= self._blocks.popleft().series.n_ticks

    def close(self) -> None:
        """Do nothing: whether it is logged is not known yet."""

    def pack(self) -> bytes | None:
        """Return the recording, None if there was not a single tick."""
        from ballsim.recording.rerun_recorder import RerunRecorder  # noqa: PLC0415

        if self._context is None:
            return None
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "run.rrd"
            recorder = RerunRecorder(file)
            recorder.start(self._context)
            for block in self._blocks:
                recorder.record(block)
            recorder.close()
            return file.read_bytes()
