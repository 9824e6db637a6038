"""Metrics: keys of the contract, values of simple cases."""

from __future__ import annotations

import dataclasses
import json

import mujoco
import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.metrics import (
    SummaryRecorder,
    compute_cop_deviations,
    compute_overshoot,
    compute_trajectory_digest,
    summarise,
)
from ballsim.preparation import PreparedRun, prepare
from ballsim.recording.recorder import RunBlock
from ballsim.simulation import KeptRun, run_prepared
from ballsim.truth import compute_contact_truth, compute_state_truth
from ballsim_controllers.messages import (
    Command,
    GaitPhase,
    JointTargets,
    SensorReading,
    StateEstimate,
    Telemetry,
)

KEYS = [
    "scenario",
    "controller",
    "sensors",
    "robot",
    "ball_radius",
    "ball_mass",
    "ball_inertia",
    "seed",
    "duration",
    "simulated_time",
    "survived",
    "fall_time",
    "fall_reason",
    "target_ball_angle",
    "final_ball_angle",
    "ball_angle_error",
    "ball_angle_overshoot",
    "hold_errors",
    "hold_error_max",
    "floor_target_error",
    "cross_track_rms",
    "cross_track_max",
    "heading_error",
    "ball_speed_mean",
    "ball_speed_std",
    "ball_speed_stride_std",
    "ball_lateral_drift",
    "step_count",
    "cop_deviation_max",
    "cop_deviation_rms",
    "estimate_rms",
    "peak_joint_torque",
    "realtime_factor",
    "trajectory_sha256",
    "versions",
    "command",
]


SPEED_KEY = "command.timeline.0.ball_speed_rad_s=0.4"
PLACE_KEYS = (
    "command.timeline.0.time_s=0.1",
    "command.timeline.0.distance_m=2",
    "command.timeline.0.direction_rad=1.5707963267948966",
)


class _Hold:
    """Holds its posture; reports the truth plus an offset if it is given a peephole."""

    def __init__(self, offset: float | None = None) -> None:
        self.offset = offset
        self.prepared: PreparedRun | None = None
        self.posture: np.ndarray | None = None
        self.telemetry: Telemetry | None = None

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        if self.posture is None:
            self.posture = reading.joint_positions.copy()
        if self.prepared is not None and self.offset is not None:
            self.telemetry = self._peep(self.prepared, self.offset)
        return JointTargets(self.posture)

    def _peep(self, prepared: PreparedRun, offset: float) -> Telemetry:
        plant = prepared.plant
        truth = compute_state_truth(
            plant.model,
            prepared.ids,
            prepared.world,
            plant.data.qpos[None].copy(),
            plant.data.qvel[None].copy(),
        )
        row = {f.name: getattr(truth, f.name)[0] for f in dataclasses.fields(truth)}
        del row["position_soles_in_world"]  # no part of the estimate
        row["position_com_in_world"] = row["position_com_in_world"] + [offset, 0, 0]
        centre = row["position_ball_in_world"][:2]
        estimate = StateEstimate.of(
            time=plant.time,
            position_trunk_in_world=np.zeros(3),
            linear_velocity_trunk_in_world=np.zeros(3),
            contacts_in_world=np.zeros((2, 3)),
            normal_forces=np.array([300.0, 300.0]),
            cop_in_world=centre.copy(),
            **row,
        )
        return Telemetry.of(
            estimate=estimate,
            phase=GaitPhase.STAND,
            step_count=3,
            ideal_cop=centre + np.array([0.03, 0.04]),
            commanded_cop=centre,
            target_com=np.zeros(3),
            target_soles=np.zeros((2, 3)),
            reference_ball_angle=0.0,
            joint_torques=np.zeros(18),
        )


def _run(controller: _Hold, *overrides: str) -> KeptRun:
    config = load_config("roll-to", ["duration_s=0.3", *overrides]).config
    controller.prepared = prepare(config, controller)
    return run_prepared(controller.prepared)


def test_summary_has_the_keys_of_the_contract() -> None:
    """Every promised key is there, and JSON can hold it all."""
    summary = summarise(_run(_Hold()), "ballsim run roll-to")
    assert set(KEYS) <= set(summary)
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert summary["command"] == "ballsim run roll-to"
    assert summary["survived"] is True
    assert summary["fall_time"] is None
    assert summary["estimate_rms"] == {}
    assert summary["cop_deviation_max"] is None
    assert summary["peak_joint_torque"] > 1.0
    assert summary["versions"]["mujoco"]


def test_perfect_estimate_has_no_error() -> None:
    """An estimate that equals the truth has zero error in every state."""
    table = summarise(_run(_Hold(0.0), "initial.max_yaw_rad=3"), "")["estimate_rms"]
    for key, value in table.items():
        if key not in ("cop_to_ball_m", "normal_force_n"):
            assert value == pytest.approx(0.0, abs=1e-9), key


def test_offset_of_the_estimate_is_measured() -> None:
    """A constant error of the estimate is its RMS, and of that quantity alone."""
    summary = summarise(_run(_Hold(0.05)), "")
    assert summary["estimate_rms"]["com_to_ball_m"] == pytest.approx(0.05)
    assert summary["estimate_rms"]["com_velocity_m_s"] == pytest.approx(0.0, abs=1e-9)
    assert summary["step_count"] == 3


def test_cop_deviation_is_the_distance_on_the_ball() -> None:
    """The deviation is ideal minus actual, both relative to the ball's centre."""
    result = _run(_Hold(0.0))
    contact = compute_contact_truth(result.ids, result.world, result.series)
    deviations = compute_cop_deviations(result.series, contact)
    expected = np.hypot(*(contact.cop_to_ball_in_world - [0.03, 0.04]).T)
    np.testing.assert_allclose(deviations, expected, atol=1e-9)
    summary = summarise(result, "")
    assert summary["cop_deviation_max"] == pytest.approx(expected.max())


def test_blocks_give_the_summary_of_the_whole() -> None:
    """Where a run is cut into blocks changes its summary in rounding only."""
    watcher = SummaryRecorder()
    controller = _Hold(0.05)
    config = load_config("roll-to", ["duration_s=0.9", "seed=3"]).config
    controller.prepared = prepare(config, controller)
    result = run_prepared(controller.prepared, watcher)
    assert result.n_ticks == 180  # no whole number of blocks
    whole, parts = summarise(result, ""), watcher.finish(result, "")
    assert whole.pop("estimate_rms") == pytest.approx(parts.pop("estimate_rms"))
    assert whole.pop("trajectory_sha256") == parts.pop("trajectory_sha256")
    for key, value in whole.items():
        is_number = isinstance(value, float) or key == "hold_errors"
        assert parts[key] == (pytest.approx(value) if is_number else value), key
    digest = compute_trajectory_digest(result.series.qpos)
    assert summarise(result, "")["trajectory_sha256"] == digest


def test_speed_is_that_of_the_last_half() -> None:
    """Mean and spread of the ball's speed leave the first half of the run out."""
    result = _run(_Hold(), "duration_s=0.9")
    truth = compute_state_truth(
        result.model, result.ids, result.world, result.series.qpos, result.series.qvel
    )
    speeds = truth.linear_velocity_ball_in_world[len(result.series.time) // 2 :, 0]
    summary = summarise(result, "")
    assert summary["ball_speed_mean"] == pytest.approx(speeds.mean() / 0.5)
    assert summary["ball_speed_std"] == pytest.approx(speeds.std() / 0.5)


def test_contact_is_compared_with_the_estimate_of_the_next_tick() -> None:
    """An estimate that gives back the contact of the tick before has no error."""
    result = _run(_Hold(0.0), "duration_s=0.9")
    series, scratch = result.series, mujoco.MjData(result.model)
    block = RunBlock(result.context, series, scratch)
    forces, cop = block.contact.normal_forces, block.contact.cop_to_ball_in_world
    estimate = series.telemetry.rows["estimate"]
    ball = estimate["position_ball_in_world"][:, :2]
    estimate["normal_forces"][1:] = forces[:-1]
    estimate["cop_in_world"][1:] = ball[1:] + cop[:-1]
    table = summarise(result, "")["estimate_rms"]
    assert table["normal_force_n"] == pytest.approx(0.0, abs=1e-9)
    assert table["cop_to_ball_m"] == pytest.approx(0.0, abs=1e-9)


def test_ball_angle_is_the_way_over_the_radius() -> None:
    """Angle, error and drift come from the ball's way along the heading."""
    result = _run(_Hold(), "target_angle=-2", "command.timeline.0.time_s=0.1")
    summary = summarise(result, "")
    start, end = (result.series.qpos[i][result.ids.qpos_ball][:2] for i in (0, -1))
    heading = np.array([np.cos(result.world.yaw), np.sin(result.world.yaw)])
    assert summary["final_ball_angle"] == pytest.approx((end - start) @ heading / 0.5)
    assert summary["target_ball_angle"] == -2.0
    error = summary["final_ball_angle"] + 2.0
    assert summary["ball_angle_error"] == pytest.approx(error)


@pytest.mark.parametrize(
    ("angles", "target", "overshoot"),
    [
        ([0.0, 1.0, 2.3, 2.0], 2.0, 0.3),
        ([0.0, -1.0, -2.3, -2.0], -2.0, 0.3),
        ([0.0, 1.0], 2.0, 0.0),
        ([0.1, -0.4, 0.0], 0.0, 0.4),
    ],
)
def test_overshoot(angles: list[float], target: float, overshoot: float) -> None:
    """Overshoot counts beyond the target only, in the direction of travel."""
    assert compute_overshoot(np.array(angles), target) == pytest.approx(overshoot)


def test_speed_has_no_target_to_miss() -> None:
    """A commanded speed leaves everything that needs a target undefined."""
    early = "command.timeline.0.time_s=0.1"
    result = _run(_Hold(), early, "command.timeline.0.target_angle_rad=0", SPEED_KEY)
    summary = summarise(result, "")
    for key in ("target_ball_angle", "ball_angle_error", "ball_angle_overshoot"):
        assert summary[key] is None, key
    assert summary["hold_errors"] == []
    assert summary["hold_error_max"] is None
    assert summary["floor_target_error"] is None


def test_floor_error_is_the_distance_from_the_place() -> None:
    """Two metres to the left of a ball that stays are missed by two metres, about."""
    keys = ("command.timeline.0.target_angle_rad=0", *PLACE_KEYS)
    result = _run(_Hold(), *keys)
    start, end = (result.series.qpos[i][result.ids.qpos_ball][:2] for i in (0, -1))
    yaw = result.world.yaw
    left = np.array([-np.sin(yaw), np.cos(yaw)])
    expected = np.linalg.norm(end - start - 2.0 * left)
    summary = summarise(result, "")
    assert summary["floor_target_error"] == pytest.approx(expected)
    assert 1.9 < expected < 2.1
    assert summary["target_ball_angle"] == pytest.approx(0.0, abs=1e-12)


def test_path_leaves_the_angle_without_a_target() -> None:
    """The end of a closed path is its start; a robot that stays has not followed it."""
    keys = [key for key in PLACE_KEYS if "time_s" in key]
    keys += ["command.timeline.0.target_angle_rad=0"]
    result = _run(_Hold(), *keys, "command.timeline.0.path.curve=circle")
    summary = summarise(result, "")
    for key in ("target_ball_angle", "ball_angle_error", "ball_lateral_drift"):
        assert summary[key] is None, key
    assert summary["hold_errors"] == []
    assert summary["cross_track_rms"] is None  # no step
    start, end = (result.series.qpos[i][result.ids.qpos_ball][:2] for i in (0, -1))
    assert summary["floor_target_error"] == pytest.approx(np.linalg.norm(end - start))


def test_digest_sees_every_bit() -> None:
    """One changed bit changes the digest."""
    qpos = np.random.default_rng(0).normal(size=(5, 4))
    other = qpos.copy()
    other[3, 2] = np.nextafter(other[3, 2], 2.0)
    assert compute_trajectory_digest(qpos) == compute_trajectory_digest(qpos.copy())
    assert compute_trajectory_digest(qpos) != compute_trajectory_digest(other)
