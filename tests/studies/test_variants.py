"""Studies whose cases run in several variants: cells, refusals, report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from ballsim.studies.analysis import analyse
from ballsim.studies.design import Plan, load_plan
from ballsim.studies.figures import render_cases
from ballsim.studies.report import format_report
from ballsim.studies.single_run import FINISHED, Outcome
from ballsim.studies.table import make_rows
from ballsim.studies.verdicts import judge

WriteStudy = Callable[..., Path]
Refuse = Callable[[str], str]

RADIUS = '[[factors]]\nkey = "ball.radius_m"\nvalues = [0.5, 1.0]\n'
CASES = """
[[cases]]
name = "roll"
scenario = "roll-to"
[cases.each]
target_angle = [1.0, -4.0]
[cases.require]
ball_angle_error = 0.02
[[cases]]
name = "push"
scenario = "push"
[cases.only]
ball.radius_m = [1.0]
[cases.base]
force = 60.0
"""
SOLID = '[[variants]]\nname = "solid"\n[variants.base]\nball.inertia = "solid"\n'
HEAVY = '[[variants]]\nname = "heavy"\n[variants.base]\nrobot.mass_scale = 1.05\n'
STUDY = f"seeds = 2\nduration_s = 0.1\n{RADIUS}{CASES}"


def test_every_case_runs_in_every_variant(write_study: WriteStudy) -> None:
    """A variant's cells are those of the study without, its values besides."""
    plain = load_plan(write_study(STUDY))
    plan = load_plan(write_study(STUDY + SOLID + HEAVY))
    names = [case.name for case in plain.cases]
    assert [case.name for case in plan.cases] == [
        f"{variant}: {name}" for variant in ("solid", "heavy") for name in names
    ]
    assert plan.variants == [("solid", range(3)), ("heavy", range(3, 6))]
    assert plain.variants == []
    n_cells = len(plain.cells)
    for cell, twin in zip(plan.cells, plain.cells * 2, strict=True):
        config = cell.config
        robot, ball = config.robot, config.ball
        if cell.index < n_cells:
            assert (ball.inertia, robot.mass_scale) == ("solid", 1.0)
        else:
            assert (ball.inertia, robot.mass_scale) == (twin.config.ball.inertia, 1.05)
        assert (
            replace(config, robot=twin.config.robot, ball=twin.config.ball)
            == twin.config
        )


def test_a_variant_without_values_changes_the_names_only(
    write_study: WriteStudy,
) -> None:
    """Limit case: the world as it is."""
    plain = load_plan(write_study(STUDY))
    plan = load_plan(write_study(STUDY + '[[variants]]\nname = "as it is"\n'))
    assert [c.config for c in plan.cells] == [c.config for c in plain.cells]
    assert plan.digest != plain.digest


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (SOLID, "variants = ['solid'] is not valid: nothing: variants are of cases"),
        (CASES + "[[variants]]\n", "variants.0.name = ''"),
        (
            RADIUS + CASES + SOLID + SOLID,
            "variants.1.name = 'solid' is not valid: a name that",
        ),
        (
            RADIUS + CASES + SOLID.replace('ball.inertia = "solid"', "force = 9.0"),
            "variants.0.base.force = 9.0 is not valid: nothing: cases.1 sets it",
        ),
        (
            RADIUS
            + CASES
            + SOLID.replace('ball.inertia = "solid"', "target_angle = 9.0"),
            "variants.0.base.target_angle = 9.0 is not valid: nothing: cases.0 sets it",
        ),
        (
            RADIUS + CASES + SOLID.replace('"solid"\n', '"sold"\n'),
            "(case 'sold: roll, ",
        ),
        (RADIUS + CASES + SOLID + "ball.radius_m = 0.5\n", "factors.0.key ="),
    ],
)
def test_bad_variants_are_refused_in_one_line(
    text: str, part: str, refuse: Refuse
) -> None:
    """The line names file, key, value and what is valid."""
    assert part in refuse(text + "\n")


def _run(plan: Plan) -> list[Outcome]:
    """All survive; in the second variant -4 rad is missed once on the larger ball."""
    missed = next(
        cell.index
        for cell in plan.cells
        if cell.case == 4 and cell.config.ball.radius == 1.0
    )
    return [
        Outcome(
            cell.index,
            seed,
            FINISHED,
            {
                "survived": True,
                "simulated_time": 0.1,
                "ball_angle_error": 0.1 if (cell.index, seed) == (missed, 1) else 0.0,
            },
        )
        for cell in plan.cells
        for seed in plan.study.seeds
    ]


def test_the_report_sums_each_variant(write_study: WriteStudy) -> None:
    """A line for each of them beside those of the cases, and a row in the picture."""
    plan = load_plan(write_study(STUDY + SOLID + HEAVY))
    outcomes = _run(plan)
    rows = make_rows(plan, outcomes)
    verdicts = judge(plan, rows)
    drawn = dict(render_cases(plan, verdicts))
    analysis = analyse(plan.study, rows)
    report = format_report(plan, analysis, outcomes, {}, drawn, verdicts)
    _, _, variants = report.partition("## Variants")
    assert "| solid | 5/5 | 10/10 | 100.0%" in variants
    assert "| heavy | 4/5 | 9/10 | 100.0%" in variants
    assert "| heavy: roll, target_angle = -4 | roll-to | 0.1 | 1/2 | 3/4 |" in report
    assert drawn["cases.png"].startswith(b"\x89PNG")
