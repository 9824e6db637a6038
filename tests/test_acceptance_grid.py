"""The acceptance grid: its numbers, its files, its exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from ballsim import acceptance
from ballsim.acceptance import summarise_cell


def _run(error: float, survived: bool = True) -> dict[str, Any]:
    return {
        "cell": ["stand", 0.5],
        "survived": survived,
        "ball_angle_error": error,
        "ball_angle_overshoot": 2.0 * abs(error),
        "ball_lateral_drift": 0.01,
        "step_count": round(100.0 * abs(error)),
        "realtime_factor": 3.0,
    }


def test_a_cell_holds_the_worst_of_its_runs() -> None:
    """Errors count by size; the runs that fell count as falls only."""
    cell = summarise_cell([_run(0.01), _run(-0.02), _run(9.0, survived=False)])
    assert (cell["runs"], cell["falls"]) == (3, 1)
    assert cell["max_ball_angle_error"] == 0.02
    assert cell["max_ball_angle_overshoot"] == 0.04
    assert (cell["min_step_count"], cell["max_step_count"]) == (1, 2)
    assert cell["max_floor_target_error"] is None  # no run has one
    assert cell["max_cross_track_rms"] is None
    fast = {**_run(0.01), "ball_angle_error": None, "ball_speed_mean": -0.4}
    cell = summarise_cell([fast, {**fast, "ball_speed_mean": -0.3}])
    assert cell["max_ball_angle_error"] is None
    assert (cell["min_ball_speed_mean"], cell["max_ball_speed_mean"]) == (0.3, 0.4)
    nobody = summarise_cell([_run(9.0, survived=False)])
    assert nobody["falls"] == 1
    assert nobody["max_ball_angle_error"] is None


def test_grid_prints_a_table_and_writes_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One row for each scenario and ball; the file holds every run's summary."""
    file = tmp_path / "new" / "acceptance.json"
    words = ["--scenarios", "stand,duration_s=0.1", "--radii", "0.5", "1"]
    words += ["--seeds", "2", "--workers", "1", "--out", str(file)]
    assert acceptance.main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + 2 + 1
    content = json.loads(file.read_text())
    assert [cell["radius"] for cell in content["cells"]] == [0.5, 1.0]
    seeds = [(run["ball_radius"], run["seed"]) for run in content["runs"]]
    assert seeds == [(0.5, 0), (0.5, 1), (1.0, 0), (1.0, 1)]


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--scenarios", "stnad"], "SCENARIO = 'stnad'"),
        (["--radii", "-1"], "ball.radius_m = -1.0"),
        (["--set", "controller.gait.liftt_m=1"], "controller.gait.liftt_m = 1"),
    ],
)
def test_bad_input_is_refused(
    words: list[str], part: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Bad input: code 2, one line, nothing written."""
    file = tmp_path / "acceptance.json"
    more = ["--seeds", "1", "--workers", "1", "--out", str(file)]
    assert acceptance.main([*words, *more]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert part in message
    assert not file.exists()
