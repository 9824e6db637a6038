"""The command line: exit codes, one-line complaints, what is written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from ballsim import cli, preparation
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import (
    Command,
    ControllerSetup,
    JointTargets,
    SensorReading,
)

FILES = {"config.toml", "scene.xml", "controls.npz", "readings.npz", "summary.json"}


class _Hold:
    telemetry = None

    def __init__(self, setup: ControllerSetup) -> None:
        self.posture: np.ndarray | None = None
        self.setup = setup
        if "gain" in setup.settings:
            raise InvalidSettingError("gain", setup.settings["gain"], "no gain at all")

    @property
    def settings_table(self) -> dict[str, float]:
        return {"stiffness": 1.5, **self.setup.settings}

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        if self.posture is None:
            self.posture = reading.joint_positions.copy()
        if "crash" in self.setup.settings:
            raise RuntimeError("boom")
        scale = np.nan if "diverge" in self.setup.settings and reading.time > 0.1 else 1
        return JointTargets(self.posture * scale)


@pytest.fixture(autouse=True)
def _hold(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    find = preparation.find_controller_factory
    monkeypatch.setattr(
        preparation,
        "find_controller_factory",
        lambda name: _Hold if name == "hold" else find(name),
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr("tempfile.tempdir", None)


def _run(*words: str, duration: str = "0.3") -> int:
    start = ["run", "stand", "--controller", "hold", "--no-log", "--duration", duration]
    return cli.main([*start, *words])


def test_run_writes_its_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run that stays up exits with 0, writes its files, and prints a summary."""
    assert _run("--out", "here") == 0
    assert {file.name for file in (tmp_path / "here").iterdir()} == FILES
    captured = capsys.readouterr()
    assert "still up" in captured.out
    assert "files in here" in captured.out
    assert captured.err == ""
    assert "stiffness = 1.5" in (tmp_path / "here" / "config.toml").read_text()


def test_fall_exits_with_3(capsys: pytest.CaptureFixture[str]) -> None:
    """A fall is not an error: all files are there, the code says so."""
    assert _run("--out", "here", duration="4") == 3
    assert "fell at" in capsys.readouterr().out
    assert {file.name for file in Path("here").iterdir()} == FILES


def test_json_is_all_there_is_on_stdout(capsys: pytest.CaptureFixture[str]) -> None:
    """With --json stdout is the summary that is also in the folder."""
    assert _run("--json", "--out", "here", "--seed", "4", "--ball-radius", "0.75") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary == json.loads(Path("here/summary.json").read_text())
    assert summary["seed"] == 4
    assert summary["ball_radius"] == 0.75
    assert summary["controller"] == "hold"


def test_default_folders_are_numbered() -> None:
    """Without --out each run gets a folder of its own."""
    assert _run() == _run() == 0
    assert sorted(p.name for p in Path("runs").iterdir()) == ["stand-001", "stand-002"]


def test_old_files_do_not_outlive_a_new_run() -> None:
    """A run into an old folder leaves no file of the old run behind."""
    assert _run("--out", "here") == 0
    Path("here/run.rrd").write_text("old")
    Path("here/last_states.npz").write_text("old")
    Path("here/notes.txt").write_text("mine")
    assert _run("--out", "here") == 0
    assert {file.name for file in Path("here").iterdir()} == FILES | {"notes.txt"}


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["run", "stnad"], ["command line: SCENARIO = 'stnad'", "roll-to, staged"]),
        (["run", "stand", "--ball-radius", "-1"], ["command line: ball.radius_m = -1"]),
        (["run", "stand", "--ball-radius", "x"], ["ball.radius_m = 'x'", "number"]),
        (
            ["run", "stand", "--ball-radius", "0.05"],
            ["command line: ball.radius_m = 0.05", "at least 0.1 m, at most 5 m"],
        ),
        (
            ["run", "stand", "--ball-radius", "0.12"],
            ["command line: ball.radius_m = 0.12", "at least 0.137 m"],
        ),
        (
            ["run", "stand", "--ball-radius", "0.12", "--set", "ball.inertia=solid"],
            ["command line: ball.radius_m = 0.12", "at least 0.13 m", "to stand"],
        ),
        (["run", "stand", "--seed", "1.5"], ["command line: seed = 1.5", "whole"]),
        (["run", "stand", "--duration", "nan"], ["duration_s = nan", "finite"]),
        (["run", "stand", "--controller", "x"], ["controller.name = 'x'", "one of"]),
        (["run", "stand", "--sensors", "x"], ["sensors.preset = 'x'", "ideal"]),
        (
            ["run", "stand", "--set", "ball.x=1"],
            ["ball.x = 1", "no such key", "radius_m, mass_kg"],
        ),
        (["run", "stand", "--set", "bal.x=1"], ["bal.x = 1", "no such key", "ball"]),
        (
            ["run", "stand", "--set", "controller.gait.liftt_m=1"],
            ["command line: controller.gait.liftt_m = 1", "lift_m"],
        ),
        (
            ["run", "stand", "--set", "controller.gait.lift_m=high"],
            ["command line: controller.gait.lift_m = 'high'", "a number"],
        ),
        (["run", "stand", "--out", "/proc/here"], ["command line: --out", "written"]),
        (["run", "stand", "--set", "robot.name=x"], ["robot", "'x'", "biped"]),
        (["run", "bad.toml"], ["bad.toml: ball.radius_m = 'big'", "number"]),
        (["run"], ["ballsim run", "SCENARIO"]),
        (["dance"], ["dance", "run"]),
        (["replay", "nowhere"], ["DIR = 'nowhere'", "finished run"]),
        (["view", "nowhere"], ["DIR_OR_RRD = 'nowhere'", "run.rrd"]),
    ],
)
def test_bad_input_exits_with_2(
    words: list[str],
    parts: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Bad input: code 2, one line on stderr, nothing on stdout, nothing written."""
    (tmp_path / "bad.toml").write_text("[ball]\nradius_m = 'big'\n")
    try:
        code = cli.main(words)
    except SystemExit as error:  # argparse
        code = int(error.code or 0)
    captured = capsys.readouterr()
    assert code == 2
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    for part in parts:
        assert part in captured.err
    assert [file.name for file in tmp_path.iterdir()] == ["bad.toml"]


def test_bad_setting_of_the_controller(capsys: pytest.CaptureFixture[str]) -> None:
    """What the controller refuses is bad input, named by its dotted key."""
    assert _run("--set", "controller.gain=3") == 2
    expected = "command line: controller.gain = 3 is not valid: no gain at all"
    assert expected in capsys.readouterr().err
    assert not Path("runs").exists()


def test_folder_that_cannot_be_written(capsys: pytest.CaptureFixture[str]) -> None:
    """A folder that is a file is refused before the run."""
    Path("file").write_text("")
    for out in ("file", "file/below"):
        assert _run("--out", out) == 2
        assert "--out = " in capsys.readouterr().err


def test_internal_error_exits_with_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An unforeseen error tells where its traceback is."""
    (tmp_path / "tmp").mkdir()
    assert _run("--set", "controller.crash=1", "--out", "here") == 1
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "boom" in message
    file = Path(message.rsplit("traceback in ", 1)[1].strip())
    assert "RuntimeError" in file.read_text()


def test_failed_physics_leaves_the_last_states(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Physics that fail exit with 1 and leave the last states."""
    assert _run("--set", "controller.diverge=1", "--out", "here") == 1
    assert "physics failed at t = 0.10" in capsys.readouterr().err
    with np.load("here/last_states.npz") as states:
        assert {"time", "qpos", "qvel", "ctrl"} <= set(states)
    assert not Path("here/summary.json").exists()


def test_replay_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    """0 for an identical repeat, 4 for any difference."""
    assert _run("--out", "here") == 0
    assert cli.main(["replay", "here"]) == 0
    assert "identical" in capsys.readouterr().out
    config = Path("here/config.toml")
    config.write_text(config.read_text().replace("seed = 0", "seed = 1"))
    assert cli.main(["replay", "here"]) == 4
    assert "differs" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["scenarios", "controllers", "sensors"])
def test_lists(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A list has a line for each name; as JSON it holds the same names."""
    assert cli.main([command]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert cli.main([command, "--json"]) == 0
    items = json.loads(capsys.readouterr().out)
    assert [line.split()[0] for line in lines] == [item["name"] for item in items]


def test_view_becomes_the_viewer(monkeypatch: pytest.MonkeyPatch) -> None:
    """``view`` hands the recording to the rerun viewer, if asked for the web's."""
    calls: list[list[str]] = []
    monkeypatch.setattr("os.execv", lambda _path, words: calls.append(words))
    monkeypatch.setenv("RUST_LOG", "warn")  # put back after the test
    monkeypatch.setattr("shutil.which", lambda _name, path=None: "/bin/rerun")
    Path("here").mkdir()
    Path("here/run.rrd").write_bytes(b"")
    cli.main(["view", "here"])
    cli.main(["view", "here/run.rrd", "--web"])
    assert calls[0] == ["/bin/rerun", "here/run.rrd"]
    assert calls[1][:4] == ["/bin/rerun", "--web-viewer", "--bind", "127.0.0.1"]
    assert calls[1][-1] == "here/run.rrd"
    assert os.environ["RUST_LOG"] == "warn,re_sdk::web_viewer=info"


def test_video_without_encoder(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without the encoder --video is refused before the run."""
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert _run("--video") == 2
    assert "imageio-ffmpeg" in capsys.readouterr().err
    assert not Path("runs").exists()


def test_help_is_quick() -> None:
    """``--help`` imports none of the heavy packages."""
    code = (
        "import sys; from ballsim.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'mujoco', 'rerun', 'rich', 'scipy'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", code], check=True, env=environment, capture_output=True
    )
    assert time.perf_counter() - start < 3.0  # 0.05 s on an idle machine


@pytest.mark.parametrize(
    ("given", "n_threads"),
    [({}, 1), ({"OMP_NUM_THREADS": "2"}, 2), ({"OPENBLAS_NUM_THREADS": "2"}, 2)],
)
def test_linear_algebra_has_one_thread_unless_told(
    given: dict[str, str], n_threads: int
) -> None:
    """The command line starts no thread of OpenBLAS; the user's word counts more."""
    code = """
import os, sys
from ballsim.cli import main
main(["scenarios"])
import numpy
folder = "/proc/self/task"
sys.exit(len(os.listdir(folder)) if os.path.isdir(folder) else 77)
"""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS")
    environment = {k: v for k, v in os.environ.items() if k not in names} | given
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        stdout=subprocess.DEVNULL,
        check=False,
    )
    if done.returncode == 77 or (os.cpu_count() or 1) < 2:
        pytest.skip("threads cannot be counted, or there is one core only")
    assert done.returncode == n_threads
