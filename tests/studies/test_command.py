"""The command ``ballsim study``: files, restarts, exit codes."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from ballsim import cli
from ballsim.studies import command
from ballsim.studies.ledger import LEDGER_FILE
from ballsim.studies.single_run import Task

WriteStudy = Callable[..., Path]
FILES = {
    "config.toml",
    "ledger.sqlite",
    "metrics.png",
    "report.json",
    "report.md",
    "results.parquet",
    "study.toml",
    "survival.png",
}


def _study(file: Path, out: Path, *words: str) -> int:
    return cli.main(["study", str(file), "--out", str(out), *words])


def test_study_leaves_its_files(
    write_study: WriteStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A row for each run, a report whose pictures exist, the definition itself."""
    file, out = write_study(), tmp_path / "new" / "out"
    assert _study(file, out, "--workers", "1") == 0
    assert "4 runs, 4 still up" in capsys.readouterr().out
    assert {path.name for path in out.iterdir()} == FILES
    rows = pq.read_table(out / "results.parquet").to_pylist()
    keys = [(row["scene.sole_friction"], row["seed"]) for row in rows]
    assert keys == [(0.5, 0), (0.5, 1), (1.0, 0), (1.0, 1)]
    assert {row["status"] for row in rows} == {"finished"}
    assert "wall_time" not in rows[0]
    assert rows[0]["estimate_rms.com_to_ball_m"] > 0.0
    assert len({row["trajectory_sha256"] for row in rows}) == 4
    report = (out / "report.md").read_text()
    for picture in ("survival.png", "metrics.png"):
        assert f"]({picture})" in report
        assert (out / picture).read_bytes().startswith(b"\x89PNG")
    assert "100.0% (51.0% to 100.0%)" in report
    assert (out / "study.toml").read_text() == file.read_text()


def test_workers_and_restarts_leave_the_same_bytes(
    write_study: WriteStudy,
    started: list[Task],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One worker, two workers, and a study that broke off: the same table."""
    file = write_study()
    assert _study(file, tmp_path / "one", "--workers", "1") == 0
    assert _study(file, tmp_path / "two", "--workers", "2") == 0
    written: list[Any] = []
    write = command.Ledger.write

    def break_off(self: Any, outcome: Any) -> None:
        if len(written) == 2:
            raise KeyboardInterrupt
        written.append(outcome)
        write(self, outcome)

    with monkeypatch.context() as patch:
        patch.setattr(command.Ledger, "write", break_off)
        assert _study(file, tmp_path / "three", "--workers", "1") == 130
    assert not (tmp_path / "three" / "results.parquet").exists()
    started.clear()
    assert _study(file, tmp_path / "three", "--workers", "1") == 0
    assert len(started) == 2
    contents = [
        (tmp_path / name / "results.parquet").read_bytes()
        for name in ("one", "two", "three")
    ]
    assert contents[0] == contents[1] == contents[2]


def test_json_goes_to_stdout_alone(
    write_study: WriteStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is printed is what stands in report.json."""
    out = tmp_path / "out"
    assert _study(write_study(), out, "--workers", "1", "--json") == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers == json.loads((out / "report.json").read_text())
    assert (numbers["runs"], numbers["survived"], numbers["fell"]) == (4, 4, 0)
    assert numbers["groups"][0]["points"][0]["survival_95_percent"][1] == 1.0


def test_printed_levels_have_their_labels(
    write_study: WriteStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A unit in square brackets is no markup of the terminal."""
    text = write_study().read_text() + '\n[[factors]]\nkey = "ball.radius_m"\n'
    file = write_study(text + 'label = "radius [m]"\nvalues = [0.5]\n')
    assert _study(file, tmp_path / "out", "--workers", "1") == 0
    assert "radius [m] 0.5  50% survive at below 0.5" in capsys.readouterr().out


def test_falls_leave_their_recordings(write_study: WriteStudy, tmp_path: Path) -> None:
    """Those of the controller that falls, and of no other."""
    text = 'scenario = "stand"\nduration_s = 1\nseeds = 1\nkeep_recordings = "falls"\n'
    text += 'metrics = []\n[[factors]]\nkey = "controller.name"\n'
    file = write_study(text + 'values = ["wheeled-lip", "paper"]\n')
    assert _study(file, tmp_path / "out", "--workers", "1") == 0
    found = [path.name for path in (tmp_path / "out" / "falls").iterdir()]
    assert found == ["cell-1-seed-0.rrd"]
    assert (tmp_path / "out" / "time_to_fall.png").is_file()


def test_dry_run_tells_the_cost_and_writes_nothing(
    write_study: WriteStudy,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Cells, runs, and the time of all from that of one."""
    monkeypatch.chdir(tmp_path)
    file = write_study()
    assert cli.main(["study", str(file), "--dry-run", "--workers", "2", "--json"]) == 0
    cost = json.loads(capsys.readouterr().out)
    assert (cost["n_cells"], cost["n_runs"], cost["n_workers"]) == (2, 4, 2)
    assert cost["total_time"] == pytest.approx(2 * cost["time_per_run"])
    assert cli.main(["study", str(file), "--dry-run", "--workers", "1"]) == 0
    assert "2 cells, at most 4 runs" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


@pytest.mark.parametrize(
    ("text", "words", "part"),
    [
        ("seedz = 1", (), "seedz = 1"),
        ("metrics = ['speed']", (), "metrics.0 = 'speed'"),
        ("[[factors]]\nkey = 'ball.radius_m'\nvalues = []", (), "values = []"),
        ("[[factors]]\nkey = 'ball.radius_m'\nvalues = [9]", (), "ball.radius_m = 9"),
        ("", ("--workers", "0"), "--workers = '0'"),
        ("", ("--scheduler", "tcp://127.0.0.1:x"), "--scheduler"),
        ("", ("--scheduler", "tcp://127.0.0.1:1", "--workers", "1"), "--workers = '1'"),
    ],
)
def test_bad_input_writes_nothing(
    text: str,
    words: tuple[str, ...],
    part: str,
    write_study: WriteStudy,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Exit code 2, one line, no folder."""
    assert _study(write_study(text + "\n"), tmp_path / "out", *words) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert part in message
    assert not (tmp_path / "out").exists()


def test_folder_of_another_study_is_refused(
    write_study: WriteStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line; the folder stays as it is."""
    out = tmp_path / "out"
    assert _study(write_study(), out, "--workers", "1") == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    capsys.readouterr()
    other = write_study(write_study().read_text().replace("0.5", "0.6"), "other.toml")
    assert _study(other, out) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "another study, 'small'" in message
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert (out / LEDGER_FILE).is_file()


def test_workers_import_the_simulator_only() -> None:
    """Neither figures nor statistics, nor the log, nor Dask, nor the terminal."""
    heavy = "rerun matplotlib control pyarrow scipy.stats distributed rich tomli_w"
    code = "import ballsim.studies.single_run, ballsim.studies.executors, sys; "
    code += f"print(*set({heavy.split()!r}) & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == []
