"""From rows to report: groups, counts, pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from ballsim.studies.analysis import Analysis, analyse, pick_axis
from ballsim.studies.design import Cell, Plan, load_plan
from ballsim.studies.figures import render
from ballsim.studies.report import build_json, format_report
from ballsim.studies.single_run import FINISHED, Outcome
from ballsim.studies.table import make_rows

WriteStudy = Callable[..., Path]

HEAD = 'scenario = "stand"\nmetrics = ["ball_angle_error"]\nseeds = 8\n'
FRICTION = '[[factors]]\nkey = "scene.sole_friction"\nlabel = "friction"\n'
GRID = f"""{HEAD}
{FRICTION}
values = [0.1, 0.2, 0.5, 1.0]
scale = "log"
harder = "low"
[[factors]]
key = "ball.radius_m"
values = [0.5, 1.0]
[[factors]]
key = "controller.name"
values = ["wheeled-lip", "paper"]
"""
SAMPLED = f"""{HEAD}
[sampling]
count = 32
{FRICTION}
range = [0.1, 1.0]
harder = "low"
[[factors]]
key = "ball.radius_m"
range = [0.3, 1.0]
"""


def _survives(values: Mapping[str, Any], seed: int) -> bool:
    """Slippery soles fell most, the paper's controller falls always."""
    is_up = float(values["scene.sole_friction"]) > 0.1 + 0.03 * seed
    return is_up and values.get("controller.name") != "paper"


def _run(cell: Cell, seed: int) -> Outcome:
    if cell.index == 1 and seed == 0:
        return Outcome(cell.index, seed, "timeout", {}, message="took | too long")
    is_up = _survives(cell.values, seed)
    return Outcome(
        cell=cell.index,
        seed=seed,
        status=FINISHED,
        summary={
            "survived": is_up,
            "simulated_time": 60.0 if is_up else 1.0 + seed,
            "ball_angle_error": -0.01 * (1 + seed) if is_up else 9.0,
        },
    )


def _analyse(plan: Plan) -> tuple[Analysis, list[Outcome]]:
    outcomes = [_run(cell, seed) for cell in plan.cells for seed in plan.study.seeds]
    return analyse(plan.study, make_rows(plan, outcomes)), outcomes


def test_groups_split_the_finished_runs(write_study: WriteStudy) -> None:
    """One curve for each combination of the other factors; lost runs count nowhere."""
    plan = load_plan(write_study(GRID))
    analysis, _ = _analyse(plan)
    assert analysis.axis is not None
    assert analysis.axis.key == "scene.sole_friction"
    assert [group.label for group in analysis.groups] == [
        f"ball.radius_m {radius}, controller.name {name}"
        for radius in ("0.5", "1")
        for name in ("wheeled-lip", "paper")
    ]
    n_points = sum(p.n_runs for g in analysis.groups for p in g.points)
    assert n_points == len(analysis.rows) == plan.n_runs - 1
    assert len(analysis.lost) == 1
    paper = analysis.groups[1]
    assert [point.n_survived for point in paper.points] == [0] * 4
    assert paper.fit is not None
    assert paper.fit.levels[0].describe().startswith("above 1")


def test_metrics_are_sizes_among_the_survivors(write_study: WriteStudy) -> None:
    """Median and quartiles of |error|; the 9 rad of those that fell do not count."""
    plan = load_plan(write_study(GRID))
    best = _analyse(plan)[0].groups[0].points[-1]
    assert best.level == 1.0
    assert best.quartiles["ball_angle_error"] == pytest.approx((0.0275, 0.045, 0.0625))


def test_bins_of_a_sampled_axis_hold_every_run(write_study: WriteStudy) -> None:
    """Ten bins with as many cells each, in the order of the factor."""
    plan = load_plan(write_study(SAMPLED))
    analysis, _ = _analyse(plan)
    [group] = analysis.groups
    levels = [point.level for point in group.points]
    assert levels == sorted(levels)
    assert sum(point.n_runs for point in group.points) == len(analysis.rows)
    assert {point.n_runs for point in group.points} <= {23, 24, 31, 32}
    assert [factor.key for factor in analysis.averaged] == ["ball.radius_m"]
    ranking = analysis.sensitivities["survived"].coefficients
    assert ranking["scene.sole_friction"] > 0.6 > abs(ranking["ball.radius_m"])


def test_many_combinations_are_averaged(write_study: WriteStudy) -> None:
    """More than eight curves: the last factors are averaged over, and named."""
    more = GRID.replace("[0.5, 1.0]\n[[", "[0.3, 0.4, 0.5, 0.6, 0.7]\n[[")
    analysis, _ = _analyse(load_plan(write_study(more)))
    assert len(analysis.groups) == 5
    assert [factor.key for factor in analysis.averaged] == ["controller.name"]


def test_axis_is_the_factor_with_a_hard_end(write_study: WriteStudy) -> None:
    """It comes before one with more levels; `axis` comes before all."""
    more = GRID.replace("[0.5, 1.0]\n[[", "[0.3, 0.4, 0.5, 0.6, 0.7]\n[[")
    study = load_plan(write_study(more)).study
    assert getattr(pick_axis(study), "key", None) == "scene.sole_friction"
    study = load_plan(write_study('axis = "ball.radius_m"\n' + more)).study
    assert getattr(pick_axis(study), "key", None) == "ball.radius_m"


@pytest.mark.parametrize(
    ("text", "pictures"),
    [
        (GRID, {"survival", "time_to_fall", "metrics", "map_1", "sensitivity"}),
        (SAMPLED, {"survival", "time_to_fall", "metrics", "map_1", "sensitivity"}),
        (HEAD, {"survival", "time_to_fall", "metrics"}),
    ],
)
def test_report_names_pictures_and_lost_runs(
    text: str, pictures: set[str], write_study: WriteStudy
) -> None:
    """Every picture is drawn and stands in the report; so does what was lost."""
    plan = load_plan(write_study(text))
    if not plan.study.factors:
        outcomes = [
            Outcome(0, s, FINISHED, {"survived": s > 0, "simulated_time": 1.0})
            for s in plan.study.seeds
        ]
        analysis = analyse(plan.study, make_rows(plan, outcomes))
    else:
        analysis, outcomes = _analyse(plan)
    drawn = dict(render(plan.study, analysis))
    assert set(drawn) == {f"{name}.png" for name in pictures}
    assert all(content.startswith(b"\x89PNG") for content in drawn.values())
    report = format_report(plan, analysis, outcomes, {"mujoco": "4.0"}, drawn)
    assert all(f"]({name})" in report for name in drawn)
    assert plan.digest in report
    if analysis.lost:
        assert "took \\| too long" in report
    numbers = build_json(plan, analysis, outcomes, {"mujoco": "4.0"})
    assert numbers["survived"] + numbers["fell"] + numbers["lost"] == plan.n_runs
