"""The loop: sensors, controller and drives at the control rate, physics faster.

The loop keeps no more than a block of rows, so that memory does not grow with the
length of a run. Who needs the rows is a recorder: the log, the summary, the files.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from ballsim.config import Config
from ballsim.errors import PhysicsError
from ballsim.fall import FallDetector
from ballsim.outcome import KeptRun, RunOutcome
from ballsim.preparation import PreparedRun, prepare
from ballsim.recording.distributor import BlockDistributor
from ballsim.recording.recorder import Recorder, RunContext, SeriesKeeper
from ballsim.series import LiveState
from ballsim_controllers.messages import Command

__all__ = [
    "Conductor",
    "KeptRun",
    "Progress",
    "RunOutcome",
    "run",
    "run_prepared",
    "simulate",
]

Progress = Callable[[int, int], None]

_BLOCK_PERIOD = 0.4  # [s]


def run(
    config: Config,
    out_dir: Path | None = None,
    is_logged: bool = True,
    progress: Progress | None = None,
) -> KeptRun:
    """Run a configuration from start to end, and keep the series in memory.

    Args:
        config: The configuration.
        out_dir: Folder for the files of the run, or None to write nothing.
        is_logged: True to write the rerun recording too.
        progress: Called with ticks done and ticks in all, now and then.

    Returns:
        The result.

    Raises:
        ConfigError: A value does not fit together with the others, or the
            folder cannot be written; nothing is written then.
        PhysicsError: The physics failed; the folder holds the last states.
    """
    prepared = prepare(config)
    if out_dir is None:
        return run_prepared(prepared, progress=progress)
    from ballsim.run_files import run_with_files  # noqa: PLC0415 - imports us

    keeper = SeriesKeeper()
    finished = run_with_files(
        prepared, out_dir, is_logged, progress, recorders=[keeper]
    )
    return KeptRun.of(finished.outcome, keeper.series)


def run_prepared(
    prepared: PreparedRun,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
) -> KeptRun:
    """Run what has been prepared, and keep the series in memory.

    Args:
        prepared: The run.
        recorder: Gets the series too, block by block.
        progress: Called with ticks done and ticks in all, now and then.

    Raises:
        PhysicsError: The physics failed; the error carries the last states.
    """
    keeper = SeriesKeeper()
    recorders = (keeper,) if recorder is None else (keeper, recorder)
    outcome = simulate(prepared, recorders, progress)
    return KeptRun.of(outcome, keeper.series)


class Conductor(Protocol):
    """Conducts a run that goes on: when a tick begins, and what is asked for.

    What it asks for goes into the schedules of the prepared run, and into a new
    configuration, so that this one is enough to repeat the run.

    Attributes:
        block_period: After what time the recorders get the rows, [s].
    """

    block_period: float

    @property
    def config(self) -> Config:
        """Return the configuration as it is now."""
        ...

    def begin_tick(self, tick: int) -> bool:
        """Return True when a tick may begin, False to end the run before it."""
        ...


class _NoConductor:
    """Lets a run go on as it was configured.

    Args:
        config: The configuration.
    """

    def __init__(self, config: Config) -> None:
        self.config, self.block_period = config, _BLOCK_PERIOD

    def begin_tick(self, tick: int) -> bool:
        """Return True."""
        return True


def simulate(
    prepared: PreparedRun,
    recorders: Iterable[Recorder] = (),
    progress: Progress | None = None,
    conductor: Conductor | None = None,
) -> RunOutcome:
    """Run what has been prepared; memory does not grow with the run's length.

    Args:
        prepared: The run.
        recorders: Get the series block by block while they grow.
        progress: Called with ticks done and ticks in all, now and then.
        conductor: Who conducts the run, if anybody does.

    Raises:
        PhysicsError: The physics failed; the error carries the last states.
    """
    config, plant, n_ticks = prepared.config, prepared.plant, prepared.config.n_ticks
    controller, sensors, data = prepared.controller, prepared.sensors, plant.data
    commands, pushes = prepared.commands, prepared.pushes
    context = _make_context(prepared)
    detector = FallDetector.of_start(
        plant.model, data, context.ids, config.simulation, data.qpos
    )
    may_push = bool(config.pushes) or conductor is not None
    conductor = conductor or _NoConductor(config)
    distributor = BlockDistributor(context, recorders, conductor.block_period, may_push)
    live = LiveState(plant.model, data, context.ids.body_ball)
    sensordata = plant.compute_first_sensordata()
    reason, n_done, row = None, 0, 0
    try:
        block, n_rows = distributor.start(live), distributor.n_rows
        is_whole = block.holds_all
        # What stands when the loop begins is not looked through again and again.
        gc.freeze()
        start = time.perf_counter()
        is_on = conductor.begin_tick(0)
        while is_on:
            reading = sensors.read(data.time, sensordata)
            command = commands.at(n_done)
            ctrl = controller.step(reading, command).positions
            report = controller.telemetry if is_whole else None
            target = _find_target(command)
            wrenches = pushes.at(n_done)
            block.store_inputs(row, reading, report, ctrl, target, wrenches)
            block.commands.append(command)
            plant.step(ctrl, wrenches)
            geoms = block.store_effects(row, live)
            reason = detector.find_reason(geoms)
            sensordata = live.sensordata
            n_done += 1
            row += 1
            is_on = n_done < n_ticks and reason is None
            is_on = is_on and conductor.begin_tick(n_done)
            if row == n_rows or not is_on:
                block, row = distributor.hand_over(block, conductor.config), 0
                if progress is not None:
                    progress(n_done, n_ticks)
        wall_time = time.perf_counter() - start
    except PhysicsError as error:
        distributor.hand_over(block, conductor.config)
        states = distributor.last_states()
        raise PhysicsError(error.reason, error.time, states) from None
    finally:
        gc.unfreeze()
        distributor.close()
    context = replace(context, config=conductor.config)
    fall_time = None if reason is None else plant.time
    return RunOutcome(context, n_done, plant.time, fall_time, reason, wall_time)


def _find_target(command: Command) -> float:
    """Return the ball angle that is asked for, NaN for none, [rad]."""
    is_free = command.ball_speed or command.path is not None
    return math.nan if is_free else command.target_ball_angle


def _make_context(prepared: PreparedRun) -> RunContext:
    return RunContext(
        config=prepared.config,
        robot=prepared.robot,
        scene_xml=prepared.scene_xml,
        model=prepared.plant.model,
        ids=prepared.ids,
        world=prepared.world,
        encoder_zeros=prepared.sensors.encoder_zeros,
    )
