"""The promise of ``controls.npz``: nothing but the controls acted on the scene."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.controls_file import ControlsRecorder
from ballsim.errors import PhysicsError
from ballsim.preparation import prepare
from ballsim.recording.recorder import RunBlock, SeriesKeeper
from ballsim.run_files import CONTROLS_FILE, run_with_files
from ballsim.series import RunSeries
from ballsim.simulation import simulate
from ballsim_controllers.messages import Command, JointTargets, SensorReading

PLAIN_MUJOCO = """
import sys
import mujoco
import numpy as np

folder = sys.argv[1]
model = mujoco.MjModel.from_xml_path(folder + "/scene.xml")
data = mujoco.MjData(model)
controls = np.load(folder + "/controls.npz")
data.qpos[:], data.qvel[:] = controls["qpos0"], controls["qvel0"]
states = [data.qpos.copy()]
for i in range(len(controls["ctrl"])):
    assert abs(data.time - controls["time"][i]) < 1e-9
    data.ctrl[:] = controls["ctrl"][i]
    if "xfrc_applied" in controls:
        data.xfrc_applied[:] = controls["xfrc_applied"][i]
    mujoco.mj_step(model, data)
    states.append(data.qpos.copy())
np.save(folder + "/plain.npy", states)
assert not any(name.startswith("ballsim") for name in sys.modules)
"""


class _Sway:
    """Holds the first posture and sways the arms, so that controls change."""

    telemetry = None

    def __init__(self) -> None:
        self.posture: np.ndarray | None = None

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        if self.posture is None:
            self.posture = reading.joint_positions.copy()
        sway = 0.1 * np.sin(9.0 * reading.time) + reading.acceleration_imu[0] * 1e-3
        return JointTargets(self.posture + sway * (np.arange(18) > 11))


DISTURBED = (
    "drives.delay_s=0.003",
    "sensors.delay_s=0.004",
    "sensors.preset=mid",
    "robot.mass_scale=1.1",
    "robot.com_offset_x_m=0.005",
    "push.0.time_s=0.1",
    "force=50",
    "direction=1",
)


def _run(
    folder: Path,
    is_logged: bool = False,
    scenario: str = "stand",
    more: tuple[str, ...] = (),
) -> RunSeries:
    overrides = [
        "duration_s=3",
        "sensors.gyro.noise_std_rad_s=0.01",
        "seed=11",
        "simulation.control_period_s=0.002",
        *more,
    ]
    config = load_config(scenario, overrides).config
    keeper = SeriesKeeper()
    run_with_files(prepare(config, _Sway()), folder, is_logged, recorders=[keeper])
    return keeper.series


@pytest.mark.parametrize("is_logged", [False, True])
def test_plain_mujoco_gives_the_same_bits(tmp_path: Path, is_logged: bool) -> None:
    """Plain MuJoCo on the files of a run repeats it bit for bit, log or no log."""
    recorded = _run(tmp_path, is_logged).qpos
    arguments = [sys.executable, "-c", PLAIN_MUJOCO, str(tmp_path)]
    subprocess.run(arguments, check=True, cwd=tmp_path, timeout=60)
    plain = np.load(tmp_path / "plain.npy")
    assert len(recorded) > 400
    assert plain[::2].tobytes() == np.ascontiguousarray(recorded).tobytes()


def test_plain_mujoco_repeats_delays_model_errors_and_pushes(tmp_path: Path) -> None:
    """What acts late or from outside stands in the files as it acted."""
    recorded = _run(tmp_path, scenario="push", more=DISTURBED).qpos
    arguments = [sys.executable, "-c", PLAIN_MUJOCO, str(tmp_path)]
    subprocess.run(arguments, check=True, cwd=tmp_path, timeout=60)
    plain = np.load(tmp_path / "plain.npy")
    assert len(recorded) > 100
    assert plain[::2].tobytes() == np.ascontiguousarray(recorded).tobytes()
    with np.load(tmp_path / CONTROLS_FILE) as controls:
        is_pushed = controls["xfrc_applied"].any(axis=(1, 2))
        np.testing.assert_array_equal(np.flatnonzero(is_pushed), np.arange(100, 200))
        assert (controls["ctrl"][:4] == controls["ctrl"][0]).all()
        assert (controls["ctrl"][5] != controls["ctrl"][4]).any()


def test_controls_of_one_seed_are_the_same_file(tmp_path: Path) -> None:
    """Two runs with one seed leave the same bytes."""
    _run(tmp_path / "one")
    _run(tmp_path / "two")
    one, two = ((tmp_path / run / CONTROLS_FILE).read_bytes() for run in ("one", "two"))
    assert one == two


def test_controls_are_read_and_written_in_pieces(tmp_path: Path) -> None:
    """Wrenches included, the archive is what NumPy would write in one go."""
    config = load_config("stand", ["duration_s=0.9"]).config
    prepared = prepare(config, _Sway())
    n_bodies = prepared.plant.model.nbody

    class Pushed(ControlsRecorder):
        def record(self, block: RunBlock) -> None:
            shape = (block.series.n_ticks, n_bodies, 6)
            start = block.series.first_tick
            block.series.wrenches = start + np.arange(np.prod(shape)).reshape(shape)
            super().record(block)

    recorder, keeper = Pushed(tmp_path), SeriesKeeper()
    simulate(prepared, [recorder, keeper])
    with open(tmp_path / "some.npz", "wb") as file:
        recorder.write(file)
    assert [path.name for path in tmp_path.iterdir()] == ["some.npz"]
    series, n = keeper.series, config.n_substeps
    assert series.wrenches is not None
    n = config.n_substeps
    expected = {
        "time": config.scene.timestep * np.arange(n * series.n_ticks),
        "ctrl": np.repeat(series.ctrl - prepared.sensors.encoder_zeros, n, axis=0),
        "xfrc_applied": np.repeat(series.wrenches, n, axis=0),
        "qpos0": series.qpos[0],
        "qvel0": series.qvel[0],
    }
    with np.load(tmp_path / "some.npz") as controls:
        assert set(controls) == set(expected)
        for name, values in expected.items():
            np.testing.assert_array_equal(controls[name], values, err_msg=name)


@pytest.mark.parametrize("time", [0.0, 0.4, 0.6])
def test_failed_run_leaves_no_half_written_file(tmp_path: Path, time: float) -> None:
    """After failed physics: what was asked for, and what led to the failure."""

    class Mad(_Sway):
        def step(self, reading: SensorReading, command: Command) -> JointTargets:
            targets = super().step(reading, command)
            is_late = reading.time > time - 1e-9
            return JointTargets(targets.positions * (np.nan if is_late else 1.0))

    prepared = prepare(load_config("stand", ["duration_s=1"]).config, Mad())
    with pytest.raises(PhysicsError, match="targets are not finite"):
        run_with_files(prepared, tmp_path, is_logged=True)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"config.toml", "scene.xml", "last_states.npz", "run.rrd"}
    with np.load(tmp_path / "last_states.npz") as states:
        assert states["time"][-1] == pytest.approx(time)


def test_controls_hold_what_they_should(tmp_path: Path) -> None:
    """One row for each physics step, and the state at the start."""
    series = _run(tmp_path)
    with np.load(tmp_path / CONTROLS_FILE) as controls:
        assert set(controls) == {"time", "ctrl", "qpos0", "qvel0"}
        assert len(controls["ctrl"]) == len(controls["time"]) == 2 * series.n_ticks
        np.testing.assert_array_equal(controls["ctrl"][::2], series.ctrl)
        np.testing.assert_array_equal(controls["qpos0"], series.qpos[0])
