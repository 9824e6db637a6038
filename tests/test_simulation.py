"""The loop: determinism, rates, falls, truth in the robot's world."""

from __future__ import annotations

import dataclasses
import itertools
import math
import weakref

import mujoco
import numpy as np
import pytest

from ballsim.config import CommandConfig, CommandPoint, Config, InitialConfig
from ballsim.config_io import load_config
from ballsim.errors import ConfigError, PhysicsError
from ballsim.preparation import draw_perturbation, prepare
from ballsim.recording.recorder import RunBlock, RunContext, SeriesKeeper
from ballsim.series import RunSeries
from ballsim.simulation import KeptRun, run_prepared, simulate
from ballsim.truth import compute_contact_truth, compute_state_truth
from ballsim.world_frame import RobotWorld
from ballsim_controllers.messages import Command, JointTargets, SensorReading


class _Hold:
    """Holds the first posture; falls after about a second."""

    telemetry = None

    def __init__(self) -> None:
        self.posture: np.ndarray | None = None
        self.readings: list[SensorReading] = []
        self.commands: list[Command] = []

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        if self.posture is None:
            self.posture = reading.joint_positions.copy()
        self.readings.append(reading)
        self.commands.append(command)
        return JointTargets(self.posture)


def _config(*overrides: str) -> Config:
    return load_config(
        "stand", ["duration_s=0.4", "simulation.control_period_s=0.002", *overrides]
    ).config


def _run(*overrides: str) -> KeptRun:
    return run_prepared(prepare(_config(*overrides), _Hold()))


def test_same_seed_gives_the_same_bits() -> None:
    """The seed decides the whole trajectory; another seed gives another one."""
    noisy = "sensors.encoder.noise_std_rad=0.001"
    one, two, other = (_run(noisy, f"seed={seed}") for seed in (3, 3, 4))
    assert one.series.qpos.tobytes() == two.series.qpos.tobytes()
    assert one.series.ctrl.tobytes() == two.series.ctrl.tobytes()
    assert one.series.qpos.tobytes() != other.series.qpos.tobytes()


def test_start_is_drawn_within_its_bounds() -> None:
    """Direction and size of the perturbation vary with the seed, within bounds."""
    config = InitialConfig(max_lean=0.02, max_ball_offset=0.01, max_yaw=0.1)
    starts = [draw_perturbation(config, seed) for seed in range(200)]
    leans = np.array([math.hypot(*start.lean) for start in starts])
    offsets = np.array([math.hypot(*start.ball_offset) for start in starts])
    yaws = np.array([start.yaw for start in starts])
    for values, bound in ((leans, 0.02), (offsets, 0.01), (abs(yaws), 0.1)):
        assert values.max() <= bound
        assert values.max() > 0.9 * bound
        assert values.min() < 0.1 * bound
    angles = np.array([math.atan2(*start.lean) for start in starts])
    assert np.histogram(angles, 4, (-math.pi, math.pi))[0].min() > 25
    still = draw_perturbation(InitialConfig(0.0, 0.0, 0.0), 1)
    assert still.lean == still.ball_offset == (0.0, 0.0)


def test_controller_gets_one_reading_per_period() -> None:
    """Readings come every control period; the sensors lag by one physics step."""
    hold = _Hold()
    prepared = prepare(_config(), hold)
    result = run_prepared(prepared)
    times = np.array([reading.time for reading in hold.readings])
    np.testing.assert_allclose(times, 0.002 * np.arange(200), atol=1e-12)
    ids, n = prepared.ids, result.series.n_ticks
    data = mujoco.MjData(result.model)
    for tick in (50, 150):
        data.qpos[:], data.qvel[:] = result.series.qpos[tick], result.series.qvel[tick]
        data.ctrl[:] = result.series.ctrl[tick]
        mujoco.mj_step(result.model, data)
        older = data.qpos[ids.qpos_joints]  # 1 ms after the tick = 1 ms before the next
        reading = hold.readings[tick + 1].joint_positions
        np.testing.assert_allclose(reading, older, atol=1e-6)
    assert n == 200
    assert len(result.series.time) == n + 1


def test_sensors_are_alive() -> None:
    """No sensor value stays constant, all are finite."""
    series = _run().series
    readings = series.readings.rows[: series.n_ticks]
    for name in readings.dtype.names:
        rows = readings[name].reshape(series.n_ticks, -1)
        assert np.isfinite(rows).all(), name
        assert (rows.std(axis=0) > 0.0).all(), name


def test_commands_are_given_at_their_times() -> None:
    """Each command holds from its time until the next."""
    timeline = (CommandPoint(0.1, 2.0, True), CommandPoint(0.2, -1.0, False))
    config = dataclasses.replace(_config(), command=CommandConfig(timeline))
    hold = _Hold()
    result = run_prepared(prepare(config, hold))
    assert hold.commands[49] == Command()
    assert hold.commands[50] == Command(2.0, True)
    assert hold.commands[99] == Command(2.0, True)
    assert hold.commands[100] == Command(-1.0, False)
    assert result.series.target_ball_angles[[49, 50, 100]].tolist() == [0.0, 2.0, -1.0]


def test_posture_without_balance_falls() -> None:
    """A stiff posture falls off the ball; the run ends there and says why."""
    result = _run("duration_s=5")
    assert not result.is_upright
    assert result.fall_reason is not None
    assert result.fall_time == pytest.approx(result.simulated_time)
    assert result.simulated_time < 3.0


@pytest.mark.parametrize(
    ("override", "reason"),
    [
        ("simulation.fall_tilt_rad=0.05", "the trunk leans more than 0.05 rad"),
        ("simulation.fall_height_ratio=0.99", "the CoM is less than"),
    ],
)
def test_fall_has_its_reason(override: str, reason: str) -> None:
    """The threshold that is crossed is named."""
    result = _run("duration_s=5", "initial.max_lean_rad=0", override)
    assert result.fall_reason is not None
    assert reason in result.fall_reason


def test_forbidden_contact_is_a_fall() -> None:
    """A part that touches the floor is named, whatever its height."""
    lax = ("simulation.fall_tilt_rad=3.2", "simulation.fall_height_ratio=0")
    result = _run("duration_s=10", *lax)
    assert result.fall_reason is not None
    assert " touches " in result.fall_reason


def test_recorder_gets_every_row_once() -> None:
    """Recorded rows follow one another without gap; the recorder is closed."""
    blocks: list[RunSeries] = []
    events: list[str] = []

    class Watcher:
        def start(self, context: RunContext) -> None:
            events.append("start")

        def record(self, block: RunBlock) -> None:
            blocks.append(block.series)

        def close(self) -> None:
            events.append("close")

    progress: list[tuple[int, int]] = []
    prepared = prepare(_config("duration_s=0.9"), _Hold())
    result = run_prepared(prepared, Watcher(), lambda *ticks: progress.append(ticks))
    assert [block.n_ticks for block in blocks] == [200, 200, 50]
    assert [len(b.readings.rows) for b in blocks] == [b.n_ticks for b in blocks]
    for before, after in itertools.pairwise(blocks):
        assert after.first_tick == before.first_tick + before.n_ticks
        assert after.qpos[0].tobytes() == before.qpos[-1].tobytes()
    assert events == ["start", "close"]
    assert progress[-1] == (result.series.n_ticks, result.config.n_ticks)


def test_loop_forgets_blocks_that_nobody_keeps() -> None:
    """However long a run is, only the rows of the dump after a failure live on."""
    blocks: list[weakref.ref[RunSeries]] = []

    class Watcher:
        most_alive = 0

        def start(self, context: RunContext) -> None:
            pass

        def record(self, block: RunBlock) -> None:
            blocks.append(weakref.ref(block.series))
            n_alive = sum(ref() is not None for ref in blocks)
            self.most_alive = max(self.most_alive, n_alive)

        def close(self) -> None:
            pass

    watcher = Watcher()
    config = load_config("stand", ["duration_s=6"]).config
    outcome = simulate(prepare(config), [watcher])
    assert outcome.n_ticks == config.n_ticks
    assert len(blocks) == 15
    assert watcher.most_alive <= 9


def test_series_of_a_run_is_its_blocks_one_after_the_other() -> None:
    """Nothing is lost or moved where blocks meet."""
    blocks: list[RunSeries] = []

    class Watcher(SeriesKeeper):
        def record(self, block: RunBlock) -> None:
            super().record(block)
            blocks.append(block.series)

    series = run_prepared(prepare(_config("duration_s=0.9"), _Hold()), Watcher()).series
    assert len(blocks) == 3
    for name in ("ctrl", "actuator_forces", "ball_positions", "target_ball_angles"):
        parts = [getattr(block, name) for block in blocks]
        np.testing.assert_array_equal(getattr(series, name), np.concatenate(parts))
    for name in ("time", "qpos", "qvel"):
        parts = [getattr(block, name)[:-1] for block in blocks]
        parts.append(getattr(blocks[-1], name)[-1:])
        np.testing.assert_array_equal(getattr(series, name), np.concatenate(parts))
    assert (np.diff(series.time) > 0.0).all()
    contacts = series.contacts
    assert contacts.counts.sum() == contacts.n_contacts == len(contacts.geoms)
    forces = np.concatenate([block.contacts.compute_forces() for block in blocks])
    np.testing.assert_array_equal(contacts.compute_forces(), forces)
    assert len(series.readings.rows) == len(series.telemetry.rows) == series.n_ticks


def test_failed_physics_carries_the_last_states() -> None:
    """What led to a failure is kept."""

    class Mad(_Hold):
        def step(self, reading: SensorReading, command: Command) -> JointTargets:
            targets = super().step(reading, command)
            is_late = reading.time > 0.1
            return JointTargets(targets.positions * (np.nan if is_late else 1.0))

    with pytest.raises(PhysicsError) as caught:
        run_prepared(prepare(_config(), Mad()))
    states = caught.value.last_states
    assert states["qpos"].shape[0] == states["time"].shape[0] > 50
    assert np.isfinite(states["qpos"]).all()


def test_unknown_controller_and_robot_are_bad_input() -> None:
    """Names that do not exist are answered with those that do."""
    with pytest.raises(ConfigError, match=r"controller\.name = 'none'"):
        prepare(_config("controller.name=none"))
    with pytest.raises(ConfigError, match="biped"):
        prepare(_config("robot.name=nobody"), _Hold())


def test_robots_world_starts_at_the_ball_along_the_heading() -> None:
    """In its own world the robot starts with heading 0, the ball at the origin."""
    result = _run("initial.max_yaw_rad=3", "seed=2", "initial.max_lean_rad=0")
    series, ids, world = result.series, result.ids, result.world
    assert abs(world.yaw) > 0.2
    truth = compute_state_truth(result.model, ids, world, series.qpos, series.qvel)
    x, y, _ = truth.position_ball_in_world[0]
    assert [x, y] == pytest.approx([0.0, 0.0], abs=1e-12)
    w, i, j, k = truth.quaternion_trunk_to_world[0]
    assert math.atan2(2 * (i * j + w * k), 1 - 2 * (j * j + k * k)) == pytest.approx(
        0.0
    )
    points = np.random.default_rng(0).normal(size=(4, 3))
    there = world.transform_points_to_true(world.transform_points_to_robot(points))
    np.testing.assert_allclose(there, points)


def test_attitudes_turn_with_the_world() -> None:
    """An attitude in the robot's world maps vectors into the robot's world."""
    world = RobotWorld(np.array([1.0, 2.0, 0.0]), 0.7)
    quaternions = np.random.default_rng(0).normal(size=(5, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    turned = world.rotate_quaternions_to_robot(quaternions)
    vector, true, robot = np.array([0.3, -1.0, 2.0]), np.zeros(3), np.zeros(3)
    for before, after in zip(quaternions, turned, strict=True):
        mujoco.mju_rotVecQuat(true, vector, before)
        mujoco.mju_rotVecQuat(robot, vector, after)
        np.testing.assert_allclose(robot, world.rotate_vectors_to_robot(true))


def test_heading_does_not_change_the_course() -> None:
    """Turning the start turns the whole run: in the robot's world nothing changes."""

    def course(yaw: float) -> np.ndarray:
        start = ("initial.max_lean_rad=0", "initial.max_ball_offset_m=0")
        result = _run(*start, f"initial.max_yaw_rad={yaw}", "seed=2")
        series = result.series
        truth = compute_state_truth(
            result.model, result.ids, result.world, series.qpos, series.qvel
        )
        return np.hstack(
            [
                truth.position_ball_in_world,
                truth.position_com_in_world,
                truth.angular_velocity_ball_in_world,
                truth.linear_velocity_com_in_world,
                np.vstack([np.zeros(3), series.readings.angular_velocity_ball]),
            ]
        )

    np.testing.assert_allclose(course(0.0)[:100], course(3.0)[:100], atol=2e-3)


def test_truth_is_consistent() -> None:
    """Velocities are the derivatives of positions; the ball does not slip."""
    result = _run()
    series = result.series
    truth = compute_state_truth(
        result.model, result.ids, result.world, series.qpos, series.qvel
    )
    for position, velocity in (
        (truth.position_com_in_world, truth.linear_velocity_com_in_world),
        (truth.position_ball_in_world, truth.linear_velocity_ball_in_world),
    ):
        slope = (position[2:] - position[:-2]) / 0.004
        np.testing.assert_allclose(slope, velocity[1:-1], atol=5e-3)
    rolling = 0.5 * np.cross(truth.angular_velocity_ball_in_world, [0.0, 0.0, 1.0])
    slip = (rolling - truth.linear_velocity_ball_in_world)[:, :2]
    assert np.abs(slip).max() < 2e-3


def test_contact_forces_carry_the_robot() -> None:
    """Floor and feet forces point upwards and add up to the momentum's change."""
    result = _run()
    series, ids = result.series, result.ids
    contact = compute_contact_truth(ids, result.world, series)
    assert np.abs(contact.cop_to_ball_in_world).max() < 0.2
    contacts, n = series.contacts, series.n_ticks
    moment, total = np.zeros(3), 0.0  # the first tick's CoP, contact by contact
    for i in range(contacts.counts[0]):
        if set(contacts.geoms[i]) & set(ids.geom_soles):
            force = contacts.normal_forces[i]
            moment += force * (contacts.positions[i] - series.ball_positions[0])
            total += force
    cop = result.world.rotate_vectors_to_robot(moment / total)[:2]
    np.testing.assert_allclose(contact.cop_to_ball_in_world[0], cop)
    assert contact.normal_forces[0].sum() == pytest.approx(total)
    is_floor = (contacts.geoms == ids.geom_floor).any(axis=1)
    forces = contacts.compute_forces()
    sign = np.where(contacts.geoms[:, 0] == ids.geom_ball, -1.0, 1.0)
    tick = np.repeat(np.arange(n), contacts.counts[:n])
    on_floor = np.bincount(tick[is_floor], (sign * forces[:, 2])[is_floor], n)
    mass = float(result.model.body_mass.sum())
    truth = compute_state_truth(
        result.model, ids, result.world, series.qpos, series.qvel
    )
    momentum = 65.0 * truth.linear_velocity_com_in_world[:, 2]
    momentum += 40.0 * truth.linear_velocity_ball_in_world[:, 2]
    assert mass == pytest.approx(105.0, rel=1e-3)
    impulse = 0.002 * (on_floor - mass * 9.81)
    change = np.diff(momentum)
    assert np.sum(impulse[20:]) == pytest.approx(np.sum(change[20:]), abs=2.0)
