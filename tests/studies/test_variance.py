"""Sobol indices: known functions, chance, and what a study makes of its rows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballsim.studies.analysis import analyse
from ballsim.studies.design import load_plan
from ballsim.studies.figures import render
from ballsim.studies.report import build_json, format_report
from ballsim.studies.sampling import SamplingConfig, design_points
from ballsim.studies.single_run import FINISHED, Outcome
from ballsim.studies.table import make_rows
from ballsim.studies.variance import VarianceIndices, estimate_indices

WriteStudy = Callable[..., Path]
KEYS = ("a", "b", "c")
STUDY = """
scenario = "stand"
metrics = ["ball_angle_error"]
seeds = 2
[sampling]
method = "saltelli"
count = 128
[[factors]]
key = "robot.com_offset_y_m"
range = [-0.01, 0.01]
[[factors]]
key = "robot.mass_scale"
range = [0.8, 1.2]
"""


def _estimate(count: int, seed: int = 0) -> VarianceIndices:
    """Return the indices of Ishigami's function, a = 7, b = 0.1."""
    sampling = SamplingConfig("saltelli", count, seed)
    x = np.pi * (2.0 * np.array(design_points(sampling, 3)) - 1.0)
    y = np.sin(x[:, 0]) * (1.0 + 0.1 * x[:, 2] ** 4) + 7.0 * np.sin(x[:, 1]) ** 2
    generator = np.random.default_rng(seed)
    found = estimate_indices(KEYS, y.reshape(5, count), generator, n_bootstrap=100)
    assert found is not None
    return found


# Ishigami and Homma 1990, from the parts of the variance in closed form.
_ALONE = (0.5 * (1.0 + 0.1 * np.pi**4 / 5.0) ** 2, 7.0**2 / 8.0, 0.0)
_TOGETHER = 0.1**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)  # of the first and the third
_ALL = sum(_ALONE) + _TOGETHER
FIRST = tuple(part / _ALL for part in _ALONE)
TOTAL = (FIRST[0] + _TOGETHER / _ALL, FIRST[1], _TOGETHER / _ALL)


def test_indices_of_ishigami() -> None:
    """No monotonic effect of b, none of c on its own: all are found."""
    found = _estimate(4096)
    for key, first, total in zip(KEYS, FIRST, TOTAL, strict=True):
        assert found.first[key].value == pytest.approx(first, abs=0.02)
        assert found.total[key].value == pytest.approx(total, abs=0.02)


def test_intervals_hold_the_true_indices_about_as_often_as_they_say() -> None:
    """Of 20 designs with 6 indices each, most of the 120 intervals hold the truth."""
    hits = 0
    for seed in range(20):
        found = _estimate(256, seed)
        for key, first, total in zip(KEYS, FIRST, TOTAL, strict=True):
            hits += found.first[key].low <= first <= found.first[key].high
            hits += found.total[key].low <= total <= found.total[key].high
    assert hits >= 102  # 85 %


def test_what_is_missing_or_constant_has_no_indices() -> None:
    """One missing value is enough: it would be missing where factors are extreme."""
    generator = np.random.default_rng(0)
    values = generator.random((5, 8))
    assert estimate_indices(KEYS, values, generator) is not None
    values[3, 2] = np.nan
    assert estimate_indices(KEYS, values, generator) is None
    assert estimate_indices(KEYS, np.ones((5, 8)), generator) is None


def test_study_finds_an_effect_of_either_sign(write_study: WriteStudy) -> None:
    """The robot falls if the CoM is off to either side; ranks cannot see that."""
    plan = load_plan(write_study(STUDY))
    outcomes = []
    for cell in plan.cells:
        offset = abs(float(cell.values["robot.com_offset_y_m"]))
        for seed in plan.study.seeds:
            is_up = offset < 0.005 + 0.001 * seed
            summary = {
                "survived": is_up,
                "simulated_time": 60.0 if is_up else 5.0,
                "ball_angle_error": 0.01,
            }
            outcomes.append(Outcome(cell.index, seed, FINISHED, summary))
    rows = make_rows(plan, outcomes)
    analysis = analyse(plan.study, rows)
    assert set(analysis.indices) == {"survived", "simulated_time"}
    found = analysis.indices["survived"]
    assert found.first["robot.com_offset_y_m"].value == pytest.approx(1.0, abs=0.1)
    assert found.total["robot.mass_scale"].value == 0.0
    assert analysis.sensitivities["survived"].explained < 0.2
    drawn = dict(render(plan.study, analysis))
    assert drawn["indices.png"].startswith(b"\x89PNG")
    assert "](indices.png)" in format_report(plan, analysis, outcomes, {}, drawn)
    numbers = build_json(plan, analysis, outcomes, {})["sobol_indices"]
    assert numbers["survived"]["total"]["robot.mass_scale"]["value"] == 0.0
    # A cell whose runs were all lost leaves a gap.
    del rows[:2]
    assert not analyse(plan.study, rows).indices
