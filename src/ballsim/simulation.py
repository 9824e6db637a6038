"""The loop: sensors, controller and drives at the control rate, physics faster."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from ballsim.config import CommandConfig, Config
from ballsim.errors import PhysicsError
from ballsim.fall import FallDetector
from ballsim.preparation import PreparedRun, prepare
from ballsim.recording.recorder import NullRecorder, Recorder, RunContext
from ballsim.scene import SceneIds
from ballsim.series import RunSeries
from ballsim.world_frame import RobotWorld
from ballsim_controllers.messages import Array, Command
from ballsim_controllers.robot import RobotDescription

__all__ = ["Progress", "RunResult", "run", "run_prepared"]

Progress = Callable[[int, int], None]

_FLUSH_PERIOD = 0.4  # of rows that go to the recorder at once, [s]
_N_LAST_STATES = 500  # rows of the dump after a failure


@dataclass(frozen=True, slots=True)
class RunResult:
    """What a run gave.

    Attributes:
        config: The configuration.
        robot: Description of the robot.
        scene_xml: The scene as MJCF text.
        model: The model compiled from it.
        ids: Its ids.
        world: The robot's world in the true one.
        series: Time series.
        fall_time: When the robot fell, [s], or None.
        fall_reason: Why it counts as a fall, or None.
        wall_time: Time that the loop took, [s].
    """

    config: Config
    robot: RobotDescription
    scene_xml: str
    model: mujoco.MjModel
    ids: SceneIds
    world: RobotWorld
    series: RunSeries
    fall_time: float | None
    fall_reason: str | None
    wall_time: float

    @property
    def is_upright(self) -> bool:
        """Return True if the robot was up at the end."""
        return self.fall_time is None

    @property
    def simulated_time(self) -> float:
        """Return the time that was simulated, [s]."""
        return float(self.series.time[-1])


def run(
    config: Config,
    out_dir: Path | None = None,
    is_logged: bool = True,
    progress: Progress | None = None,
) -> RunResult:
    """Run a configuration from start to end.

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

    return run_with_files(prepared, out_dir, is_logged, progress).result


def run_prepared(
    prepared: PreparedRun,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
) -> RunResult:
    """Run what has been prepared.

    Args:
        prepared: The run.
        recorder: Gets the time series while they grow.
        progress: Called with ticks done and ticks in all, now and then.

    Raises:
        PhysicsError: The physics failed; the error carries the last states.
    """
    config, plant, ids = prepared.config, prepared.plant, prepared.ids
    model, data, n_ticks = plant.model, plant.data, config.n_ticks
    controller, sensors = prepared.controller, prepared.sensors
    series = RunSeries(n_ticks, model)
    contacts, readings, telemetry = series.contacts, series.readings, series.telemetry
    commands = _CommandSchedule(config.command, config.simulation.control_period)
    detector = _make_fall_detector(prepared)
    recorder = NullRecorder() if recorder is None else recorder
    recorder.start(RunContext(config, model, ids, prepared.world, prepared.robot))
    n_recorded, n_flush = 0, config.count_ticks(_FLUSH_PERIOD)
    reason = None
    sensordata = plant.compute_first_sensordata()
    series.store_state(0, data)
    start = time.perf_counter()
    try:
        for tick in range(n_ticks):
            reading = sensors.read(data.time, sensordata)
            readings.store(tick, reading)
            command = commands.at(tick)
            targets = controller.step(reading, command)
            report = controller.telemetry
            if report is not None:
                telemetry.store(tick, report)
            ctrl = targets.positions
            series.store_inputs(tick, ctrl, command.target_ball_angle)
            plant.step(ctrl)
            series.store_state(tick + 1, data)
            series.store_effects(tick, data, ids.body_ball)
            geoms = contacts.store(tick, model, data)
            sensordata = data.sensordata
            reason = detector.find_reason(geoms)
            is_flushing = tick + 1 - n_recorded == n_flush
            if is_flushing:
                recorder.record(series, n_recorded, tick + 1)
                n_recorded = tick + 1
            if progress is not None and (is_flushing or tick + 1 == n_ticks):
                progress(tick + 1, n_ticks)
            if reason is not None:
                break
        wall_time = time.perf_counter() - start
        recorder.record(series, n_recorded, series.n_ticks)
    except PhysicsError as error:
        states = _last_states(series)
        raise PhysicsError(error.reason, error.time, states) from None
    finally:
        recorder.close()
    return RunResult(
        config=config,
        robot=prepared.robot,
        scene_xml=prepared.scene_xml,
        model=model,
        ids=ids,
        world=prepared.world,
        series=series,
        fall_time=None if reason is None else plant.time,
        fall_reason=reason,
        wall_time=wall_time,
    )


class _CommandSchedule:
    """The operator: the command at each tick."""

    def __init__(self, config: CommandConfig, period: float) -> None:
        self._points = [
            (
                math.ceil(point.time / period - 1e-9),
                Command(point.target_ball_angle, point.is_stepping),
            )
            for point in config.timeline
        ]
        self._present = Command()

    def at(self, tick: int) -> Command:
        """Return the command at a tick; ticks must not decrease."""
        while self._points and self._points[0][0] <= tick:
            self._present = self._points.pop(0)[1]
        return self._present


def _make_fall_detector(prepared: PreparedRun) -> FallDetector:
    plant, ids = prepared.plant, prepared.ids
    scratch = mujoco.MjData(plant.model)
    scratch.qpos[:] = plant.data.qpos
    mujoco.mj_kinematics(plant.model, scratch)
    mujoco.mj_comPos(plant.model, scratch)
    radius = prepared.config.ball.radius
    top = float(scratch.xpos[ids.body_ball, 2]) + radius
    height = float(scratch.subtree_com[ids.body_trunk, 2]) - top
    config = prepared.config.simulation
    return FallDetector(plant.model, plant.data, ids, config, height, radius)


def _last_states(series: RunSeries) -> dict[str, Array]:
    last = slice(max(0, series.n_ticks - _N_LAST_STATES), None)
    return {
        "time": np.array(series.time[last]),
        "qpos": np.array(series.qpos[last]),
        "qvel": np.array(series.qvel[last]),
        "ctrl": np.array(series.ctrl[last]),
    }
