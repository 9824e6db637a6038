"""Laws of the closed loop: standing, stepping, rolling, and what is told of it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ballsim_controllers.footsteps.planner import FootstepPlanner, Plan
from ballsim_controllers.geometry import quaternion_to_rotation
from ballsim_controllers.messages import (
    Array,
    Command,
    Controller,
    GaitPhase,
)

if TYPE_CHECKING:
    from tests.controllers.conftest import RecordedRun, SteppingRun

    from ballsim.simulation import KeptRun

Simulate = Callable[..., "KeptRun"]
NOMINAL = ("initial.max_lean_rad=0", "initial.max_ball_offset_m=0")
EVERY_TICK = {"preview_period_s": 0.005}


@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
def test_robot_stands(simulate: Simulate, radius: float) -> None:
    """Two seconds after a perturbed start the robot is up, at rest, without a step."""
    result = simulate("stand", "duration_s=2", "seed=3", f"ball.radius_m={radius}")
    assert result.is_upright
    series, ids = result.series, result.ids
    assert series.telemetry.step_count.max() == 0
    ball = series.qpos[:, ids.qpos_ball][:, :2]
    assert np.abs(ball - ball[0]).max() < 0.06
    late = series.time >= 1.5
    assert np.abs(series.qvel[late][:, ids.qvel_ball][:, :2]).max() < 0.1
    assert np.abs(series.actuator_forces).max() < 150.0


@pytest.mark.parametrize("radius", [0.25, 0.5])
def test_feedback_of_the_trunk_ends_its_sway(simulate: Simulate, radius: float) -> None:
    """Three seconds after a push from the side the ball is less than half as fast."""
    push = ("force=20", "direction=1.5708", "push.0.time_s=2", "duration_s=8", *NOMINAL)
    speeds = []
    for frequency in (5.8, 0.0):
        change = f"controller.balance.lateral_trunk_frequency_rad_s={frequency}"
        result = simulate("push", f"ball.radius_m={radius}", *push, change)
        assert result.series.telemetry.step_count.max() == 0
        ball = result.series.qvel[:, result.ids.qvel_ball]
        speeds.append(np.abs(ball[result.series.time >= 5.0, 1]).max())
    assert 0.0 < speeds[0] < 0.5 * speeds[1]


@pytest.mark.parametrize("radius", [0.25, 0.5])
def test_strides_teach_the_robot_to_roll_evenly(
    simulate: Simulate, radius: float
) -> None:
    """After half a minute the ball's speed deviates less than half as much."""
    deviations = []
    for rate in (0.05, 0.0):
        change = f"controller.balance.cop_learning_rate={rate}"
        command = ("duration_s=30", f"ball.radius_m={radius}", *NOMINAL)
        result = simulate("constant-velocity", *command, change)
        assert result.is_upright
        ball = result.series.qvel[:, result.ids.qvel_ball]
        deviations.append(ball[result.series.time >= 20.0, 0].std())
    assert deviations[0] < 0.5 * deviations[1]


def test_robot_steps_in_place(simulate: Simulate) -> None:
    """Feet swing in turns, land, and the ball stays where it is."""
    command = ("duration_s=3", "command.timeline.0.time_s=0.1", *NOMINAL)
    result = simulate("step", *command)
    assert result.is_upright
    report = result.series.telemetry
    phases = report.phase[: result.series.n_ticks]
    changes = [GaitPhase(phases[0])]
    for phase in phases.tolist():
        if phase != changes[-1]:
            changes.append(GaitPhase(phase))
    assert changes[:2] == [GaitPhase.STAND, GaitPhase.DOUBLE]
    assert set(changes[1::2]) == {GaitPhase.DOUBLE}
    swings = changes[2::2]
    assert len(swings) >= 6
    assert all(one != other for one, other in itertools.pairwise(swings))
    assert set(swings) == {GaitPhase.LEFT_SUPPORT, GaitPhase.RIGHT_SUPPORT}
    steps = np.diff(report.step_count[: result.series.n_ticks])
    assert set(steps.tolist()) == {0, 1}
    ball = result.series.qpos[:, result.ids.qpos_ball][:, :2]
    assert np.abs(ball - ball[0]).max() < 0.06


def test_roll_begins_with_a_step(simulate: Simulate) -> None:
    """The ball's reference starts with the gait, grows within its limits, is met."""
    command = ("duration_s=4", "command.timeline.0.time_s=0.1", *NOMINAL)
    result = simulate("roll-to", *command)
    assert result.is_upright
    report, n = result.series.telemetry, result.series.n_ticks
    reference, standing = report.reference_ball_angle[:n], report.phase[:n] == 0
    assert standing[0]
    assert not reference[standing].any()
    period = result.config.simulation.control_period
    speed = np.diff(reference) / period
    assert speed.min() >= -1e-9
    assert 0.1 < speed.max() <= 0.4 + 1e-9
    assert reference[-1] > 0.2
    ball = result.series.qpos[:, result.ids.qpos_ball][:, 0]
    assert (ball[-1] - ball[0]) / 0.5 == pytest.approx(reference[-1], abs=0.2)


def test_new_target_waits_for_the_gait(standing: RecordedRun) -> None:
    """Standing feet cannot follow a roll: while the robot stands nothing moves."""
    never = {"start_patience_s": 100.0, "start_offset_m": 0.0}
    controller = standing.make_controller({"gait": never})
    for reading in standing.readings():
        controller.step(reading, Command(target_ball_angle=3.0))
        report = controller.telemetry
        assert report is not None
        assert report.phase == GaitPhase.STAND
        assert report.reference_ball_angle == 0.0


def test_planner_sees_tilts_and_their_rates(
    stepping: SteppingRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tilt is positive where the trunk's top is back or right; its rate fits."""
    result = stepping.result
    states: list[Array] = []
    plan = FootstepPlanner.plan

    def record(planner: FootstepPlanner, *inputs: Any, **more: Any) -> Plan:
        states.append(np.array(inputs[1]))
        return plan(planner, *inputs, **more)

    monkeypatch.setattr(FootstepPlanner, "plan", record)
    controller = stepping.make_controller({**stepping.settings, "rates": EVERY_TICK})
    tops = []
    for reading in itertools.islice(stepping.readings(), 150):
        controller.step(reading, stepping.command(reading.time))
        assert controller.telemetry is not None
        estimate = controller.telemetry.estimate
        rotation = quaternion_to_rotation(estimate.quaternion_trunk_to_world)
        tops.append(rotation[:2, 2])
    tilts, rates = np.array(states)[:, :, 5], np.array(states)[:, :, 6]
    np.testing.assert_allclose(tilts, -np.array(tops), atol=1e-3)
    # Turning forwards about +y lowers the first, turning right about +x raises
    # the second.
    gyro = result.series.readings.angular_velocity_imu[: len(rates)]
    expected = np.column_stack((-gyro[:, 1], gyro[:, 0]))
    assert np.abs(rates).max(axis=0).min() > 0.03
    np.testing.assert_allclose(rates, expected, atol=0.01)


@pytest.mark.parametrize("side", ["heir", "other"])
def test_foot_lifts_only_if_the_other_one_carries(
    stepping: SteppingRun, side: str
) -> None:
    """Double support lasts as long as the foot that is to stand alone feels no load."""
    result = stepping.result
    swings = result.series.telemetry.phase[result.series.telemetry.phase > 1]
    heir = 0 if GaitPhase(swings[0]) == GaitPhase.LEFT_SUPPORT else 1
    controller = stepping.make_controller(stepping.settings)
    foot = heir if side == "heir" else 1 - heir
    phases = set()
    for reading in stepping.readings():
        if reading.time > 0.1:
            pull = 20.0 + reading.time  # it hangs from its ankle, and is not stuck
            reading.foot_forces[foot] = [0.0, 0.0, pull]
            reading.foot_torques[foot] = 0.0
        if reading.time < 0.4:
            controller.step(reading, stepping.command(reading.time))
            assert controller.telemetry is not None
            phases.add(controller.telemetry.phase)
    assert GaitPhase.DOUBLE in phases
    has_lifted = phases > {GaitPhase.STAND, GaitPhase.DOUBLE}
    assert has_lifted == (side == "other")


def test_telemetry_reports_the_last_step(stepping: SteppingRun) -> None:
    """There is no report before the first step; then it is finite and complete."""
    controller = stepping.make_controller()
    assert isinstance(controller, Controller)
    assert controller.telemetry is None
    reading = next(stepping.readings())
    targets = controller.step(reading, Command())
    report = controller.telemetry
    assert report is not None
    assert report.estimate.time == reading.time
    assert report.phase == GaitPhase.STAND
    assert report.step_count == 0
    assert targets.positions.shape == (18,)
    for record in (report.record, report.estimate.record):
        for name in record.dtype.names:
            if name == "landings":
                assert np.isnan(record[name]).all()  # none while it stands
            elif name != "estimate":
                assert np.isfinite(record[name]).all(), name


def test_settings_table_builds_the_same_controller(stepping: SteppingRun) -> None:
    """What the controller tells of its settings makes a twin of it."""
    controller = stepping.make_controller(
        {"gait": {"lift_m": 0.04}, **stepping.settings}
    )
    table = dict(controller.settings_table)
    twin = stepping.make_controller(table)
    assert twin.settings_table == table
    for tick, reading in enumerate(stepping.readings()):
        command = stepping.command(reading.time)
        one, other = (c.step(reading, command) for c in (controller, twin))
        assert one.positions.tobytes() == other.positions.tobytes()
        if tick == 80:
            break
