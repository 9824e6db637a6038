"""The loop: sensors, controller and drives at the control rate, physics faster.

The loop keeps no more than a block of rows, so that memory does not grow with the
length of a run. Who needs the rows is a recorder: the log, the summary, the files.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from ballsim.config import CommandPoint, Config
from ballsim.errors import PhysicsError
from ballsim.fall import FallDetector
from ballsim.outcome import RunOutcome, RunResult
from ballsim.preparation import PreparedRun, prepare
from ballsim.recording.distributor import BlockDistributor
from ballsim.recording.recorder import Recorder, RunContext, SeriesKeeper
from ballsim.series import LiveState
from ballsim_controllers.messages import Command

__all__ = ["Progress", "RunOutcome", "RunResult", "run", "run_prepared", "simulate"]

Progress = Callable[[int, int], None]


def run(
    config: Config,
    out_dir: Path | None = None,
    is_logged: bool = True,
    progress: Progress | None = None,
) -> RunResult:
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
    return RunResult.of(finished.outcome, keeper.series)


def run_prepared(
    prepared: PreparedRun,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
) -> RunResult:
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
    return RunResult.of(outcome, keeper.series)


def simulate(
    prepared: PreparedRun,
    recorders: Iterable[Recorder] = (),
    progress: Progress | None = None,
) -> RunOutcome:
    """Run what has been prepared; memory does not grow with the run's length.

    Args:
        prepared: The run.
        recorders: Get the series block by block while they grow.
        progress: Called with ticks done and ticks in all, now and then.

    Raises:
        PhysicsError: The physics failed; the error carries the last states.
    """
    config, plant, n_ticks = prepared.config, prepared.plant, prepared.config.n_ticks
    controller, sensors, data = prepared.controller, prepared.sensors, plant.data
    commands = _CommandSchedule(config)
    context = _make_context(prepared)
    detector = FallDetector.of_start(
        plant.model, data, context.ids, config.simulation, data.qpos
    )
    distributor = BlockDistributor(context, recorders)
    live = LiveState(plant.model, data, context.ids.body_ball)
    sensordata, pushes = plant.compute_first_sensordata(), prepared.pushes
    wrenches = None
    reason, n_done, row = None, 0, 0
    try:
        block, n_rows = distributor.start(live), distributor.n_rows
        is_whole = block.holds_all
        # What stands when the loop begins is not looked through again and again.
        gc.freeze()
        start = time.perf_counter()
        while n_done < n_ticks and reason is None:
            reading = sensors.read(data.time, sensordata)
            command = commands.at(n_done)
            ctrl = controller.step(reading, command).positions
            report = controller.telemetry if is_whole else None
            is_free = command.ball_speed or command.path is not None
            target = math.nan if is_free else command.target_ball_angle
            if pushes is not None:
                wrenches = pushes.at(n_done)
            block.store_inputs(row, reading, report, ctrl, target, wrenches)
            block.commands.append(command)
            plant.step(ctrl, wrenches)
            geoms = block.store_effects(row, live)
            reason = detector.find_reason(geoms)
            sensordata = live.sensordata
            n_done += 1
            row += 1
            if row == n_rows or n_done == n_ticks or reason is not None:
                block, row = distributor.hand_over(block), 0
                if progress is not None:
                    progress(n_done, n_ticks)
        wall_time = time.perf_counter() - start
    except PhysicsError as error:
        distributor.hand_over(block)
        states = distributor.last_states()
        raise PhysicsError(error.reason, error.time, states) from None
    finally:
        gc.unfreeze()
        distributor.close()
    fall_time = None if reason is None else plant.time
    return RunOutcome(context, n_done, plant.time, fall_time, reason, wall_time)


def _make_context(prepared: PreparedRun) -> RunContext:
    return RunContext(
        config=prepared.config,
        robot=prepared.robot,
        scene_xml=prepared.scene_xml,
        model=prepared.plant.model,
        ids=prepared.ids,
        world=prepared.world,
    )


class _CommandSchedule:
    """The operator: the command at each tick."""

    def __init__(self, config: Config) -> None:
        self._points = [
            (config.find_tick(point.time), _make_command(point, config.ball.radius))
            for point in config.command.timeline
        ]
        self._present = Command()

    def at(self, tick: int) -> Command:
        """Return the command at a tick; ticks must not decrease."""
        while self._points and self._points[0][0] <= tick:
            self._present = self._points.pop(0)[1]
        return self._present


def _make_command(point: CommandPoint, ball_radius: float) -> Command:
    path = point.path.make_path()
    if path is not None:
        stepping, speed = point.is_stepping, point.path.speed
        return Command(
            is_stepping=stepping,
            path=path,
            path_speed=speed,
            heading=point.heading,
            is_facing_path=point.path.is_faced,
        )
    x, y = point.find_place(ball_radius)
    angle = point.target_ball_angle if point.distance == 0.0 else x / ball_radius
    return Command(angle, point.is_stepping, point.ball_speed, y, heading=point.heading)
