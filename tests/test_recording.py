"""The log: what is drawn is what happened; readable after a kill."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from ballsim.config_io import load_config
from ballsim.preparation import prepare
from ballsim.recording.ball_top import unroll
from ballsim.recording.hull import find_hull
from ballsim.recording.recorder import SeriesKeeper
from ballsim.run_files import run_with_files
from ballsim_controllers.messages import (
    Command,
    GaitPhase,
    JointTargets,
    SensorReading,
    StateEstimate,
    Telemetry,
)

pytest.importorskip("rerun")

FOOT = (
    "/world/robot/trunk/left_hip_yaw_link/left_hip_roll_link/left_thigh/left_shin/"
    "left_ankle"
)
SLOW_RUN = """
import sys
import time
from pathlib import Path
from ballsim.config_io import load_config
from ballsim.preparation import prepare
from ballsim.recording.recorder import SeriesKeeper
from ballsim.recording.video import Film
from ballsim.run_files import run_with_files
from ballsim.simulation import run_prepared
from ballsim_controllers.messages import JointTargets

class Slow:
    telemetry = None
    posture = None
    def step(self, reading, command):
        if self.posture is None:
            self.posture = reading.joint_positions.copy()
        if reading.time > 0.78:
            print("go", flush=True)
            time.sleep(60.0)
        return JointTargets(self.posture)

config = load_config("stand", sys.argv[2:]).config
run_with_files(prepare(config, Slow()), Path(sys.argv[1]))
"""


class _Reporter:
    """Holds the first posture and reports made-up telemetry."""

    def __init__(self) -> None:
        self.posture: np.ndarray | None = None
        self.telemetry: Telemetry | None = None
        self.n = 0

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        if self.posture is None:
            self.posture = reading.joint_positions.copy()
        self.n += 1
        zero = np.zeros(3)
        estimate = StateEstimate.of(
            time=reading.time,
            quaternion_trunk_to_world=np.array([1.0, 0.0, 0.0, 0.0]),
            angular_velocity_trunk_in_trunk=zero,
            position_trunk_in_world=zero,
            linear_velocity_trunk_in_world=zero,
            position_com_in_world=zero,
            linear_velocity_com_in_world=zero,
            position_ball_in_world=zero,
            linear_velocity_ball_in_world=zero,
            angular_velocity_ball_in_world=zero,
            contacts_in_world=np.zeros((2, 3)),
            normal_forces=np.zeros(2),
            cop_in_world=np.zeros(2),
        )
        self.telemetry = Telemetry.of(
            estimate=estimate,
            phase=GaitPhase(self.n // 100 % 4),
            step_count=0,
            ideal_cop=np.array([0.01 * self.n, 0.0]),
            commanded_cop=np.zeros(2),
            target_com=zero,
            target_soles=np.zeros((2, 3)),
            reference_ball_angle=0.5,
            joint_torques=np.zeros(18),
        )
        return JointTargets(self.posture)


def _read(file: Path) -> dict[str, list[tuple[np.ndarray, object]]]:
    """Return times and record batches by entity path."""
    from rerun.chunk import RrdReader

    found: dict[str, list[tuple[np.ndarray, object]]] = {}
    for chunk in RrdReader(file).stream():
        batch = chunk.to_record_batch()
        if "sim_time" not in batch.schema.names:
            continue
        times = batch.column("sim_time").cast("int64").to_numpy()
        found.setdefault(str(chunk.entity_path), []).append((1e-9 * times, batch))
    return found


def _times(found: dict[str, list[tuple[np.ndarray, object]]], path: str) -> np.ndarray:
    return np.sort(np.concatenate([times for times, _ in found[path]]))


def test_log_holds_every_tick(tmp_path: Path) -> None:
    """Fast series have a row per tick, poses one per 20 ms, names as documented."""
    config = load_config(
        "stand", ["duration_s=0.9", "simulation.control_period_s=0.002"]
    ).config
    keeper = SeriesKeeper()
    run_with_files(prepare(config, _Reporter()), tmp_path, recorders=[keeper])
    series = keeper.series
    found = _read(tmp_path / "run.rrd")
    times = _times(found, "/control/cop")
    np.testing.assert_allclose(times, series.time[:-1], atol=1e-8)
    poses = ("/world/ball", "/world/robot/trunk", f"{FOOT}_link/left_foot")
    assert "/world/robot/trunk/head" not in found  # fixed to the trunk
    marks = ("/world/cop", "/world/targets", "/world/com", "/world/contacts")
    for path in (*poses, *marks, "/truth/soles"):
        np.testing.assert_allclose(_times(found, path), series.time[:-1:10], atol=1e-8)
    for path in ("/ball_top/soles", "/ball_top/cop"):
        np.testing.assert_allclose(_times(found, path), series.time[:-1:20], atol=1e-8)
    values = np.concatenate(
        [
            batch.column("Scalars:scalars").flatten().to_numpy(zero_copy_only=False)
            for _, batch in found["/control/cop"]
        ]
    ).reshape(-1, 4)
    order = np.argsort(np.concatenate([t for t, _ in found["/control/cop"]]))
    ideal = 0.01 * np.arange(1, series.n_ticks + 1)
    np.testing.assert_allclose(values[order, 0], ideal, rtol=1e-6)
    assert len(_times(found, "/control/gait_phase")) == 5
    arrows = sum(
        batch.column("Arrows3D:vectors").value_lengths().to_numpy().sum()
        for _, batch in found["/world/contacts"]
    )
    assert arrows == series.contacts.counts[: series.n_ticks : 10].sum()


def test_pushes_are_arrows_that_end_where_they_act(tmp_path: Path) -> None:
    """One for each shown row of a push, its tip above the CoM of the body."""
    overrides = ["duration_s=0.6", "push.0.time_s=0.38", "height=0.3", "direction=2"]
    config = load_config("push", overrides).config
    prepared, keeper = prepare(config, _Reporter()), SeriesKeeper()
    run_with_files(prepared, tmp_path, recorders=[keeper])
    found = _read(tmp_path / "run.rrd")["/world/pushes"]
    ends = []
    for _, batch in found:
        columns = [
            batch.column(f"Arrows3D:{name}").flatten().flatten().to_numpy()
            for name in ("origins", "vectors")
        ]
        ends.append(sum(columns).reshape(-1, 3))
    tips, series = np.concatenate(ends), keeper.series
    assert len(tips) == 5  # 0.1 s, a row each 20 ms
    # Shown in two blocks, and gone when it is over; nothing before.
    times = np.sort(np.concatenate([times for times, _ in found]))
    np.testing.assert_allclose(times, 0.38 + 0.02 * np.arange(6), atol=1e-8)
    model, data = prepared.plant.model, mujoco.MjData(prepared.plant.model)
    for tip, row in zip(tips, range(76, 96, 4), strict=True):
        data.qpos[:] = series.qpos[row]
        mujoco.mj_kinematics(model, data)
        expected = data.xipos[prepared.ids.body_trunk] + [0.0, 0.0, 0.3]
        np.testing.assert_allclose(tip, expected, atol=1e-6)


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
@pytest.mark.parametrize("period", [0.002, 0.004])
def test_log_survives_a_kill(tmp_path: Path, period: float) -> None:
    """A run that is killed leaves a log up to at most 0.5 s before the end.

    The process of the recording holds our end of stderr: it does not stay behind.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    process = subprocess.Popen(
        [
            *(sys.executable, "-c", SLOW_RUN, str(tmp_path / "run")),
            f"simulation.control_period_s={period}",
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"go\n"
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)  # until the recording's process has ended, too
    times = _times(_read(tmp_path / "run" / "run.rrd"), "/truth/cop")
    assert times[-1] > 0.78 - 0.5
    assert (tmp_path / "run" / "config.toml").exists()
    assert not (tmp_path / "run" / "summary.json").exists()


def test_frames_of_the_views_follow_the_ball(tmp_path: Path) -> None:
    """The origins of the 3-D views hang on a frame that stays in the ball's centre."""
    config = load_config(
        "stand", ["duration_s=0.4", "simulation.control_period_s=0.002"]
    ).config
    run_with_files(prepare(config, _Reporter()), tmp_path)
    found = _read(tmp_path / "run.rrd")
    ball = _places(found, "/world/ball")
    assert np.ptp(ball[:, 0]) > 1e-4
    np.testing.assert_array_equal(_places(found, "/world/follow"), ball)


def _places(found: dict[str, list[tuple[np.ndarray, object]]], path: str) -> np.ndarray:
    column = "Transform3D:translation"
    rows = [batch.column(column).flatten().flatten() for _, batch in found[path]]
    return np.concatenate([row.to_numpy() for row in rows]).reshape(-1, 3)


def test_links_hang_on_one_another(tmp_path: Path) -> None:
    """Poses relative to the parents, chained, are the poses that MuJoCo computes."""
    config = load_config("step", ["duration_s=1.0"]).config
    prepared, keeper = prepare(config), SeriesKeeper()
    run_with_files(prepared, tmp_path, recorders=[keeper])
    found = _read(tmp_path / "run.rrd")
    model = prepared.plant.model
    data, series = mujoco.MjData(model), keeper.series
    path = "/world/robot"
    names = "trunk left_hip_yaw_link left_hip_roll_link left_thigh left_shin"
    places, turns = np.zeros((50, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (50, 1))
    for name in names.split():
        path += f"/{name}"
        rows = [
            batch.column("Transform3D:quaternion").flatten().flatten()
            for _, batch in found[path]
        ]
        inner = np.concatenate([row.to_numpy() for row in rows]).reshape(-1, 4)
        offsets = _places(found, path).astype(np.float64)
        for i in range(50):
            moved = np.zeros(3)
            mujoco.mju_rotVecQuat(moved, offsets[i], turns[i])
            places[i] += moved
            turned = np.zeros(4)
            mujoco.mju_mulQuat(turned, turns[i], np.roll(inner[i], 1).astype(float))
            turns[i] = turned
    for i, row in enumerate(range(0, 200, 4)):
        data.qpos[:] = series.qpos[row]
        mujoco.mj_kinematics(model, data)
        shin = model.body("left_shin").id
        np.testing.assert_allclose(places[i], data.xpos[shin], atol=1e-6)
        assert abs(turns[i] @ data.xquat[shin]) == pytest.approx(1.0, abs=1e-6)


def test_cop_is_shown_within_the_support(tmp_path: Path) -> None:
    """Unrolled, the actual CoP lies within the hull of the soles that carry."""
    config = load_config("step", ["duration_s=3.0"]).config
    run_with_files(prepare(config), tmp_path)
    found = _read(tmp_path / "run.rrd")
    n_checked = 0
    for _, batch in found["/ball_top/cop"]:
        cops = batch.column("Points2D:positions").to_pylist()
        (strips,) = [
            other.column("LineStrips2D:strips").to_pylist()
            for times, other in found["/ball_top/soles"]
            if len(other) == len(batch) and times[0] == _[0]
        ]
        for cop, (hull, *_soles) in zip(cops, strips, strict=True):
            edges = np.diff(np.array(hull), axis=0)
            to_cop = np.array(cop[3]) - np.array(hull)[:-1]
            sides = edges[:, 0] * to_cop[:, 1] - edges[:, 1] * to_cop[:, 0]
            assert (sides >= -5.0).all() or (sides <= 5.0).all()
            n_checked += 1
    assert n_checked == 75


def test_hull_is_that_of_another_library() -> None:
    """The same corners and area as Qhull finds."""
    generator = np.random.default_rng(1)
    for n in (3, 4, 8, 40):
        points = generator.normal(size=(n, 2))
        hull = find_hull(points)
        expected = ConvexHull(points)
        np.testing.assert_array_equal(hull[0], hull[-1])
        corners = {tuple(point) for point in hull}
        assert corners == {tuple(point) for point in points[expected.vertices]}
        x, y = hull.T
        area = 0.5 * (x[:-1] * y[1:] - x[1:] * y[:-1]).sum()
        assert area == pytest.approx(expected.volume)
    assert find_hull(np.empty((0, 2))).shape == (0, 2)


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.25, 1.0])
def test_a_minute_takes_under_ten_megabytes(tmp_path: Path, radius: float) -> None:
    """Nobody hesitates to keep a recording: 10 MB a simulated minute at most."""
    overrides = ["duration_s=60", f"ball.radius_m={radius}"]
    config = load_config("constant-velocity", overrides).config
    finished = run_with_files(prepare(config), tmp_path)
    assert finished.summary["survived"]
    assert (tmp_path / "run.rrd").stat().st_size < 10e6


def test_unrolled_lengths_are_arcs() -> None:
    """A point at some angle from the top is as far from it as the arc is long."""
    angle = np.array([0.0, 0.1, 0.5])
    offsets = np.column_stack([0.5 * np.sin(angle), np.zeros(3)])
    shown = unroll(offsets, 0.5)
    np.testing.assert_allclose(shown[:, 1], -1e3 * 0.5 * angle, atol=1e-9)
    np.testing.assert_allclose(shown[:, 0], 0.0)
    assert np.isnan(unroll(np.full((1, 2), np.nan), 0.5)).all()


def test_footprints_stay_where_the_foot_landed(tmp_path: Path) -> None:
    """One for each step, below the sole, where the plan wanted it a tick before."""
    heading = "command.timeline.0.heading_rad=0.6"
    config = load_config("step", ["duration_s=6.0", heading]).config
    finished = run_with_files(prepare(config), tmp_path)
    found, n_prints = _read(tmp_path / "run.rrd"), 0
    for side in ("left", "right"):
        for _, batch in found[f"/world/ball/footsteps/{side}/actual"]:
            for strips in batch.column("LineStrips3D:strips").to_pylist():
                n_prints += 1
                middle = np.mean(strips[-1][:4], axis=0)
                assert np.linalg.norm(middle) == pytest.approx(0.5, abs=0.01)
        planned = [
            (time, points[-1])
            for times, batch in found[f"/world/ball/footsteps/{side}/planned"]
            for time, points in zip(
                times, batch.column("Points3D:positions").to_pylist(), strict=True
            )
        ]
        landed = [
            (time, np.mean(strips[-1][:4], axis=0))
            for times, batch in found[f"/world/ball/footsteps/{side}/actual"]
            for time, strips in zip(
                times, batch.column("LineStrips3D:strips").to_pylist(), strict=True
            )
        ]
        assert [time for time, _ in planned] == [time for time, _ in landed]
        apart = [
            np.linalg.norm(np.subtract(point, middle))
            for (_, point), (_, middle) in zip(planned, landed, strict=True)
        ]
        assert max(apart) < 0.04
    assert n_prints == finished.summary["step_count"] > 4


def test_landings_are_shown_while_they_are_planned(tmp_path: Path) -> None:
    """Nothing lands while the robot stands; a swinging sole ends there, or nearly."""
    config = load_config("step", ["duration_s=3.0"]).config
    keeper = SeriesKeeper()
    run_with_files(prepare(config), tmp_path, recorders=[keeper])
    telemetry, found = keeper.series.telemetry, _read(tmp_path / "run.rrd")
    is_told = np.isfinite(telemetry.landings).all(axis=2)
    is_stepping = telemetry.phase != GaitPhase.STAND
    np.testing.assert_array_equal(is_told.any(axis=1), is_stepping)
    assert is_stepping.any()
    assert not is_stepping.all()
    for foot, side in enumerate(("left", "right")):
        shown = np.concatenate(
            [
                batch.column("LineStrips2D:strips").value_lengths().to_numpy()
                for _, batch in found[f"/ball_top/landings/{side}"]
            ]
        )
        np.testing.assert_array_equal(shown, is_told[::8, foot])
    swing = (telemetry.phase == GaitPhase.LEFT_SUPPORT).astype(int)
    touchdowns = np.flatnonzero(np.diff(swing) < 0)
    assert touchdowns.size > 0
    for row in touchdowns:
        centre = telemetry.position_ball_in_world[row, :2]
        sole = telemetry.target_soles[row, 1, :2] - centre
        np.testing.assert_allclose(sole, telemetry.landings[row, 1], atol=0.04)
