"""From a run to the numbers of its summary, block by block while it goes on."""

from __future__ import annotations

import hashlib
import math
import platform
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import mujoco
import numpy as np

from ballsim import __version__
from ballsim.config import Config
from ballsim.estimate_errors import (
    ESTIMATE_ERRORS,
    MIN_LOAD,
    MeanSquares,
    compute_estimate_errors,
)
from ballsim.heading_error import HeadingError
from ballsim.hold_errors import HoldErrors, find_largest
from ballsim.outcome import KeptRun, RunOutcome
from ballsim.path_errors import PathErrors
from ballsim.preparation import PreparedRun
from ballsim.recording.recorder import Recorder, RunBlock, RunContext
from ballsim.series import RunSeries
from ballsim.simulation import Conductor, Progress, simulate
from ballsim.stride_speed import StrideSpeeds
from ballsim.truth import ContactTruth, compute_state_truth
from ballsim_controllers.messages import Array
from ballsim_controllers.sensor_names import SENSOR_NAMES

__all__ = [
    "SummaryRecorder",
    "TrajectoryDigest",
    "collect_versions",
    "compute_cop_deviations",
    "compute_overshoot",
    "compute_trajectory_digest",
    "run_and_summarise",
    "summarise",
]

_PACKAGES = ("mujoco", "numpy", "scipy", "mink", "daqp", "rerun-sdk")


class TrajectoryDigest:
    """SHA-256 of the states at all ticks, bit for bit."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._hash = hashlib.sha256()

    def start(self, context: RunContext) -> None:
        """Do nothing."""

    def record(self, block: RunBlock) -> None:
        """Add the states of a block: all but the first, which ended the one before."""
        qpos = block.series.qpos[0 if block.is_first else 1 :]
        self._hash.update(np.ascontiguousarray(qpos, dtype="<f8").data)

    def close(self) -> None:
        """Do nothing."""

    def hexdigest(self) -> str:
        """Return the digest of the states so far."""
        return self._hash.hexdigest()


class SummaryRecorder:
    """Computes the summary of a run; keeps one number per tick, and a few more.

    The speed of the ball over the last half of the run needs all speeds, because
    nobody knows beforehand when a robot falls.
    """

    def __init__(self) -> None:
        """Prepare to start."""
        self._digest = TrajectoryDigest()
        self._errors = MeanSquares(len(ESTIMATE_ERRORS))
        self._cop = MeanSquares(1)
        self._config: Config | None = None
        self._scores: tuple[HoldErrors, PathErrors, HeadingError] | None = None
        self._strides = StrideSpeeds()
        self._speeds: list[Array] = []
        self._contact_before: tuple[Array, Array] | None = None
        self._angle, self._target = math.nan, math.nan
        self._place = np.full(2, math.nan)
        self._least_angle, self._greatest_angle = math.inf, -math.inf
        self._drift, self._torque, self._steps = 0.0, 0.0, 0
        self._is_estimating = False
        self._ill_ticks = np.zeros(len(SENSOR_NAMES), dtype=np.int_)

    def start(self, context: RunContext) -> None:
        """Load what is compiled: the loop is timed."""
        nq, nv = context.model.nq, context.model.nv
        no_states = np.empty((0, nq)), np.empty((0, nv))
        compute_state_truth(context.model, context.ids, context.world, *no_states)

    def record(self, block: RunBlock) -> None:
        """Add a block."""
        series, truth, contact = block.series, block.truth, block.contact
        config = block.context.config
        radius = config.ball.radius
        self._digest.record(block)
        angles = truth.position_ball_in_world[:, 0] / radius
        speeds = truth.linear_velocity_ball_in_world[:, 0] / radius
        self._speeds.append(speeds if block.is_first else speeds[1:])
        holds, path, heading = self._follow(config)
        holds.add(series.first_tick, angles[1:], series.target_ball_angles)
        counts = series.telemetry.step_count
        self._strides.add(series.first_tick, angles[:-1], counts)
        places = truth.position_ball_in_world[:-1, :2]
        path.add(series.first_tick, places, counts)
        heading.add(series.telemetry.quaternion_trunk_to_world)
        self._angle = float(angles[-1])
        self._least_angle = min(self._least_angle, float(angles.min()))
        self._greatest_angle = max(self._greatest_angle, float(angles.max()))
        self._place = truth.position_ball_in_world[-1, :2]
        drift = np.abs(truth.position_ball_in_world[:, 1]).max()
        self._drift = max(self._drift, float(drift))
        torque = np.abs(series.actuator_forces).max()
        self._torque = max(self._torque, float(torque))
        self._steps = max(self._steps, int(counts.max()))
        ill = series.telemetry.ill_sensors
        if ill.any():
            bits = ill[:, None] >> np.arange(len(SENSOR_NAMES)) & 1
            self._ill_ticks += bits.sum(axis=0)
        self._target = float(series.target_ball_angles[-1])
        self._cop.add(compute_cop_deviations(series, contact)[:, None] ** 2)
        is_told = np.isfinite(series.telemetry.quaternion_trunk_to_world).any()
        self._is_estimating = self._is_estimating or bool(is_told)
        self._errors.add(
            compute_estimate_errors(series, truth, contact, self._contact_before)
        )
        self._contact_before = (
            contact.normal_forces[-1],
            contact.cop_to_ball_in_world[-1],
        )

    def close(self) -> None:
        """Do nothing."""

    def finish(self, outcome: RunOutcome, command: str) -> dict[str, Any]:
        """Return the summary as it stands in ``summary.json``.

        Args:
            outcome: How the run ended.
            command: Command line that made it.

        Returns:
            Scalars and tables that JSON can hold; None where a number is not
            defined. Angles in [rad], lengths in [m], times in [s].
        """
        config, time = outcome.config, outcome.simulated_time
        speeds = np.concatenate(self._speeds)
        last_half = speeds[len(speeds) // 2 :]
        rms = self._errors.root_means()
        table = dict(zip(ESTIMATE_ERRORS, rms, strict=True))
        holds, path, heading = self._follow(config)
        path_errors = path.finish()
        radius, points = config.ball.radius, config.command.timeline
        is_sideways = any(
            p.path.curve != "none" or p.find_place(radius)[1] for p in points
        )
        period = config.simulation.control_period
        extremes = np.array([self._least_angle, self._greatest_angle])
        summary = {
            "scenario": config.scenario,
            "controller": config.controller.name,
            "sensors": config.sensors.preset,
            "robot": config.robot.name,
            "ball_radius": config.ball.radius,
            "ball_mass": config.ball.mass,
            "ball_inertia": config.ball.moment_of_inertia,
            "seed": config.seed,
            "duration": config.duration,
            "simulated_time": round(time, 9),
            "survived": outcome.is_upright,
            "fall_time": None if outcome.is_upright else round(time, 9),
            "fall_reason": outcome.fall_reason,
            "target_ball_angle": self._target,
            "final_ball_angle": self._angle,
            "ball_angle_error": self._angle - self._target,
            "ball_angle_overshoot": compute_overshoot(extremes, self._target),
            "hold_errors": holds.finish(),
            "hold_error_max": find_largest(holds.finish()),
            "floor_target_error": self._find_floor_error(outcome),
            "cross_track_rms": path_errors[0],
            "cross_track_max": path_errors[1],
            "heading_error": heading.finish(),
            "ball_speed_mean": float(last_half.mean()),
            "ball_speed_std": float(last_half.std()),
            "ball_speed_stride_std": self._strides.compute_spread(
                outcome.n_ticks // 2, period
            ),
            "ball_lateral_drift": math.nan if is_sideways else self._drift,
            "step_count": self._steps,
            "cop_deviation_max": self._cop.root_maxima()[0],
            "cop_deviation_rms": self._cop.root_means()[0],
            "sensor_outage": dict(
                zip(SENSOR_NAMES, (period * self._ill_ticks).tolist(), strict=True)
            ),
            "estimate_rms": table if self._is_estimating else {},
            "peak_joint_torque": self._torque,
            "realtime_factor": time / outcome.wall_time,
            "wall_time": outcome.wall_time,
            "trajectory_sha256": self._digest.hexdigest(),
            "versions": collect_versions(),
            "command": command,
        }
        return {key: _finite_or_none(value) for key, value in summary.items()}

    def _follow(self, config: Config) -> tuple[HoldErrors, PathErrors, HeadingError]:
        """Return what measures the run by its commands; an operator may add some."""
        if self._scores is None:
            self._scores = HoldErrors(config), PathErrors(config), HeadingError(config)
        elif config is not self._config:
            for score in self._scores:
                score.follow(config)
        self._config = config
        return self._scores

    def _find_floor_error(self, outcome: RunOutcome) -> float:
        """Return how far from its target the ball is at the end, NaN for none, [m]."""
        config, target = outcome.config, (0.0, 0.0)
        for point in config.command.timeline:
            if config.find_tick(point.time) < outcome.n_ticks:
                target = point.find_place(config.ball.radius)
                if point.ball_speed != 0.0:
                    target = (math.nan, math.nan)
        return float(np.hypot(*(self._place - target)))


def run_and_summarise(
    prepared: PreparedRun,
    command: str,
    recorders: Iterable[Recorder] = (),
    progress: Progress | None = None,
    conductor: Conductor | None = None,
) -> tuple[RunOutcome, dict[str, Any]]:
    """Run what has been prepared; memory does not grow with the run's length.

    Args:
        prepared: The run.
        command: Command line, for the summary.
        recorders: Get the run block by block, too.
        progress: Called with ticks done and ticks in all, now and then.
        conductor: Who conducts the run, if anybody does.

    Returns:
        How the run ended, and its summary.

    Raises:
        PhysicsError: The physics failed; the error carries the last states.
    """
    summary = SummaryRecorder()
    outcome = simulate(prepared, [summary, *recorders], progress, conductor)
    return outcome, summary.finish(outcome, command)


def summarise(result: KeptRun, command: str) -> dict[str, Any]:
    """Compute the summary of a run that was kept in memory.

    Args:
        result: The run.
        command: Command line that made it.
    """
    summary = SummaryRecorder()
    scratch = mujoco.MjData(result.model)
    summary.record(RunBlock(result.context, result.series, scratch))
    return summary.finish(result, command)


def compute_overshoot(angles: Array, target: float) -> float:
    """Return how far the ball rolled beyond its target, at least 0, [rad].

    Args:
        angles: Ball angle over time, or its extremes, [rad].
        target: Target, [rad]; for 0 the largest angle either way counts, for NaN
            there is no overshoot: NaN.
    """
    if math.isnan(target):
        return math.nan
    if target == 0.0:
        return float(np.abs(angles).max())
    return max(0.0, float((math.copysign(1.0, target) * (angles - target)).max()))


def compute_trajectory_digest(qpos: Array) -> str:
    """Return the SHA-256 of the states at all ticks, bit for bit.

    Args:
        qpos: States, shape (n, nq).
    """
    return hashlib.sha256(np.ascontiguousarray(qpos, dtype="<f8").data).hexdigest()


def compute_cop_deviations(series: RunSeries, contact: ContactTruth) -> Array:
    """Return the distance of the actual from the ideal CoP at each tick, [m].

    Both are taken relative to the ball's centre (the ideal one to the estimated
    centre), so that drift of the robot's world does not count. NaN where the
    feet carry less than 20 N or the controller reports nothing.

    Args:
        series: Rows of a run.
        contact: True contact of the feet at the same ticks.
    """
    telemetry = series.telemetry
    ideal = telemetry.ideal_cop - telemetry.position_ball_in_world[:, :2]
    x, y = (ideal - contact.cop_to_ball_in_world).T
    deviations: Array = np.hypot(x, y)
    deviations[contact.normal_forces.sum(axis=1) < MIN_LOAD] = np.nan
    return deviations


def collect_versions() -> dict[str, str]:
    """Return the versions of everything that a trajectory may depend on."""
    versions = {
        "ballsim": __version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "mujoco_library": mujoco.mj_versionString(),
    }
    for package in _PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions


def _finite_or_none(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
