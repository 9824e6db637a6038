"""What each part of a control tick costs, from an instrumented run."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ballsim.bench.timers import PartTimers, Target, WrapperCost, patched
from ballsim.config import Config
from ballsim.preparation import PreparedRun, prepare
from ballsim.recording.recording_process import RecordingProcess
from ballsim.simulation import simulate

__all__ = ["PARTS", "RECORDING", "REST", "check_parts", "measure_parts"]

_CONTROL = "ballsim_controllers"

#: In the order of the table. A controller that never calls one has no such row;
#: what it does besides counts as "controller, rest".
PARTS = (
    Target("physics", "plant.step"),
    Target("sensors", "sensors.read"),
    Target("estimation, balance", f"{_CONTROL}.pipeline:sense"),
    Target("reference", f"{_CONTROL}.commanded_motion:CommandedMotion.advance"),
    Target("gait", f"{_CONTROL}.footsteps.gait:GaitClock.advance"),
    Target("gait", f"{_CONTROL}.footsteps.decisions:StepDecisions.first_swing"),
    Target("gait", f"{_CONTROL}.footsteps.decisions:StepDecisions.may_stop"),
    Target("planner", f"{_CONTROL}.pipeline:WheeledLipController._update_plan"),
    Target("swing foot, force distribution", f"{_CONTROL}.pipeline:act"),
    Target("mink", f"{_CONTROL}.whole_body.inverse_kinematics:InverseKinematics.solve"),
    Target("IK targets", f"{_CONTROL}.whole_body.body_control:BodyControl.solve_ik"),
    Target("set-points, telemetry", f"{_CONTROL}.pipeline:finish"),
    Target("controller, rest", "controller.step"),
    Target("storing", "ballsim.series:StateSeries.store_inputs"),
    Target("storing", "ballsim.series:StateSeries.store_effects"),
    Target("storing", "ballsim.series:RunSeries.store_inputs"),
    Target("storing", "ballsim.series:RunSeries.store_effects"),
    Target("fall detection", "ballsim.fall:FallDetector.find_reason"),
)
RECORDING = Target(
    "recording", "ballsim.recording.recording_process:RecordingProcess.record"
)
REST = "loop, rest"


def check_parts(prepared: PreparedRun) -> None:
    """Check that all that is to be timed exists, before anything is measured.

    Args:
        prepared: A run.

    Raises:
        BallsimError: Something does not exist.
    """
    for target in (*PARTS, RECORDING):
        target.find(prepared)


def measure_parts(config: Config, repeats: int) -> dict[str, Any]:
    """Return what each part of a tick costs.

    The quickest of several instrumented runs counts, without the cost of the
    timers. The recording is measured in runs of its own, for its process would
    disturb the other parts; its share is that of the tick without it.

    Args:
        config: The run.
        repeats: Runs of each kind, at least one.

    Returns:
        ``tick_us``, ``wrapper_ns``, the table ``rows``, and ``encoding_us``: CPU
        time that the process of the recording takes for a tick.

    Raises:
        BallsimError: Something that is to be timed does not exist.
    """
    cost = WrapperCost.measure()
    runs = [_run_timed(config, PARTS, cost) for _ in range(repeats)]
    timers, n_ticks, total, _ = min(runs, key=lambda run: run[2])
    rest = timers.rest(total)
    tick_us = (sum(map(sum, timers.samples.values())) + rest) / n_ticks / 1e3
    rows = [
        _make_row(part, samples, n_ticks, tick_us)
        for part, samples in timers.samples.items()
        if samples
    ]
    rest_us = rest / n_ticks / 1e3
    rows.append(
        {
            "part": REST,
            "us_per_tick": rest_us,
            "share": rest_us / tick_us,
            "calls_per_tick": None,
            "us_per_call_median": None,
            "us_per_call_p99": None,
        }
    )
    recorded = [_run_timed(config, (RECORDING,), cost, True) for _ in range(repeats)]
    timers, n_ticks, *_ = min(
        recorded, key=lambda run: sum(run[0].samples["recording"])
    )
    rows.append(_make_row("recording", timers.samples["recording"], n_ticks, tick_us))
    return {
        "ball_radius": config.ball.radius,
        "tick_us": tick_us,
        "wrapper_ns": cost.inner + cost.outer,
        "rows": rows,
        "encoding_us": 1e6 * min(run[3] for run in recorded) / n_ticks,
    }


def _run_timed(
    config: Config,
    targets: Iterable[Target],
    cost: WrapperCost,
    is_logged: bool = False,
) -> tuple[PartTimers, int, int, float]:
    """Run once under timers.

    Returns:
        The timers, the number of ticks, the time of the loop, [ns], and the CPU
        time of the recording's process, [s].
    """
    timers, recordings = PartTimers(cost), []
    with TemporaryDirectory() as folder:
        if is_logged:
            recordings.append(RecordingProcess(Path(folder) / "run.rrd"))
        # The first one only shows the classes: another one is built once they are
        # patched, lest it keep methods from before.
        with patched(targets, prepare(config), timers.wrap):
            prepared = prepare(config)
            timers.reset()
            outcome = simulate(prepared, recordings)
    cpu_time = sum(recording.cpu_time for recording in recordings)
    return timers, outcome.n_ticks, round(1e9 * outcome.wall_time), cpu_time


def _make_row(
    part: str, samples: list[int], n_ticks: int, tick_us: float
) -> dict[str, Any]:
    """Return a row of the table from the times of all calls, [ns]."""
    us_per_tick = sum(samples) / n_ticks / 1e3
    median, p99 = np.percentile(samples, [50, 99]).tolist()
    return {
        "part": part,
        "us_per_tick": us_per_tick,
        "share": us_per_tick / tick_us,
        "calls_per_tick": len(samples) / n_ticks,
        "us_per_call_median": median / 1e3,
        "us_per_call_p99": p99 / 1e3,
    }
