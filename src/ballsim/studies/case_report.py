"""What the report says of cases: which cells met their requirements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ballsim.studies.design import Plan
from ballsim.studies.markdown import (
    format_median,
    format_share,
    format_table,
    format_value,
)
from ballsim.studies.survival import wilson_interval
from ballsim.studies.table import Row
from ballsim.studies.verdicts import Extremes, Tally, Verdict, tally

__all__ = [
    "CASES_CAPTION",
    "PUSHES_CAPTION",
    "build_case_json",
    "describe_verdicts",
    "format_cases",
]

MET, SHORT = "met", "short"
_MAX_CELLS = 400  # of the table
_COUNTED = ("cells met", "runs that met all", "survival")
CASES_CAPTION = (
    "Runs that stayed up and kept all that their case requires, out of all runs."
)
PUSHES_CAPTION = (
    "Largest of the tried forces that every run bore, and with it all smaller ones, by "
    "the direction of the push: forwards is up, to the left is left."
)


def describe_verdicts(verdicts: Sequence[Verdict]) -> str:
    """Return how many cells met their requirements, in words.

    Args:
        verdicts: All verdicts.
    """
    n_met = sum(verdict.tally.is_met for verdict in verdicts)
    return f"{n_met} of {len(verdicts)} cells met all that their cases require"


def format_cases(
    plan: Plan, verdicts: Sequence[Verdict], rows: Sequence[Row]
) -> list[str]:
    """Return the parts of the report on cases and their cells.

    Args:
        plan: A study with cases.
        verdicts: Its verdicts.
        rows: Its finished runs.
    """
    text = (
        f"A cell is *{MET}* if each of its runs stayed up and kept all limits, else "
        f"*{SHORT}*; a run without a result is one that did not."
    )
    parts = ["## Cases", text, _case_table(plan, verdicts)]
    if plan.variants:
        parts += ["## Variants", "All cases together.", _variant_table(plan, verdicts)]
    parts += ["## Cells"]
    is_sampled = any(factor.is_sampled for factor in plan.study.factors)
    if is_sampled or len(plan.cells) > _MAX_CELLS:
        text = f"{len(plan.cells)} cells: each run is a row of `results.parquet`."
        return [*parts, text]
    text = (
        "Limited numbers: the largest size, or the least and the greatest value, among "
        "the runs that survived, and the limits; bold where a run did not keep them."
    )
    if plan.study.metrics:
        text += " Other numbers: median of the size among these runs."
    return [*parts, text, _cell_table(plan, verdicts, rows)]


def build_case_json(plan: Plan, verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Return the numbers on cases as JSON can hold them.

    Args:
        plan: A study with cases.
        verdicts: Its verdicts.
    """
    return {
        "cells_met": sum(verdict.tally.is_met for verdict in verdicts),
        "cases": [
            {
                "case": case.name,
                "scenario": case.scenario,
                "duration": plan.bases[i].duration,
                "cells": [_cell_json(v) for v in verdicts if v.cell.case == i],
            }
            for i, case in enumerate(plan.cases)
        ],
    }


def _cell_json(verdict: Verdict) -> dict[str, Any]:
    counts = verdict.tally
    return {
        "cell": verdict.cell.index,
        "values": dict(verdict.cell.values),
        "runs": counts.n_runs,
        "lost": counts.n_lost,
        "survived": counts.n_survived,
        "survival_95_percent": _interval(counts),
        "met_all": counts.n_met,
        "verdict": _word(counts.is_met),
        "required": [
            {
                "number": extremes.requirement.text,
                "limit": extremes.requirement.high
                if extremes.requirement.low is None
                else [extremes.requirement.low, extremes.requirement.high],
                "least": extremes.least,
                "greatest": extremes.greatest,
                "undefined": extremes.n_undefined,
                "kept": extremes.is_kept,
            }
            for extremes in verdict.extremes
        ],
    }


def _interval(counts: Tally) -> tuple[float, float] | None:
    if not counts.n_finished:
        return None
    return wilson_interval(counts.n_survived, counts.n_finished)


def _word(is_met: bool) -> str:
    return MET if is_met else SHORT


def _case_table(plan: Plan, verdicts: Sequence[Verdict]) -> str:
    head = ("case", "scenario", "s a run", *_COUNTED)
    lines = []
    for i, case in enumerate(plan.cases):
        counts = _count([verdict for verdict in verdicts if verdict.cell.case == i])
        if counts:
            duration = f"{plan.bases[i].duration:g}"
            lines.append([case.name, case.scenario, duration, *counts])
    return format_table(head, lines)


def _variant_table(plan: Plan, verdicts: Sequence[Verdict]) -> str:
    lines = []
    for name, cases in plan.variants:
        counts = _count([verdict for verdict in verdicts if verdict.cell.case in cases])
        if counts:
            lines.append([name, *counts])
    return format_table(("variant", *_COUNTED), lines)


def _count(verdicts: Sequence[Verdict]) -> list[str]:
    """Return the fields of the columns `_COUNTED`, none if there are no runs."""
    counts = tally(verdicts, lambda _: True)
    if counts is None:
        return []
    n_met = sum(verdict.tally.is_met for verdict in verdicts)
    return [
        f"{n_met}/{len(verdicts)}",
        f"{counts.n_met}/{counts.n_runs}",
        _survival(counts),
    ]


def _cell_table(plan: Plan, verdicts: Sequence[Verdict], rows: Sequence[Row]) -> str:
    factors, metrics = plan.study.factors, plan.study.metrics
    names = [factor.name for factor in factors]
    head = ["case", *names, "runs", "fell", "survival (95 %)", "limited numbers"]
    head += [*metrics, "met all", "verdict"]
    by_cell: dict[int, list[Row]] = {}
    for row in rows:
        if row["survived"]:
            by_cell.setdefault(row["cell"], []).append(row)
    lines = []
    for verdict in verdicts:
        cell, counts = verdict.cell, verdict.tally
        up = by_cell.get(cell.index, [])
        lines.append(
            [
                plan.cases[cell.case].name,
                *(format_value(cell.values[factor.key]) for factor in factors),
                str(counts.n_runs)
                + (f" ({counts.n_lost} lost)" if counts.n_lost else ""),
                str(counts.n_finished - counts.n_survived),
                _survival(counts),
                "; ".join(map(_describe_extremes, verdict.extremes)) or "-",
                *(format_median(up, metric) for metric in metrics),
                f"{counts.n_met}/{counts.n_runs}",
                _word(counts.is_met),
            ]
        )
    return format_table(head, lines)


def _survival(counts: Tally) -> str:
    if not counts.n_finished:
        return "-"
    return format_share(counts.n_survived, counts.n_finished)


def _describe_extremes(extremes: Extremes) -> str:
    """Return it as in ``ball_angle_error **0.0311** (at most 0.02)``."""
    limits = extremes.requirement
    if extremes.size is None or extremes.least is None or extremes.greatest is None:
        worst = "-"
    elif limits.low is None:
        worst = f"{extremes.size:.3g}"
    else:
        worst = f"{extremes.least:.4g} to {extremes.greatest:.4g}"
    if not extremes.is_kept:
        worst = f"**{worst}**"
    if extremes.n_undefined:
        worst += f", undefined in {extremes.n_undefined}"
    valid = f"at most {limits.high:g}"
    if limits.low is not None:
        valid = f"{limits.low:g} to {limits.high:g}"
    return f"{limits.text} {worst} ({valid})"
