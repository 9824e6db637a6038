"""The film of a run, and its frames."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ballsim.config_io import load_config
from ballsim.preparation import prepare
from ballsim.recording.film_frame import _find_states
from ballsim.recording.recorder import SeriesKeeper
from ballsim.recording.video import Film
from ballsim.run_files import run_with_files
from ballsim.simulation import run_prepared
from ballsim_controllers.messages import Command, JointTargets, SensorReading


class _Hold:
    """Holds the first posture."""

    telemetry = None

    def __init__(self) -> None:
        self.posture: np.ndarray | None = None

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        if self.posture is None:
            self.posture = reading.joint_positions.copy()
        return JointTargets(self.posture)


def test_film_has_thirty_frames_a_second() -> None:
    """A frame at the start and one every 1/30 s, to the end of the run."""
    film = Film()
    config = load_config("stand", ["duration_s=0.902"]).config
    run_prepared(prepare(config, _Hold()), film)
    assert film.n_frames == 28


def test_frame_of_the_film_is_a_state_of_the_run(tmp_path: Path) -> None:
    """The state is that at the moment, bit for bit; robot and ball are drawn."""
    keeper = SeriesKeeper()
    config = load_config("push", ["duration_s=0.6", "push.0.time_s=0.1"]).config
    prepared = prepare(config, _Hold())
    run_with_files(prepared, tmp_path, is_logged=False, recorders=[keeper])
    _, states = _find_states(tmp_path, [0.4, 0.5])
    np.testing.assert_array_equal(states, keeper.series.qpos[[80, 100]])
    module, file = "ballsim.recording.film_frame", tmp_path / "frame.png"
    words = [sys.executable, "-m", module, str(tmp_path), str(file), "--moment", "0.4"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode == 2 and "off-screen OpenGL" in done.stderr:
        pytest.skip("no off-screen drawing")
    assert done.returncode == 0, done.stderr
    red, green, blue = np.moveaxis(np.asarray(Image.open(file)).astype(int), -1, 0)
    assert ((red > 150) & (green < 110) & (blue < 90)).sum() > 10_000  # of the ball
    assert ((red > 170) & (abs(red - blue) < 30)).sum() > 5_000  # of the robot
