"""``ballsim bench``: its JSON, its tables, its complaints."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from ballsim import cli
from ballsim.bench import command, sections, table


@dataclass(frozen=True)
class MemoryUse:
    simulated_time: float
    peak_memory: float
    recording_size: float = 2.0


QUICK = ["bench", "--quick", "--ball-radius", "0.5", "--duration", "0.1"]


@pytest.fixture(autouse=True)
def _empty_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")


@pytest.mark.timeout(900)  # all parts, in processes of their own
def test_json_and_tables(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """JSON is all on stdout; printed and put into a document it is tables."""
    assert cli.main([*QUICK, "--set", "seed=3", "--json"]) == 0
    captured = capsys.readouterr()
    report: dict[str, Any] = json.loads(captured.out)
    assert captured.err == ""
    assert list(tmp_path.iterdir()) == []
    assert set(report) == {
        "machine",
        "settings",
        "balls",
        "parts",
        "log",
        "overhead_ms",
        "startup_s",
        "scaling",
        "batch",
        "memory",
    }
    assert report["settings"]["overrides"] == ["target_angle=4", "seed=3"]
    assert report["settings"]["repeats"] == 1
    (ball,) = report["balls"]
    assert ball["ball_radius"] == 0.5
    assert ball["survived"] is True
    assert set(ball["realtime_factor"]) == {"closed", "recorded", "bare"}
    assert set(ball["of_bare"]) == {"closed", "recorded"}
    assert report["log"]["simulated_time"] == pytest.approx(2.0)
    assert all(value >= 0.0 for value in report["overhead_ms"].values())
    assert (
        report["startup_s"]["help"]["best"] < report["startup_s"]["first_step"]["best"]
    )
    assert report["machine"]["versions"]["mujoco"]
    (tmp_path / "r.json").write_text(captured.out)
    (tmp_path / "d.md").write_text("<!-- bench: begin -->\n<!-- bench: end -->\n")
    assert table.main(["r.json"]) == 0
    assert "sensors" in capsys.readouterr().out
    assert table.main(["r.json", "d.md"]) == 0
    assert "| swing foot, force distribution |" in (tmp_path / "d.md").read_text()


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["--repeats", "0"], ["--repeats = '0'", "at least 1"]),
        (["--repeats", "x"], ["--repeats = 'x'", "whole number"]),
        (["--workers", "-1"], ["--workers = '-1'"]),
        (["--ball-radius", "x"], ["command line: ball.radius_m = 'x'"]),
        (["--ball-radius", "0.12"], ["ball.radius_m = 0.12", "at least"]),
        (["--duration", "-1"], ["duration_s = -1"]),
        (["--scenario", "stnad"], ["SCENARIO = 'stnad'"]),
        (["--controller", "x"], ["controller.name = 'x'"]),
        (["--sensors", "x"], ["sensors.preset = 'x'"]),
        (["--set", "ball.x=1"], ["ball.x = 1"]),
        (["--set", "drives.delay_s=0.005"], ["drives.delay_s = 0.005", "0 in a"]),
        (["--bals", "1"], ["--bals"]),
    ],
)
def test_bad_input_exits_with_2(
    words: list[str],
    parts: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Bad input: code 2 and one line, before anything is measured."""
    monkeypatch.setattr(command, "measure_ball", lambda *_: pytest.fail("measured"))
    try:
        code = cli.main(["bench", *words])
    except SystemExit as error:  # argparse
        code = int(error.code or 0)
    captured = capsys.readouterr()
    assert code == 2
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    for part in parts:
        assert part in captured.err


def test_memory_that_is_not_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without its module --memory is refused before anything is measured."""
    monkeypatch.setattr(command, "_MEMORY", "ballsim.bench.nowhere")
    monkeypatch.setattr(command, "measure_ball", lambda *_: pytest.fail("measured"))
    assert cli.main(["bench", "--memory"]) == 2
    assert "--memory" in capsys.readouterr().err


def test_memory_is_measured_if_it_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """The module is asked for a short and a ten times longer run with its log."""

    def measure(durations: Sequence[float], is_logged: bool) -> list[MemoryUse]:
        assert is_logged
        return [MemoryUse(time, 100.0 + time / 60.0) for time in durations]

    module: Any = ModuleType("memory")
    module.__spec__ = ModuleSpec("memory", None)
    module.measure_memory = measure
    monkeypatch.setitem(sys.modules, "probe_of_memory", module)
    monkeypatch.setattr(command, "_MEMORY", "probe_of_memory")
    rows = command._find_memory()((60.0, 600.0))
    assert rows == [asdict(MemoryUse(60.0, 101.0)), asdict(MemoryUse(600.0, 110.0))]
    section = sections._make_memory(rows)
    assert section.rows == (("60 s", "101.0", "2.0"), ("600 s", "110.0", "2.0"))
    assert "9.0 MiB" in section.note


def test_own_scenario_has_no_target_of_ours(tmp_path: Path) -> None:
    """The target of 4 rad belongs to the default scenario only."""
    options = command.BenchOptions(scenario="stand", radii=("0.5", "1"), is_quick=True)
    configs = command.load_configs(options)
    assert [config.ball.radius for config in configs] == [0.5, 1.0]
    assert {config.command.timeline for config in configs} == {
        configs[0].command.timeline
    }
    assert configs[0].scenario == "stand"
    default = command.load_configs(command.BenchOptions(duration="3"))
    assert [config.ball.radius for config in default] == [0.25, 0.5, 0.75, 1.0]
    assert {c.command.timeline[0].target_ball_angle for c in default} == {4.0}
    assert {config.duration for config in default} == {3.0}
