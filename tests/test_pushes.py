"""Pushes: what acts when, where and in which direction."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.errors import ConfigError
from ballsim.plant_config import PushConfig
from ballsim.preparation import PreparedRun, prepare
from ballsim.pushes import PushSchedule, draw_push_times
from ballsim.simulation import run_prepared
from ballsim_controllers.messages import JointTargets, SensorReading

YAW = 0.7


class _Hold:
    telemetry = None

    def __init__(self) -> None:
        self.posture: np.ndarray | None = None

    def step(self, reading: SensorReading, command: object) -> JointTargets:
        if self.posture is None:
            self.posture = reading.joint_positions.copy()
        return JointTargets(self.posture)


def _prepare(*overrides: str) -> PreparedRun:
    return prepare(load_config("push", overrides).config, _Hold())


def _schedule(*pushes: PushConfig) -> tuple[PreparedRun, PushSchedule]:
    run = _prepare()
    world = type(run.world)(run.world.origin, YAW)
    model = run.plant.model
    return run, PushSchedule(model, run.ids, world, pushes, 0.005)


def test_push_acts_for_its_time() -> None:
    """It acts from its time on, to the tick, and never before or after."""
    _, schedule = _schedule(PushConfig(time=0.03, duration=0.02, force=40.0))
    acting = [bool(schedule.at(tick).any()) for tick in range(20)]
    assert [tick for tick, is_acting in enumerate(acting) if is_acting] == [6, 7, 8, 9]


@pytest.mark.parametrize("direction", [0.0, math.pi / 2.0, -2.0])
def test_direction_is_that_of_the_heading(direction: float) -> None:
    """0 is forwards, pi/2 to the left of the robot, wherever it looks."""
    push = PushConfig(time=0.0, direction=direction, force=30.0, height=0.2)
    run, schedule = _schedule(push)
    wrenches = schedule.at(0)
    angle = YAW + direction
    force = 30.0 * np.array([math.cos(angle), math.sin(angle), 0.0])
    np.testing.assert_allclose(wrenches[run.ids.body_trunk, :3], force, atol=1e-12)
    torque = np.cross([0.0, 0.0, 0.2], force)
    np.testing.assert_allclose(wrenches[run.ids.body_trunk, 3:], torque, atol=1e-12)
    assert not np.delete(wrenches, run.ids.body_trunk, axis=0).any()


def test_pushes_add_up() -> None:
    """Two at a time act both; on different bodies, each on its own."""
    first = PushConfig(time=0.0, duration=0.02, force=10.0)
    second = PushConfig(time=0.01, duration=0.02, force=5.0)
    ball = PushConfig(time=0.01, duration=0.01, force=3.0, body="ball")
    run, schedule = _schedule(first, second, ball)
    ticks = [schedule.at(tick).copy() for tick in range(7)]
    on = [
        [round(float(np.linalg.norm(w[body, :3])), 9) for w in ticks]
        for body in (run.ids.body_trunk, run.ids.body_ball)
    ]
    assert on == [[10, 10, 15, 15, 5, 5, 0], [0, 0, 3, 3, 0, 0, 0]]


@pytest.mark.parametrize("body", ["pelvis", "world"])
def test_unknown_body_is_refused(body: str) -> None:
    """The message lists what can be pushed."""
    with pytest.raises(ConfigError) as caught:
        _prepare(f"body={body}")
    assert caught.value.key == "push.0.body"
    assert "trunk" in caught.value.valid
    assert "ball" in caught.value.valid


def test_seed_draws_the_time_of_a_push() -> None:
    """Within the spread, at a tick, by the seed alone and evenly; then it is kept."""
    push = PushConfig(time=2.0, time_spread=0.5, force=10.0)
    times = [draw_push_times([push], seed, 0.005)[0].time for seed in range(400)]
    assert max(len(str(time)) for time in times) == len(
        "2.005"
    )  # no 2.0050000000000003
    ticks = np.array(times) / 0.005
    np.testing.assert_allclose(ticks, ticks.round(), atol=1e-9)
    assert min(times) >= 2.0
    assert max(times) <= 2.5 + 1e-9
    assert np.mean(times) == pytest.approx(2.25, abs=4.0 * 0.5 / math.sqrt(12 * 400))
    first = draw_push_times([push, push], 7, 0.005)
    assert first[0].time != first[1].time
    assert draw_push_times(first, 8, 0.005) == first
    run = prepare(load_config("push-stepping", ["seed=7"]).config, _Hold())
    assert 6.0 < run.config.pushes[0].time <= 6.68
    assert run.config.pushes[0].time_spread == 0.0


def test_push_moves_what_it_acts_on() -> None:
    """A push changes nothing before its time, and then moves the ball forwards."""
    still, pushed = (
        run_prepared(
            _prepare("duration_s=0.05", "push.0.time_s=0.02", "body=ball", force)
        )
        for force in ("force=0", "force=100")
    )
    n, ids = 4, pushed.ids
    assert (still.series.qpos[: n + 1] == pushed.series.qpos[: n + 1]).all()
    gained = (pushed.series.qvel - still.series.qvel)[n + 1, ids.qvel_ball][:3]
    forwards = pushed.world.rotate_vectors_to_robot(gained)
    # Rolling on the floor, a ball alone is heavier by I / r^2; the soles drag on it.
    alone = 100.0 * 0.005 / (40.0 + 0.5 / 0.5**2)
    assert 0.5 * alone < forwards[0] < alone
    assert abs(forwards[1]) < 0.05 * alone


def test_wrenches_are_kept_with_the_rows() -> None:
    """A run that pushes has a row of wrenches for each tick, others have none."""
    run = _prepare("duration_s=1", "push.0.time_s=0.395", "push.0.duration_s=0.02")
    series = run_prepared(run).series
    assert series.wrenches is not None
    assert len(series.wrenches) == series.n_ticks
    is_pushed = series.wrenches.any(axis=(1, 2))
    np.testing.assert_array_equal(np.flatnonzero(is_pushed), [79, 80, 81, 82])
    other = run_prepared(
        prepare(load_config("stand", ["duration_s=0.1"]).config, _Hold())
    )
    assert other.series.wrenches is None
