"""The promise of ``controls.npz``: nothing but the controls acted on the scene."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.preparation import prepare
from ballsim.recording.recorder import SeriesKeeper
from ballsim.run_files import CONTROLS_FILE, run_with_files
from ballsim.series import RunSeries
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


def _run(folder: Path, is_logged: bool = False) -> RunSeries:
    overrides = [
        "duration_s=3",
        "sensors.gyro.noise_std_rad_s=0.01",
        "seed=11",
        "simulation.control_period_s=0.002",
    ]
    config = load_config("stand", overrides).config
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


def test_controls_of_one_seed_are_the_same_file(tmp_path: Path) -> None:
    """Two runs with one seed leave the same bytes."""
    _run(tmp_path / "one")
    _run(tmp_path / "two")
    one, two = ((tmp_path / run / CONTROLS_FILE).read_bytes() for run in ("one", "two"))
    assert one == two


def test_controls_hold_what_they_should(tmp_path: Path) -> None:
    """One row for each physics step, and the state at the start."""
    series = _run(tmp_path)
    with np.load(tmp_path / CONTROLS_FILE) as controls:
        assert set(controls) == {"time", "ctrl", "qpos0", "qvel0"}
        assert len(controls["ctrl"]) == len(controls["time"]) == 2 * series.n_ticks
        np.testing.assert_array_equal(controls["ctrl"][::2], series.ctrl)
        np.testing.assert_array_equal(controls["qpos0"], series.qpos[0])
