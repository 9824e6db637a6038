"""From the result of a run to the numbers of its summary; pure functions."""

from __future__ import annotations

import hashlib
import math
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import mujoco
import numpy as np

from ballsim import __version__
from ballsim.simulation import RunResult
from ballsim.truth import (
    ContactTruth,
    StateTruth,
    compute_contact_truth,
    compute_state_truth,
)
from ballsim_controllers.messages import Array

__all__ = [
    "collect_versions",
    "compute_cop_deviations",
    "compute_estimate_rms",
    "compute_overshoot",
    "compute_trajectory_digest",
    "summarise",
]

_MIN_LOAD = 20.0  # least force on both feet for a CoP to mean anything, [N]
_PACKAGES = ("mujoco", "numpy", "scipy", "mink", "daqp", "rerun-sdk")


def summarise(result: RunResult, command: str) -> dict[str, Any]:
    """Compute the summary of a run, as it stands in ``summary.json``.

    Args:
        result: The run.
        command: Command line that made it.

    Returns:
        Scalars and tables that JSON can hold; None where a number is not defined.
        Angles in [rad], lengths in [m], times in [s].
    """
    config, series = result.config, result.series
    truth = compute_state_truth(
        result.model, result.ids, result.world, series.qpos, series.qvel
    )
    contact = compute_contact_truth(result.ids, result.world, series)
    radius = config.ball.radius
    positions = truth.position_ball_in_world
    angles = positions[:, 0] / radius
    speeds = truth.linear_velocity_ball_in_world[:, 0] / radius
    target = float(series.target_ball_angles[-1])
    deviations = compute_cop_deviations(result, contact)
    last_half = speeds[len(speeds) // 2 :]
    summary = {
        "scenario": config.scenario,
        "controller": config.controller.name,
        "sensors": config.sensors.preset,
        "robot": config.robot.name,
        "ball_radius": radius,
        "ball_mass": config.ball.mass,
        "ball_inertia": config.ball.moment_of_inertia,
        "seed": config.seed,
        "duration": config.duration,
        "simulated_time": round(result.simulated_time, 9),
        "survived": result.is_upright,
        "fall_time": None if result.is_upright else round(result.simulated_time, 9),
        "fall_reason": result.fall_reason,
        "target_ball_angle": target,
        "final_ball_angle": float(angles[-1]),
        "ball_angle_error": float(angles[-1]) - target,
        "ball_angle_overshoot": compute_overshoot(angles, target),
        "ball_speed_mean": float(last_half.mean()),
        "ball_speed_std": float(last_half.std()),
        "ball_lateral_drift": float(np.abs(positions[:, 1]).max()),
        "step_count": int(series.telemetry.step_count[: series.n_ticks].max()),
        "cop_deviation_max": _largest(deviations),
        "cop_deviation_rms": _rms(deviations),
        "estimate_rms": compute_estimate_rms(result, truth, contact),
        "peak_joint_torque": float(np.abs(series.actuator_forces).max()),
        "realtime_factor": result.simulated_time / result.wall_time,
        "wall_time": result.wall_time,
        "trajectory_sha256": compute_trajectory_digest(series.qpos),
        "versions": collect_versions(),
        "command": command,
    }
    return {key: _finite_or_none(value) for key, value in summary.items()}


def compute_overshoot(angles: Array, target: float) -> float:
    """Return how far the ball rolled beyond its target, at least 0, [rad].

    Args:
        angles: Ball angle over time, [rad].
        target: Target, [rad]; for 0 the largest angle either way counts.
    """
    if target == 0.0:
        return float(np.abs(angles).max())
    return max(0.0, float((math.copysign(1.0, target) * (angles - target)).max()))


def compute_trajectory_digest(qpos: Array) -> str:
    """Return the SHA-256 of the states at all ticks, bit for bit.

    Args:
        qpos: States, shape (n, nq).
    """
    return hashlib.sha256(np.ascontiguousarray(qpos, dtype="<f8").tobytes()).hexdigest()


def compute_cop_deviations(result: RunResult, contact: ContactTruth) -> Array:
    """Return the distance of the actual from the ideal CoP at each tick, [m].

    Both are taken relative to the ball's centre (the ideal one to the estimated
    centre), so that drift of the robot's world does not count. NaN where the
    feet carry less than 20 N or the controller reports nothing.

    Args:
        result: The run.
        contact: True contact of the feet.
    """
    n, telemetry = result.series.n_ticks, result.series.telemetry
    ideal = telemetry.ideal_cop[:n] - telemetry.position_ball_in_world[:n, :2]
    deviations: Array = np.linalg.norm(ideal - contact.cop_to_ball_in_world, axis=1)
    deviations[contact.normal_forces.sum(axis=1) < _MIN_LOAD] = np.nan
    return deviations


def compute_estimate_rms(
    result: RunResult, truth: StateTruth, contact: ContactTruth
) -> dict[str, float | None]:
    """Return the root mean square of the estimate's errors, per quantity.

    Args:
        result: The run.
        truth: True states.
        contact: True contact of the feet, one physics step before the next tick.

    Returns:
        Values by names that end with their unit; empty without telemetry.
    """
    n, e = result.series.n_ticks, result.series.telemetry
    if not np.isfinite(e.quaternion_trunk_to_world[:n]).any():
        return {}
    ball, true_ball = e.position_ball_in_world[:n], truth.position_ball_in_world[:n]
    com, true_com = e.position_com_in_world[:n], truth.position_com_in_world[:n]
    up = _vertical_in_trunk(e.quaternion_trunk_to_world[:n])
    true_up = _vertical_in_trunk(truth.quaternion_trunk_to_world[:n])
    yaw = _headings(e.quaternion_trunk_to_world[:n])
    true_yaw = _headings(truth.quaternion_trunk_to_world[:n])
    cop = e.cop_in_world[:n] - ball[:, :2]
    # Contacts are stored with the tick before them: compare with the one after.
    true_cop = np.roll(contact.cop_to_ball_in_world, 1, axis=0)
    true_forces = np.roll(contact.normal_forces, 1, axis=0)
    true_cop[0], true_forces[0] = np.nan, np.nan
    true_cop[true_forces.sum(axis=1) < _MIN_LOAD] = np.nan
    errors = {
        "trunk_tilt_rad": np.cross(up, true_up),
        "trunk_yaw_rad": np.angle(np.exp(1j * (yaw - true_yaw)))[:, None],
        "trunk_angular_velocity_rad_s": e.angular_velocity_trunk_in_trunk[:n]
        - truth.angular_velocity_trunk_in_trunk[:n],
        "com_to_ball_m": (com - ball) - (true_com - true_ball),
        "com_velocity_m_s": e.linear_velocity_com_in_world[:n]
        - truth.linear_velocity_com_in_world[:n],
        "ball_position_m": ball - true_ball,
        "ball_velocity_m_s": e.linear_velocity_ball_in_world[:n]
        - truth.linear_velocity_ball_in_world[:n],
        "ball_angular_velocity_rad_s": e.angular_velocity_ball_in_world[:n]
        - truth.angular_velocity_ball_in_world[:n],
        "cop_to_ball_m": cop - true_cop,
        "normal_force_n": e.normal_forces[:n] - true_forces,
    }
    return {key: _rms(np.linalg.norm(error, axis=1)) for key, error in errors.items()}


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


def _vertical_in_trunk(quaternions: Array) -> Array:
    """Return the world's vertical in the trunk, shape (n, 3)."""
    w, x, y, z = quaternions.T
    up = [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return np.stack(up, axis=1)


def _headings(quaternions: Array) -> Array:
    """Return the heading of the trunk's x axis, shape (n,), [rad]."""
    w, x, y, z = quaternions.T
    headings: Array = np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))
    return headings


def _largest(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else None


def _rms(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else None


def _finite_or_none(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
