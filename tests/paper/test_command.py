"""The command ``ballsim paper``: its files, and the acceptance of what they say."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from ballsim import cli
from ballsim.paper import command
from ballsim.paper.experiments import Experiment, Laboratory
from ballsim.paper.figures import FORMATS, PAPER_FIGURES
from ballsim.paper.parameter_sets import PARAMETER_SETS, RADII

FIGURES = {f"{stem}.{suffix}" for stem in PAPER_FIGURES for suffix in FORMATS}
FILES = FIGURES | {"paper.json", "table.md"}


@pytest.fixture
def _few_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the simulations by two short ones."""

    def run(progress: Any = None) -> tuple[Experiment, ...]:
        laboratory = Laboratory()
        return (
            laboratory.roll_to("S2", 0.5, (0.0, 0.5), duration=6.0),
            laboratory.roll_steadily("KNV20", 0.5, 12.0),
        )

    monkeypatch.setattr(command, "run_experiments", run)


def _check_files(folder: Path) -> None:
    """All are there, as a whole, and are what their names say."""
    assert {file.name for file in folder.iterdir()} == FILES
    for name in FIGURES:
        content = (folder / name).read_bytes()
        if name.endswith("png"):
            assert content.startswith(b"\x89PNG")
            assert len(content) > 10_000
        else:
            assert ElementTree.fromstring(content).tag.endswith("svg")
    table = (folder / "table.md").read_text()
    assert "| 13 | 1 |" in table
    assert "k1 + k2 > 2" in table


def _check_ball(ball: dict[str, Any]) -> None:
    """Its gains are there, and tell which loop is stable."""
    assert len(ball["K"][0]) == 6
    assert ball["lead_time"] == pytest.approx(2.474544, rel=1e-6)
    observers = ball["observers"]
    assert {name: o["is_loop_stable"] for name, o in observers.items()} == {
        "decoupled": True,
        "knv": True,
        "place": False,
    }
    for observer in observers.values():
        assert [len(row) for row in observer["F"]] == [3] * 6
        assert len(observer["zeros"]) == 4
    assert min(ball["speed_limits"].values()) >= 0.4 - 1e-12


def _check_rest(run: dict[str, Any]) -> None:
    """The ball comes to rest on its target; the steps are told one by one."""
    assert run["fall_time"] is None
    assert abs(run["final_error"]) < 1e-3
    assert run["targets"][-1]["angle"] == pytest.approx(run["final_angle"], abs=1e-3)
    landed = [step for step in run["steps"] if step["landing_time"] is not None]
    assert len(landed) == run["step_count"]
    if run["parameter_set"] == "S1":
        assert run["cop_deviation_max"] < 1e-9


def _check_velocity(radius: float, run: dict[str, Any]) -> None:
    """The speed is 0.4; the CoP deviates on the unit ball alone, once a step."""
    set_name, steady = run["parameter_set"], run["steady"]
    if radius == 0.25 and set_name in ("KNV20", "KNV5"):
        assert run["fall_time"] is not None  # dt = 5 ms and its slow swing
        return
    assert run["fall_time"] is None
    assert [stage["stage"] for stage in run["stages"]] == [0.2, 0.3, 0.35, 0.375]
    assert steady["mean"] == pytest.approx(0.4, abs=1e-3)
    if radius == 1.0 and set_name in ("KNV20", "KNV5"):
        assert 1e-4 < steady["deviation"] < 2e-2
        assert 1e-3 < steady["oscillation"] < 0.1
        assert steady["deviating_steps"] > 0.5
    else:
        assert steady["deviation"] < 1e-9
        assert steady["oscillation"] < 1e-4


def test_paper_reproduces_section_vi(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All files, all four balls, and every number that the issue asks for."""
    folder = tmp_path / "here"
    assert cli.main(["paper", "--out", str(folder)]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert "Fig. 10, 11: theta_1' at the end of stage 1" in captured.out
    assert f"files in {folder}" in captured.out
    _check_files(folder)
    report = json.loads((folder / "paper.json").read_text())
    assert report["command"] == f"ballsim paper --out {folder}"
    assert report["parameter_sets"].keys() == PARAMETER_SETS.keys()
    assert [ball["ball_radius"] for ball in report["balls"]] == list(RADII)
    for ball in report["balls"]:
        _check_ball(ball)
        assert len(ball["runs"]) == 8
        for run in ball["runs"]:
            assert run["parameters"]["footsteps"]["half_length"] == 0.1
            if run["name"] == "velocity":
                _check_velocity(ball["ball_radius"], run)
            else:
                _check_rest(run)
    # The speeds at which the stages end: consistent, not identified.
    stages = [row for row in report["comparison"] if "end of stage" in row["quantity"]]
    assert len(stages) == 8
    assert max(abs(row["difference"]) for row in stages) < 0.035


@pytest.mark.usefixtures("_few_runs")
def test_json_is_all_there_is_on_stdout(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With --json stdout is paper.json; without --out the folder is numbered."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(["paper", "--json"]) == 0
    folder = Path("runs/paper-001")
    assert capsys.readouterr().out == (folder / "paper.json").read_text()
    names = {file.stem for file in folder.iterdir()}
    assert names >= {"fig08_output", "fig12_velocity", "paper", "table"}


@pytest.mark.usefixtures("_few_runs")
def test_equal_runs_give_equal_files(tmp_path: Path) -> None:
    """Nothing in a file depends on when it was written; other files are left."""
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "notes.txt").write_text("mine")
        command.run_paper(tmp_path / name)
    one, two = (sorted((tmp_path / name).iterdir()) for name in ("one", "two"))
    assert [file.name for file in one] == [file.name for file in two]
    assert "notes.txt" in {file.name for file in one}
    for first, second in zip(one, two, strict=True):
        assert first.read_bytes() == second.read_bytes(), first.name


@pytest.mark.parametrize("out", ["file", "file/below", "/proc/here"])
def test_folder_that_cannot_be_written(
    out: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """It is refused before any simulation: code 2, one line, nothing written."""
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    assert cli.main(["paper", "--out", out]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert f"command line: --out = '{out}'" in captured.err
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_missing_matplotlib_is_bad_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without Matplotlib the command is refused before any simulation."""
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert cli.main(["paper"]) == 2
    assert "matplotlib" in capsys.readouterr().err


def test_parsing_the_command_line_imports_no_matplotlib() -> None:
    """The command is imported without its figures."""
    import subprocess

    code = (
        "import sys, ballsim.paper.command\n"
        "sys.exit(bool({'matplotlib', 'control', 'rerun'} & sys.modules.keys()))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
