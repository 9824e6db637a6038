"""Studies of several scenarios: cells, refusals, verdicts, report."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from ballsim import cli
from ballsim.errors import ConfigError
from ballsim.studies.analysis import analyse
from ballsim.studies.cases import Case, Requirement
from ballsim.studies.design import Plan, extreme_cells, load_plan
from ballsim.studies.figures import render_cases
from ballsim.studies.report import build_json, format_report
from ballsim.studies.seeding import Seeder
from ballsim.studies.single_run import FINISHED, Outcome
from ballsim.studies.survival import wilson_interval
from ballsim.studies.table import make_rows
from ballsim.studies.validation import check_plan
from ballsim.studies.verdicts import judge, tally

WriteStudy = Callable[..., Path]
Refuse = Callable[[str], str]

ROLL = '[[cases]]\nname = "roll"\nscenario = "roll-to"\n'
PUSH = '[[cases]]\nname = "push"\nscenario = "push"\n'
RADIUS = '[[factors]]\nkey = "ball.radius_m"\nvalues = [0.5, 0.75, 1.0]\n'
STUDY = f"""
seeds = 4
duration_s = 0.1
metrics = ["step_count"]
[base]
ball.mass_kg = 30.0
{RADIUS}
{ROLL}
duration_s = 0.2
[cases.base]
ball.mass_kg = 20.0
[cases.each]
target_angle = [1.0, -4.0]
[cases.require]
ball_angle_error = 0.02
"ball_angle_overshoot / target_ball_angle" = 0.05
ball_speed_mean = [-0.1, 0.1]
{PUSH}
[cases.only]
ball.radius_m = [1.0, 0.5]
"""


def test_cells_are_cases_times_combinations(write_study: WriteStudy) -> None:
    """Lists are written out, values of a case win, factors can be restricted."""
    plan = load_plan(write_study(STUDY))
    assert [case.name for case in plan.cases] == [
        "roll, target_angle = 1",
        "roll, target_angle = -4",
        "push",
    ]
    found = [(cell.case, cell.config.ball.radius) for cell in plan.cells]
    assert found == [(c, r) for c in (0, 1) for r in (0.5, 0.75, 1.0)] + [
        (2, 0.5),
        (2, 1.0),
    ]
    targets = [c.config.command.timeline[0].target_ball_angle for c in plan.cells[:6]]
    assert targets == [1.0] * 3 + [-4.0] * 3
    assert {c.config.ball.mass for c in plan.cells[:6]} == {20.0}
    assert {c.config.ball.mass for c in plan.cells[6:]} == {30.0}
    assert [c.config.duration for c in plan.cells[::6]] == [0.2, 0.1]
    assert [cell.index for cell in plan.cells] == list(range(8))


def test_extreme_cells_come_from_every_case(write_study: WriteStudy) -> None:
    """Each case has a scenario and a summary of its own."""
    chosen = extreme_cells(load_plan(write_study(STUDY)))
    assert [(c.case, c.config.ball.radius) for c in chosen] == [
        (case, radius) for case in range(3) for radius in (0.5, 1.0)
    ]


def test_a_short_name_wins_over_its_long_one(write_study: WriteStudy) -> None:
    """The study's base has the long name of what the case sets by a parameter."""
    base = "[base]\npush.0.force_n = 10.0\n"
    text = PUSH + "[cases.base]\nforce = 30.0\n" + PUSH.replace('"push"\ns', '"b"\ns')
    plan = load_plan(write_study(base + text))
    assert [cell.config.pushes[0].force for cell in plan.cells] == [30.0, 10.0]


def test_one_case_gives_the_runs_of_a_study_without(write_study: WriteStudy) -> None:
    """The same configurations; other rows, because they name the case."""
    rest = "seeds = 2\n" + RADIUS
    plain = load_plan(write_study('scenario = "roll-to"\n' + rest))
    cased = load_plan(write_study(rest + ROLL))
    assert [c.config for c in plain.cells] == [c.config for c in cased.cells]
    assert plain.digest != cased.digest


def test_limits_leave_the_study_the_same(write_study: WriteStudy) -> None:
    """What is required may change without new runs; names are in the rows."""

    def digest(text: str) -> str:
        return load_plan(write_study(text)).digest

    assert digest(STUDY.replace("= 0.02", "= 0.03")) == digest(STUDY)
    assert digest(STUDY.replace('"push"\ns', '"shove"\ns')) != digest(STUDY)


def test_a_case_may_have_seeds_of_its_own(write_study: WriteStudy) -> None:
    """Its cells get them, those of other cases the study's; it is another study."""
    text = STUDY.replace(PUSH, PUSH + "seeds = [7, 5]\n")
    plan, plain = load_plan(write_study(text)), load_plan(write_study(STUDY))
    asked: dict[int, list[int]] = {}
    for task in Seeder(plan).first_tasks():
        asked.setdefault(task.cell, []).append(task.config.seed)
    assert asked == {cell: [0, 1, 2, 3] if cell < 6 else [7, 5] for cell in range(8)}
    assert (plan.n_runs, plain.n_runs) == (28, 32)
    assert plan.digest != plain.digest


@pytest.mark.parametrize(
    ("text", "row", "value", "is_kept"),
    [
        ("a = 0.5", {"a": -0.5}, -0.5, True),
        ("a = 0.5", {"a": -0.6}, -0.6, False),
        ("a = [0.4, 0.5]", {"a": 0.4}, 0.4, True),
        ("a = [0.4, 0.5]", {"a": -0.45}, -0.45, False),
        ("a = 0.5", {"a": None}, None, False),
        ("a = 0.5", {}, None, False),
        ('"a * b" = 2', {"a": -0.5, "b": 4}, -2.0, True),
        ('"a/b" = 0.1', {"a": 0.5, "b": 4.0}, 0.125, False),
        ('"a / b" = 0.1', {"a": 0.5, "b": 0.0}, None, False),
        ("a.b_m = 0", {"a.b_m": 0}, 0.0, True),
    ],
)
def test_requirements(
    text: str,
    row: dict[str, Any],
    value: float | None,
    is_kept: bool,
    write_study: WriteStudy,
) -> None:
    """Limits of a size or a range; what is not defined is not kept."""
    plan = load_plan(write_study(ROLL + f"[cases.require]\n{text}\n"))
    [requirement] = plan.cases[0].requirements
    assert requirement.evaluate(row) == value
    assert requirement.is_kept(value) is is_kept


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ('scenario = "stand"\n' + ROLL, "scenario = 'stand' is not valid: nothing"),
        ('[[cases]]\nscenario = "stand"', "cases.0.name = ''"),
        ('[[cases]]\nname = "a"', "cases.0.scenario = ''"),
        (ROLL + PUSH.replace("push", "roll", 1), "cases.1.name = 'roll'"),
        (ROLL + "seed = 3", "cases.0.seed = 3 is not valid: no such key; the keys of"),
        (ROLL.replace("roll-to", "rol"), "cases.0.scenario = 'rol' is not valid: one"),
        (ROLL + "duration_s = 0", "cases.0.duration_s = 0"),
        (ROLL + "[cases.base]\nforce = 1", "force = 1"),
        (ROLL + "[cases.base]\nseed = 1", "cases.0.base.seed"),
        (ROLL + "[cases.base]\nball.radius_m = 9", "(case 'roll')"),
        (
            PUSH + "[cases.base]\nforce = 1.0\npush.0.force_n = 2.0",
            "cases.0.base.push.0.force_n = 'push.0.force_n' is not valid: a key that",
        ),
        (
            PUSH + "[cases.base]\nforce = 1.0\n[cases.each]\nforce = [2.0]",
            "cases.0.each.force = [2.0]",
        ),
        (PUSH + "[cases.each]\nforce = []", "cases.0.each.force = []"),
        (RADIUS + ROLL + "[cases.base]\nball.radius_m = 0.5", "factors.0.key ="),
        (
            '[[factors]]\nkey = "force"\nvalues = [1.0, 2.0]\n' + PUSH + ROLL,
            "(case 'roll')",
        ),
        (
            '[[factors]]\nkey = "duration_s"\nvalues = [1.0]\n' + ROLL + "duration_s=2",
            "cases.0.duration_s = 2.0 is not valid: nothing: a factor is",
        ),
        (
            RADIUS + ROLL + "[cases.only]\nball.radius_m = [0.5, 0.6]",
            "cases.0.only.ball.radius_m = 0.6 is not valid: some of 0.5, 0.75, 1.0",
        ),
        (
            RADIUS + ROLL + "[cases.only]\nball.mass_kg = [30.0]",
            "cases.0.only.ball.mass_kg = [30.0]",
        ),
        (
            ROLL + "[cases.require]\nball_angel_error = 0.02",
            "cases.0.require.ball_angel_error = 'ball_angel_error' is not valid: one",
        ),
        (
            ROLL + '[cases.require]\n"ball_angle_error / targt" = 0.02',
            "cases.0.require.ball_angle_error / targt = 'targt' is not valid: one of",
        ),
        (ROLL + "[cases.require]\nfall_reason = 1", "= 'fall_reason'"),
        (ROLL + "[cases.require]\nstep_count = -1", "require.step_count = -1"),
        (ROLL + "[cases.require]\nstep_count = true", "require.step_count = True"),
        (ROLL + "[cases.require]\nstep_count = [3, 1]", "require.step_count = [3, 1]"),
        (ROLL + "[cases.require]\nstep_count = [3]", "require.step_count = [3]"),
        (ROLL + '[cases.require]\n"a + b" = 1', "cases.0.require.a + b = 1"),
        (ROLL + "require = 3", "cases.0.require = 3"),
    ],
)
def test_bad_cases_are_refused_in_one_line(
    text: str, part: str, refuse: Refuse
) -> None:
    """The line names file, key, value and what is valid."""
    assert part in refuse(text + "\n")


def _summary(plan: Plan, cell: int, seed: int) -> dict[str, Any]:
    """Cell 1 has one error that is too large, cell 3 a fall, cell 4 no overshoot."""
    target = (1.0, -4.0, 0.0)[plan.cells[cell].case]
    return {
        "survived": (cell, seed) != (3, 2),
        "simulated_time": 0.1,
        "step_count": seed,
        "target_ball_angle": target,
        "ball_angle_error": -0.03 if (cell, seed) == (1, 3) else 0.001 * seed,
        "ball_angle_overshoot": None if (cell, seed) == (4, 0) else 0.01,
        "ball_speed_mean": 9.0 if (cell, seed) == (3, 2) else 0.01 * (seed - 1),
    }


def _run(plan: Plan) -> list[Outcome]:
    """Run 1 of cell 5 gives no result."""
    return [
        Outcome(cell.index, seed, "timeout", {}, message="took too long")
        if (cell.index, seed) == (5, 1)
        else Outcome(cell.index, seed, FINISHED, _summary(plan, cell.index, seed))
        for cell in plan.cells
        for seed in plan.study.seeds
    ]


def test_verdicts_count_what_was_kept(write_study: WriteStudy) -> None:
    """One run that is short makes its cell short, for whatever reason."""
    plan = load_plan(write_study(STUDY))
    verdicts = judge(plan, make_rows(plan, _run(plan)))
    counts = [(v.tally.n_runs, v.tally.n_survived, v.tally.n_met) for v in verdicts]
    full = (4, 4, 4)
    assert counts == [
        full,
        (4, 4, 3),
        full,
        (4, 3, 3),
        (4, 4, 3),
        (4, 3, 3),
        full,
        full,
    ]
    is_met = [v.tally.is_met for v in verdicts]
    assert is_met == [True, False, True, False, False, False, True, True]
    error, overshoot, speed = verdicts[1].extremes
    assert (error.size, error.is_kept) == (0.03, False)
    assert (overshoot.size, overshoot.is_kept) == (0.01, True)
    assert (speed.least, speed.greatest, speed.is_kept) == (-0.01, 0.02, True)
    # The fall does not spoil the extremes, which are those of the survivors.
    assert verdicts[3].extremes[2].greatest == 0.02
    assert verdicts[3].extremes[1].size == 0.0025
    assert (verdicts[4].extremes[1].n_undefined, verdicts[4].extremes[1].is_kept) == (
        1,
        False,
    )
    assert verdicts[5].tally.n_lost == 1
    roll = tally(verdicts, lambda cell: cell.case == 0)
    assert roll is not None
    assert (roll.n_runs, roll.n_met, roll.is_met) == (12, 11, False)
    assert tally(verdicts, lambda cell: cell.case == 9) is None


def _report(plan: Plan) -> tuple[str, Mapping[str, Any], dict[str, bytes]]:
    outcomes = _run(plan)
    rows = make_rows(plan, outcomes)
    verdicts, analysis = judge(plan, rows), analyse(plan.study, rows)
    drawn = dict(render_cases(plan, verdicts))
    report = format_report(plan, analysis, outcomes, {}, drawn, verdicts)
    return report, build_json(plan, analysis, outcomes, {}, verdicts), drawn


def test_report_says_what_is_short(write_study: WriteStudy) -> None:
    """Worst numbers beside their limits, the verdict, one picture."""
    report, numbers, drawn = _report(load_plan(write_study(STUDY)))
    assert "4 of 8 cells met all that their cases require" in report
    assert "| roll, target_angle = 1 | roll-to | 0.2 | 2/3 | 11/12 | 100.0%" in report
    short = next(line for line in report.splitlines() if "**0.03**" in line)
    assert "ball_angle_error **0.03** (at most 0.02); " in short
    assert "ball_speed_mean -0.01 to 0.02 (-0.1 to 0.1) | 1.5 | 3/4 | short |" in short
    assert "0.0025, undefined in 1" in report.replace("*", "")
    assert "4 (1 lost)" in report
    assert list(drawn) == ["cases.png"]
    assert drawn["cases.png"].startswith(b"\x89PNG")
    assert "](cases.png)" in report
    assert numbers["cells_met"] == 4
    assert [len(case["cells"]) for case in numbers["cases"]] == [3, 3, 2]
    cell = numbers["cases"][1]["cells"][0]
    assert (cell["runs"], cell["survived"], cell["verdict"]) == (4, 3, "short")
    assert cell["survival_95_percent"] == wilson_interval(3, 4)
    assert cell["required"][0]["limit"] == 0.02
    assert cell["required"][2]["limit"] == [-0.1, 0.1]
    json.dumps(numbers, allow_nan=False)


def test_report_without_factors_has_one_column(write_study: WriteStudy) -> None:
    """A study may have cases only."""
    text = "seeds = 1\nduration_s = 0.1\n" + ROLL + PUSH
    report, numbers, drawn = _report(load_plan(write_study(text)))
    assert "2 of 2 cells met" in report
    assert numbers["cells_met"] == 2
    assert list(drawn) == ["cases.png"]


def test_study_with_cases_leaves_its_files(
    write_study: WriteStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same rows for one worker and two; a finished study has exit code 0.

    The runs end before a target is set, so no overshoot is a part of it.
    """
    file, out = write_study(STUDY), tmp_path / "one"
    words = ["study", str(file), "--workers"]
    assert cli.main([*words, "1", "--out", str(out)]) == 0
    assert "2 of 8 cells met all" in capsys.readouterr().out
    names = {path.name for path in out.iterdir()}
    files = {"cases.png", "report.json", "report.md", "results.parquet", "study.toml"}
    assert names == files | {"cases", "ledger.sqlite"}
    assert len(list((out / "cases").iterdir())) == 3
    rows = pq.read_table(out / "results.parquet").to_pylist()
    assert list(rows[0])[:5] == ["cell", "case", "ball.radius_m", "seed", "status"]
    assert [row["case"] for row in rows[::4]] == [
        *["roll, target_angle = 1"] * 3,
        *["roll, target_angle = -4"] * 3,
        *["push"] * 2,
    ]
    assert [row["scenario"] for row in rows[::4]] == ["roll-to"] * 6 + ["push"] * 2
    assert cli.main([*words, "2", "--out", str(tmp_path / "two")]) == 0
    content = (out / "results.parquet").read_bytes()
    assert (tmp_path / "two" / "results.parquet").read_bytes() == content


def test_a_limit_that_nobody_keeps_is_reported(
    write_study: WriteStudy, tmp_path: Path
) -> None:
    """Real runs that stay up and are short; still a finished study."""
    text = "seeds = 2\nduration_s = 0.1\n" + ROLL + "[cases.require]\n"
    file = write_study(text + "simulated_time = [0.2, 0.3]\n")
    out = tmp_path / "out"
    assert cli.main(["study", str(file), "--workers", "1", "--out", str(out)]) == 0
    numbers = json.loads((out / "report.json").read_text())
    assert (numbers["survived"], numbers["cells_met"]) == (2, 0)


def test_limits_are_checked_with_the_own_summary(write_study: WriteStudy) -> None:
    """`check_plan` runs each case: what it requires must be in its own summary."""
    plan = load_plan(write_study(STUDY))
    check_plan(plan)
    with pytest.raises(ConfigError, match=r"each\.force"):
        Case("a", "push", base={"force": 1.0}, each={"force": (2.0,)})
    assert Requirement("a * b", None, 1.0).names == ("a", "b")
