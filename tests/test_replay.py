"""``replay``: equal runs pass, a changed bit or version is reported."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ballsim import preparation
from ballsim.config_io import load_config
from ballsim.errors import ConfigError, ReplayMismatchError
from ballsim.preparation import prepare
from ballsim.replay import replay
from ballsim.run_files import run_with_files
from ballsim_controllers.messages import (
    Command,
    Controller,
    ControllerSetup,
    JointTargets,
    SensorReading,
)


class _Hold:
    telemetry = None

    def __init__(self, setup: ControllerSetup) -> None:
        self.posture: np.ndarray | None = None
        self.shift = setup.settings.get("shift_rad", 0.0)

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        if self.posture is None:
            self.posture = reading.joint_positions + self.shift
        return JointTargets(self.posture)


@pytest.fixture
def run_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of a finished run."""

    def find(name: str) -> type[Controller]:
        assert name == "hold"
        return _Hold

    monkeypatch.setattr(preparation, "find_controller_factory", find)
    overrides = [
        "controller.name=hold",
        "controller.shift_rad=0.001",
        "duration_s=0.4",
        "sensors.foot_force.noise_std_n=2.5",
    ]
    config = load_config("stand", overrides).config
    run_with_files(prepare(config), tmp_path / "run", is_logged=False)
    return tmp_path / "run"


def test_repeated_run_is_identical(run_folder: Path) -> None:
    """The folder's configuration is enough to repeat the run bit for bit."""
    summary = json.loads((run_folder / "summary.json").read_text())
    assert replay(run_folder) == summary["trajectory_sha256"]


def test_changed_input_is_found(run_folder: Path) -> None:
    """A tiny change of any input shows in the digest."""
    file = run_folder / "config.toml"
    text = file.read_text()
    assert "shift_rad = 0.001" in text
    file.write_text(text.replace("shift_rad = 0.001", "shift_rad = 0.0010000001"))
    with pytest.raises(ReplayMismatchError, match="trajectory_sha256 is"):
        replay(run_folder)


def test_changed_version_is_named(run_folder: Path) -> None:
    """Where the trajectories differ, other versions are named as a likely cause."""
    file = run_folder / "summary.json"
    summary = json.loads(file.read_text())
    summary["trajectory_sha256"] = "0" * 64
    summary["versions"]["mujoco"] = "3.9.0"
    file.write_text(json.dumps(summary))
    with pytest.raises(ReplayMismatchError, match=r"mujoco is .*, was 3\.9\.0"):
        replay(run_folder)


def test_folder_must_hold_a_finished_run(run_folder: Path, tmp_path: Path) -> None:
    """Missing or broken files are bad input."""
    with pytest.raises(ConfigError, match="DIR"):
        replay(tmp_path)
    (run_folder / "summary.json").write_text("{")
    with pytest.raises(ConfigError, match="JSON"):
        replay(run_folder)
    (run_folder / "summary.json").write_text("{}")
    with pytest.raises(ConfigError, match="trajectory_sha256"):
        replay(run_folder)
