"""What the recording costs: the loop with and without it, and its own process."""

from __future__ import annotations

import dataclasses
import gc
import statistics
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from ballsim.bench.machine import read_load
from ballsim.config import Config
from ballsim.controls_file import ControlsRecorder
from ballsim.metrics import SummaryRecorder
from ballsim.preparation import prepare
from ballsim.readings_file import ReadingsRecorder
from ballsim.recording.recorder import Recorder, RunBlock, RunContext
from ballsim.recording.recording_process import RecordingProcess
from ballsim.run_files import RECORDING_FILE
from ballsim.simulation import simulate

__all__ = ["LoggedLoop", "compare_pairs", "measure_log"]

_MEGABYTE = 1e6
_MINUTE = 60.0  # [s]


class LoggedLoop(NamedTuple):
    """What a loop took.

    Attributes:
        wall: Time of the loop, [s].
        cpu: CPU time of its process meanwhile, that of the system for it included, [s].
        process_cpu: CPU time of the recording's process, its imports left out, [s]; 0
            without a recording.
        size: Size of the recording, [MB]; 0 without one.
        simulated_time: Simulated time, [s].
    """

    wall: float
    cpu: float
    process_cpu: float
    size: float
    simulated_time: float


def measure_log(config: Config, duration: float, repeats: int) -> dict[str, Any]:
    """Return what the recording of a run costs.

    Each repeat is a pair: the loop as with ``--no-log``, which writes all other files,
    and the same with its recording, by turns the one and the other first.

    Args:
        config: The run.
        duration: How long it is to be, [s].
        repeats: How many pairs, at least one.

    Returns:
        Numbers by name: those of `compare_pairs`, the radius of the ball, and the load
        of the machine before and after, None where it is not known.
    """
    before = read_load()
    config = dataclasses.replace(config, duration=duration)
    pairs = []
    for i in range(repeats):
        order = (False, True) if i % 2 == 0 else (True, False)
        loops = {is_logged: _run(config, is_logged) for is_logged in order}
        pairs.append((loops[False], loops[True]))
    load = {"load_before": before, "load_after": read_load()}
    return {"ball_radius": config.ball.radius, **load, **compare_pairs(pairs)}


def compare_pairs(pairs: Sequence[tuple[LoggedLoop, LoggedLoop]]) -> dict[str, Any]:
    """Return what the recording adds to a loop, and what it takes besides.

    Args:
        pairs: A loop without and one with its recording, for each repeat.

    Returns:
        ``loop_s`` and ``loop_cpu_s``: the times, ``without`` and ``with``. ``cost``:
        what the recording adds to each as a part of that without, the median of the
        pairs, and ``of_least``, from the least times. ``process_cpu_s``: least CPU time
        of the recording's process. ``recording_mb`` and ``mb_per_minute``.
    """
    without, logged = zip(*pairs, strict=True)
    wall = {"without": [p.wall for p in without], "with": [p.wall for p in logged]}
    cpu = {"without": [p.cpu for p in without], "with": [p.cpu for p in logged]}
    last = logged[-1]
    return {
        "simulated_time": last.simulated_time,
        "loop_s": wall,
        "loop_cpu_s": cpu,
        "cost": {"wall": _compare(wall), "cpu": _compare(cpu)},
        "process_cpu_s": min(p.process_cpu for p in logged),
        "recording_mb": last.size,
        "mb_per_minute": last.size * _MINUTE / last.simulated_time,
    }


def _compare(times: Mapping[str, Sequence[float]]) -> dict[str, float]:
    ratios = [b / a for a, b in zip(times["without"], times["with"], strict=True)]
    return {
        "median": statistics.median(ratios) - 1.0,
        "of_least": min(times["with"]) / min(times["without"]) - 1.0,
    }


class _CpuClock:
    """Measures the CPU time of the process from start to the last rows.

    It has to be the last recorder: what the others do counts.

    Attributes:
        cpu_time: The time so far, [s].
    """

    def __init__(self) -> None:
        self._start = self.cpu_time = 0.0

    def start(self, context: RunContext) -> None:
        self._start = time.process_time()

    def record(self, block: RunBlock) -> None:
        self.cpu_time = time.process_time() - self._start

    def close(self) -> None:
        pass


def _run(config: Config, is_logged: bool) -> LoggedLoop:
    prepared, clock = prepare(config), _CpuClock()
    with TemporaryDirectory() as name:
        folder = Path(name)
        recorders: list[Recorder] = [
            SummaryRecorder(),
            ControlsRecorder(folder),
            ReadingsRecorder(folder),
        ]
        recording = RecordingProcess(folder / RECORDING_FILE) if is_logged else None
        if recording is not None:
            recorders.append(recording)
        gc.collect()
        outcome = simulate(prepared, [*recorders, clock])
        file = folder / RECORDING_FILE
        return LoggedLoop(
            outcome.wall_time,
            clock.cpu_time,
            0.0 if recording is None else recording.cpu_time,
            file.stat().st_size / _MEGABYTE if is_logged else 0.0,
            outcome.simulated_time,
        )
