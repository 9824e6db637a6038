"""The closed loop, with and without its recording, beside bare physics."""

from __future__ import annotations

import dataclasses
import gc
import statistics
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import mujoco
import numpy as np

from ballsim.config import Config
from ballsim.errors import ReplayMismatchError
from ballsim.metrics import summarise
from ballsim.outcome import KeptRun, RunOutcome
from ballsim.preparation import prepare
from ballsim.recording.recording_process import RecordingProcess
from ballsim.run_files import run_with_files
from ballsim.simulation import run_prepared, simulate

__all__ = [
    "compare_times",
    "measure_ball",
    "measure_overhead",
    "replay_bare",
    "spread",
]

_WARM_UP = 0.5  # simulated time of the runs that are not counted, [s]


def measure_ball(config: Config, repeats: int) -> dict[str, Any]:
    """Return the real-time factors of a run on one ball.

    Each repeat is a closed loop, then bare physics on what that loop commanded,
    then a closed loop with its recording. A busy machine so disturbs all alike.

    Args:
        config: The run.
        repeats: How often, at least one.

    Returns:
        Numbers by name, see also `compare_times`.

    Raises:
        ReplayMismatchError: Bare physics came to another state than the loop: the
            two did not do the same work.
    """
    warm_up = dataclasses.replace(config, duration=min(_WARM_UP, config.duration))
    replay_bare(_run(warm_up))
    _run_recorded(warm_up)
    closed, bare, recorded = [], [], []
    result = _run(config)
    for _ in range(repeats):
        closed.append(_time_closed(config))
        bare.append(replay_bare(result))
        recorded.append(_run_recorded(config).wall_time)
    simulated = result.simulated_time
    n_steps = result.series.n_ticks * config.n_substeps
    return {
        "ball_radius": config.ball.radius,
        "simulated_time": simulated,
        "survived": result.is_upright,
        "loop_s": {"closed": closed, "recorded": recorded, "bare": bare},
        "bare_us_per_step": spread([1e6 * wall / n_steps for wall in bare], min),
        **compare_times(simulated, closed, recorded, bare),
    }


def compare_times(
    simulated: float,
    closed: Sequence[float],
    recorded: Sequence[float],
    bare: Sequence[float],
) -> dict[str, Any]:
    """Return real-time factors, and how near the closed loop comes to bare physics.

    Args:
        simulated: Simulated time, [s].
        closed: Wall time of the loop in each repeat, [s].
        recorded: The same with recording, [s].
        bare: The same of bare physics, [s].

    Returns:
        ``realtime_factor`` with best and median for each, and ``of_bare``: the
        median of the ratios within a repeat, and the ratio of the best times.
    """
    times = {"closed": closed, "recorded": recorded, "bare": bare}
    return {
        "realtime_factor": {
            name: spread([simulated / wall for wall in walls])
            for name, walls in times.items()
        },
        "of_bare": {
            name: _compare(bare, times[name]) for name in ("closed", "recorded")
        },
    }


def _compare(bare: Sequence[float], walls: Sequence[float]) -> dict[str, float]:
    """Return two measures of one ratio: they differ if the machine was busy.

    The best of the pairs would be none: it is that with the worst of bare physics.
    """
    ratios = [b / w for b, w in zip(bare, walls, strict=True)]
    return {"median": statistics.median(ratios), "of_best": min(bare) / min(walls)}


def spread(values: Iterable[float], best: Any = max) -> dict[str, float]:
    """Return best and median of some repeats.

    Args:
        values: One for each repeat.
        best: ``max`` or ``min``.

    Examples:
        >>> spread([1.0, 2.0, 4.0])
        {'best': 4.0, 'median': 2.0}
    """
    values = list(values)
    return {"best": best(values), "median": statistics.median(values)}


def replay_bare(result: KeptRun) -> float:
    """Step the scene with what a run commanded, and nothing else.

    Args:
        result: The run.

    Returns:
        Wall time of the loop, [s].

    Raises:
        ReplayMismatchError: The last state differs from that of the run.
    """
    model, series, n = result.model, result.series, result.config.n_substeps
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = series.qpos[0], series.qvel[0]
    ctrl, n_ticks = result.inputs, series.n_ticks
    wrenches = series.wrenches
    step = mujoco.mj_step
    gc.collect()
    start = time.perf_counter()
    if wrenches is None:
        for tick in range(n_ticks):
            data.ctrl[:] = ctrl[tick]
            step(model, data, n)
    else:
        for tick in range(n_ticks):
            data.ctrl[:] = ctrl[tick]
            data.xfrc_applied[:] = wrenches[tick]
            step(model, data, n)
    wall = time.perf_counter() - start
    if not np.array_equal(data.qpos, series.qpos[-1]):
        error = float(np.abs(data.qpos - series.qpos[-1]).max())
        raise ReplayMismatchError([f"bare mj_step ends {error:.3g} off in qpos"])
    return wall


def measure_overhead(config: Config, repeats: int) -> dict[str, float]:
    """Return what a run costs besides its loop, least of several, [ms].

    Args:
        config: The run.
        repeats: How often, at least one.

    Returns:
        ``prepare`` (scene, gains, controller), ``loop_set_up`` (arrays),
        ``summary``, ``files`` (all but the recording), and ``recording`` (open
        and close it).
    """
    rows = [_time_overhead(config) for _ in range(repeats)]
    # The least of each first, then differences: those of one run are mostly noise.
    least = {name: 1e3 * min(row[name] for row in rows) for name in rows[0]}
    plain = least["set_up"] + least["summary"]
    return {
        "prepare": least["prepare"],
        "loop_set_up": least["set_up"],
        "summary": least["summary"],
        "files": max(0.0, least["with_files"] - plain),
        "recording": max(0.0, least["with_recording"] - least["with_files"]),
    }


def _time_overhead(config: Config) -> dict[str, float]:
    """Return times of three runs with ever more files, loops left out, [s]."""
    clock = time.perf_counter
    start = clock()
    prepared = prepare(config)
    prepared_at = clock()
    result = run_prepared(prepared)
    finished_at = clock()
    summarise(result, "")
    summarised_at = clock()
    return {
        "prepare": prepared_at - start,
        "set_up": finished_at - prepared_at - result.wall_time,
        "summary": summarised_at - finished_at,
        "with_files": _time_with_files(config, is_logged=False),
        "with_recording": _time_with_files(config, is_logged=True),
    }


def _time_with_files(config: Config, is_logged: bool) -> float:
    """Return the time of a prepared run with its files, that of its loop left out."""
    prepared = prepare(config)
    with TemporaryDirectory() as folder:
        start = time.perf_counter()
        finished = run_with_files(prepared, Path(folder), is_logged=is_logged)
        return time.perf_counter() - start - float(finished.summary["wall_time"])


def _run(config: Config) -> KeptRun:
    """Run and keep the series, for the replay."""
    return run_prepared(prepare(config))


def _time_closed(config: Config) -> float:
    """Return the wall time of a loop whose series nobody takes, [s]."""
    prepared = prepare(config)
    gc.collect()
    return simulate(prepared).wall_time


def _run_recorded(config: Config) -> RunOutcome:
    prepared = prepare(config)
    with TemporaryDirectory() as folder:
        recorder = RecordingProcess(Path(folder) / "run.rrd")
        gc.collect()
        return simulate(prepared, [recorder])
