"""`import ballsim`: run, load, study; what is read back is what happened."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ballsim
from ballsim.config_io import format_config, load_config
from ballsim.preparation import prepare
from ballsim.recording.events import COMMAND, FALL, GAIT, PUSH
from ballsim.run_files import run_with_files

pytest.importorskip("rerun")


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> ballsim.RunResult:
    """A run with steps and a new target, and its files."""
    folder = tmp_path_factory.mktemp("walk")
    return ballsim.run("walk", out=folder, duration=5.5, ball_radius=0.5, seed=2)


@pytest.fixture(scope="module")
def read(kept: ballsim.RunResult) -> ballsim.RunResult:
    """The same run, from its files."""
    assert kept.folder is not None
    return ballsim.load(kept.folder)


def test_import_is_light() -> None:
    """Nothing heavy is imported before something is used."""
    code = """
import sys, ballsim
heavy = {"mujoco", "numba", "numpy", "pandas", "rerun", "scipy"} & set(sys.modules)
assert not heavy, heavy
assert {"run", "load", "study"} <= set(dir(ballsim))
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_recording_holds_what_happened(
    kept: ballsim.RunResult, read: ballsim.RunResult
) -> None:
    """Every series comes back, to single precision, with unit and description."""
    extra = set(read.signals) - set(kept.signals)
    assert extra == {"performance/realtime_factor"}
    for path, expected in kept.signals.items():
        found = read[path]
        assert (found.unit, found.columns) == (expected.unit, expected.columns)
        assert found.description == expected.description
        np.testing.assert_allclose(found.time, expected.time, atol=1e-8)
        np.testing.assert_allclose(found.values, expected.values, rtol=2e-7, atol=1e-30)
    assert read.events == kept.events
    assert format_config(read.config) == format_config(kept.config)
    assert read.summary == kept.summary


def test_series_agree_with_the_summary(read: ballsim.RunResult) -> None:
    """The summary was computed in the loop: another route to the same numbers."""
    summary = read.summary
    torque = np.abs(read["truth/joints/torque"].values).max()
    assert torque == pytest.approx(summary["peak_joint_torque"], rel=1e-6)
    believed, true = read["estimate/com/position"], read["truth/com/position"]
    rms = np.sqrt(((believed.values - true.values) ** 2).sum(axis=1).mean())
    assert rms == pytest.approx(summary["estimate_rms"]["com_to_ball_m"], rel=0.05)
    gaits = [event.text for event in read.events if event.kind == GAIT]
    assert sum("lands" in text for text in gaits) == summary["step_count"] > 2


def test_sensors_without_noise_tell_the_truth(read: ballsim.RunResult) -> None:
    """Encoders read the joints a physics step ago; the feet carry the robot."""
    # Speeds are differences of 20 ms: at a landing they are not those of the last step.
    encoders, joints = read["sensors/joints/position"], read["truth/joints/position"]
    speeds = np.gradient(joints.values, 0.02, axis=0)
    moved = joints.values[1:] - encoders.values[1:]
    off = np.abs(moved - 1e-3 * speeds[1:])
    assert np.quantile(off, 0.99) < 1e-3
    assert off.max() < 3e-3
    total = read["truth/foot_forces"].values.sum(axis=1)
    assert total.mean() == pytest.approx(65.0 * 9.81, rel=0.02)
    errors = read["estimate/error/com"].values
    believed, true = read["estimate/com/position"], read["truth/com/position"]
    np.testing.assert_allclose(errors, believed.values - true.values, atol=1e-6)


def test_frame_has_rows_that_all_series_have(read: ballsim.RunResult) -> None:
    """Fast and slow series side by side, each with its own values."""
    frame = read.frame("truth/ball/angle", "truth/cop")
    angle, cop = read["truth/ball/angle"], read["truth/cop"]
    assert list(frame.columns) == [
        "truth/ball/angle/forward",
        "truth/ball/angle/left",
        "truth/cop/forward",
        "truth/cop/left",
    ]
    np.testing.assert_array_equal(frame.index, angle.time)
    np.testing.assert_array_equal(frame["truth/ball/angle/left"], angle["left"])
    np.testing.assert_array_equal(frame["truth/cop/forward"], cop["forward"][::4])
    assert len(read.frame().columns) > 100
    assert list(cop.frame().columns) == ["forward", "left"]


def test_results_are_shown_on_one_line(read: ballsim.RunResult) -> None:
    """In a notebook a run or a series tells what it is, not all its numbers."""
    for result in (read, *read.signals.values()):
        assert "\n" not in repr(result)
        assert len(repr(result).replace(str(read.folder), "")) < 200
    assert f"{len(read.signals)} series" in repr(read)
    assert str(read.folder) in repr(read)
    series = read["truth/cop"]
    assert f"truth/cop [m]: forward, left; {len(series)} rows" in repr(series)


def test_unknown_names_are_told(read: ballsim.RunResult) -> None:
    """A wrong path or component names those there are."""
    with pytest.raises(KeyError, match="truth/ball/angle"):
        read["truth/ball"]
    with pytest.raises(KeyError, match="has forward, left"):
        read["truth/cop"]["x"]
    assert "truth/cop" in read.describe()


def test_changes_are_those_of_the_command_line() -> None:
    """Short names, parameters and dotted keys change the configuration."""
    run = ballsim.run(
        "push",
        duration=np.float64(0.02),
        ball_radius=0.25,
        sensors="mid",
        force=12,
        **{"controller.gait.lift_m": 0.04},
    )
    overrides = [
        *("duration_s=0.02", "ball.radius_m=0.25", "sensors.preset=mid", "force=12"),
        "controller.gait.lift_m=0.04",
    ]
    assert run.config == prepare(load_config("push", overrides).config).config
    assert run.folder is None
    assert len(run["truth/cop"]) == 4


def test_bad_input_is_one_line(tmp_path: Path) -> None:
    """The same errors as on the command line; nothing is written."""
    with pytest.raises(ballsim.ConfigError, match=r"ball.radius_m = -1.0 is not valid"):
        ballsim.run("stand", out=tmp_path / "run", ball_radius=-1.0)
    assert not (tmp_path / "run").exists()
    with pytest.raises(ballsim.ConfigError, match=r"DIR = .* run\.rrd"):
        ballsim.load(tmp_path)
    (tmp_path / "run.rrd").write_bytes(b"not a recording")
    with pytest.raises(ballsim.ConfigError, match="the recording of a run"):
        ballsim.load(tmp_path)


def test_a_fall_is_an_event(tmp_path: Path) -> None:
    """Push and fall stand in the recording, as in the summary and in memory."""
    changes = {"force": 400, "push.0.time_s": 0.2, "duration": 3}
    kept = ballsim.run("push", out=tmp_path, **changes)
    assert not kept.survived
    read = ballsim.load(tmp_path / "run.rrd")  # without its folder
    assert read.events == kept.events
    assert not read.survived
    assert read.summary == {}
    assert format_config(read.config) == format_config(kept.config)
    *_, last = read.events
    assert last.kind == FALL
    assert last.text == f"fell: {kept.summary['fall_reason']}"
    assert last.time == pytest.approx(kept.summary["fall_time"])
    pushes = [event for event in read.events if event.kind == PUSH]
    assert [event.time for event in pushes] == [0.2]
    assert "force_n = 400" in pushes[0].text
    assert f"{last.text} at {last.time:g} s" in repr(read)


def test_commands_are_events(read: ballsim.RunResult) -> None:
    """Each command of the scenario that the run has reached."""
    commands = [event for event in read.events if event.kind == COMMAND]
    times = [point.time for point in read.config.command.timeline]
    assert [event.time for event in commands] == [time for time in times if time < 5.5]


def test_a_run_without_log_cannot_be_read_back(tmp_path: Path) -> None:
    """There is no recording: one line says so."""
    config = load_config("stand", ["duration_s=0.02"]).config
    run_with_files(prepare(config), tmp_path, is_logged=False)
    with pytest.raises(ballsim.ConfigError, match=r"run\.rrd"):
        ballsim.load(tmp_path)


def test_study_has_a_row_for_each_run(tmp_path: Path) -> None:
    """A small study from Python: its rows as a data frame."""
    file = tmp_path / "few.toml"
    file.write_text(
        'scenario = "stand"\nseeds = 2\n'
        "duration_s = 0.1\n"
        "[[factors]]\nkey = 'ball.radius_m'\nvalues = [0.25, 0.5]\n"
    )
    result = ballsim.study(file, out=tmp_path / "out", workers=1)
    frame = result.frame()
    assert len(frame) == result.numbers["runs"] == 4
    assert repr(result).startswith("<StudyResult few: 4 runs, 0 fell; in ")
    assert sorted(set(frame["ball_radius"])) == [0.25, 0.5]
    assert json.loads((tmp_path / "out" / "report.json").read_text())["runs"] == 4
