"""Runs that are taken over from earlier results."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from ballsim import cli
from ballsim.studies.design import load_plan
from ballsim.studies.earlier import Earlier, read_earlier
from ballsim.studies.single_run import ERROR, FINISHED, Outcome, Task
from ballsim.studies.table import make_rows, pack_parquet

WriteStudy = Callable[..., Path]

CASES = """
seeds = 3
[[factors]]
key = "ball.radius_m"
values = [0.25, 0.5]
[[cases]]
name = "stand"
scenario = "stand"
[[cases]]
name = "roll"
scenario = "roll-to"
[cases.only]
ball.radius_m = [0.5]
"""
OLD = {"ballsim": "0.0.1", "revision": "abc"}


def _write_results(study: Path, file: Path) -> list[Outcome]:
    """Write results that nobody simulated, and return the outcomes."""
    plan = load_plan(study)
    outcomes = [
        Outcome(
            cell=cell.index,
            seed=seed,
            status=ERROR if (cell.index, seed) == (0, 1) else FINISHED,
            summary={} if (cell.index, seed) == (0, 1) else _summary(cell.index, seed),
        )
        for cell in plan.cells
        for seed in plan.seeds_of(cell)
    ]
    metadata = {"study": plan.name, "digest": plan.digest, **OLD}
    file.write_bytes(pack_parquet(make_rows(plan, outcomes), metadata))
    return outcomes


def _summary(cell: int, seed: int) -> dict[str, Any]:
    some: dict[str, Any] = {"survived": seed != 2, "rms": {"x_m": cell + 0.5 * seed}}
    return {**some, "fall_reason": "low" if seed == 2 else None}


def test_runs_give_the_rows_that_they_came_from(
    write_study: WriteStudy, tmp_path: Path
) -> None:
    """All but those without a result, with the versions of their code."""
    study, file = write_study(CASES), tmp_path / "results.parquet"
    outcomes, plan = _write_results(study, file), load_plan(study)
    taken = read_earlier(Earlier(file), plan)
    finished = [outcome for outcome in outcomes if outcome.status == FINISHED]
    assert len(taken) == len(outcomes) - 1
    assert make_rows(plan, taken) == make_rows(plan, finished)
    assert taken[0].provenance == OLD


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        (["ball.radius_m=0.25"], {(0, 0), (0, 2)}),
        (["ball.radius_m=0.5"], {(c, s) for c in (1, 2) for s in range(3)}),
        (["ball.radius_m=0.25,0.5", "ball.radius_m=0.25"], {(0, 0), (0, 2)}),
        (["ball.radius_m=0.25", "ball.radius_m=0.25,0.5"], {(0, 0), (0, 2)}),
    ],
)
def test_conditions_choose_among_the_runs(
    where: list[str],
    expected: set[tuple[int, int]],
    write_study: WriteStudy,
    tmp_path: Path,
) -> None:
    """All conditions hold, each with one of its values; without any, of all runs."""
    study, file = write_study(CASES), tmp_path / "results.parquet"
    _write_results(study, file)
    plan = load_plan(study)
    taken = read_earlier(Earlier(file, where), plan)
    assert {(outcome.cell, outcome.seed) for outcome in taken} == expected
    both = read_earlier(Earlier(file, ["ball.radius_m=0.25, 0.5"]), plan)
    assert both == read_earlier(Earlier(file), plan)


def test_runs_find_their_cells_in_another_order(
    write_study: WriteStudy, tmp_path: Path
) -> None:
    """What counts are case, factors and seed, not the number of the cell."""
    file = tmp_path / "results.parquet"
    _write_results(write_study(CASES), file)
    head, first, second = CASES.partition("[[cases]]")
    one, word, two = second.partition("[[cases]]")
    text = head.replace("seeds = 3", "seeds = [2, 7]") + word + two + first + one
    plan = load_plan(write_study(text, "other.toml"))
    found = {
        (plan.cases[plan.cells[o.cell].case].name, o.seed, o.summary["rms.x_m"])
        for o in read_earlier(Earlier(file), plan)
    }
    assert found == {("stand", 2, 1.0), ("stand", 2, 2.0), ("roll", 2, 3.0)}


def test_only_the_rest_is_run(
    write_study: WriteStudy,
    started: list[Task],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Here one friction of two; the rows are those of a study without earlier runs."""
    file, whole = write_study(), tmp_path / "whole"
    words = ["study", str(file), "--workers", "1"]
    assert cli.main([*words, "--out", str(whole)]) == 0
    rest = ["--from", str(whole / "results.parquet")]
    rest += ["--where", "scene.sole_friction=0.5"]
    capsys.readouterr()
    assert cli.main([*words, *rest, "--dry-run", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["n_runs"] == 2
    started.clear()
    for _ in range(2):  # the second time all is there
        assert cli.main([*words, *rest, "--out", str(tmp_path / "rest")]) == 0
        assert {task.config.scene.sole_friction for task in started} == {1.0}
        assert len(started) == 2
    tables = [
        pq.read_table(tmp_path / n / "results.parquet") for n in ("whole", "rest")
    ]
    assert tables[0].to_pylist() == tables[1].to_pylist()


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--from", "no-such-file"], "--from = 'no-such-file'"),
        (["--from", "{study}"], "it is not in Parquet format"),
        (["--where", "ball.radius_m=0.5"], "left out without --from"),
        (["--from", "{results}", "--where", "seed=1"], "as KEY: ball.radius_m"),
        (["--from", "{results}", "--where", "ball.radius_m=1"], "0.25, 0.5"),
        (["--from", "{others}"], "at least one run"),
    ],
)
def test_what_cannot_be_taken_over_is_refused(
    words: list[str],
    part: str,
    write_study: WriteStudy,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Exit code 2, one line, no folder."""
    study, out = write_study(CASES), tmp_path / "out"
    files = {name: tmp_path / f"{name}.parquet" for name in ("results", "others")}
    _write_results(study, files["results"])
    others = CASES.replace("0.25, 0.5", "0.75, 1.0").replace("[0.5]", "[1.0]")
    _write_results(write_study(others, "others.toml"), files["others"])
    filled = [word.format(study=study, **files) for word in words]
    assert cli.main(["study", str(study), "--out", str(out), *filled]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert part in message
    assert not out.exists()
