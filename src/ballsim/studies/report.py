"""The report of a study, as Markdown and as JSON."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ballsim.studies.analysis import Analysis, Group, count_survival
from ballsim.studies.design import Plan
from ballsim.studies.factors import Value, describe, is_number
from ballsim.studies.single_run import Outcome
from ballsim.studies.survival import wilson_interval
from ballsim.studies.table import Row

__all__ = ["build_json", "format_report"]

_MAX_CELLS = 200  # of the table
_MAX_LOST = 20
_CAPTIONS = {
    "survival": "Survival with 95 % Wilson intervals{fit}.",
    "time_to_fall": "Time to the fall (Kaplan-Meier, 95 % bands); runs that were still "
    "up when they ended count as censored.",
    "metrics": "Size of each metric among the runs that survived: median, quartiles.",
    "map": "Survival over two factors.",
    "sensitivity": "Standardised rank regression: how many standard deviations the "
    "rank of each quantity moves with that of each factor; 95 % bootstrap intervals.",
}


def format_report(
    plan: Plan,
    analysis: Analysis,
    outcomes: Sequence[Outcome],
    versions: Mapping[str, str],
    figures: Iterable[str],
) -> str:
    """Return the report as Markdown.

    Args:
        plan: The study.
        analysis: Its numbers.
        outcomes: Its runs.
        versions: Versions and revision of the code that made them.
        figures: Names of the pictures beside the report.
    """
    parts = [
        f"# {plan.name}",
        plan.study.description,
        _overview(plan, analysis, outcomes),
    ]
    parts += _levels(analysis)
    for name in figures:
        stem = name.removesuffix(".png").rstrip("_0123456789")
        is_fitted = any(group.fit is not None for group in analysis.groups)
        fit = " and the logistic fit" if is_fitted else ""
        caption = _CAPTIONS[stem].format(fit=fit) + _averaging(plan, analysis, stem)
        parts.append(f"![{stem}]({name})\n\n{caption}")
    parts += _cells(plan, analysis)
    parts += _lost(plan, outcomes)
    parts.append("## Provenance")
    rows = [("study (SHA-256)", plan.digest), *sorted(versions.items())]
    parts.append(_table(("what", "which"), rows))
    return "\n\n".join(parts) + "\n"


def build_json(
    plan: Plan,
    analysis: Analysis,
    outcomes: Sequence[Outcome],
    versions: Mapping[str, str],
) -> dict[str, Any]:
    """Return the numbers of the report as JSON can hold them."""
    return {
        "study": plan.name,
        "digest": plan.digest,
        "cells": len(plan.cells),
        **_counts(analysis, outcomes),
        "axis": None if analysis.axis is None else analysis.axis.key,
        "groups": [_group_json(group) for group in analysis.groups],
        "sensitivities": {
            name: {"explained": found.explained, "coefficients": found.coefficients}
            for name, found in analysis.sensitivities.items()
        },
        "versions": dict(versions),
    }


def _group_json(group: Group) -> dict[str, Any]:
    return {
        "label": group.label,
        "values": dict(group.values),
        "points": [
            {
                "level": point.level,
                "runs": point.n_runs,
                "survived": point.n_survived,
                "survival_95_percent": point.interval,
                "quartiles": dict(point.quartiles),
            }
            for point in group.points
        ],
        "levels": [
            {
                "survival": level.share,
                "value": level.value,
                "interval_95_percent": [level.low, level.high],
                "words": level.describe(),
            }
            for level in (group.fit.levels if group.fit else ())
        ],
    }


def _counts(analysis: Analysis, outcomes: Sequence[Outcome]) -> dict[str, int]:
    n_up = sum(point.n_survived for g in analysis.groups for point in g.points)
    return {
        "runs": len(outcomes),
        "survived": n_up,
        "fell": len(analysis.rows) - n_up,
        "lost": len(analysis.lost),
        "started_twice": sum(outcome.attempts > 1 for outcome in outcomes),
    }


def _overview(plan: Plan, analysis: Analysis, outcomes: Sequence[Outcome]) -> str:
    counts = _counts(analysis, outcomes)
    n_finished = len(analysis.rows)
    lines = [
        f"- scenario `{plan.study.scenario}`, {plan.base.duration:g} s a run",
        f"- {len(plan.cells)} cell{'s' if len(plan.cells) > 1 else ''}, "
        f"{len(outcomes)} runs: {counts['survived']} "
        f"still up at the end, {counts['fell']} fell, {counts['lost']} lost",
    ]
    if n_finished:
        lines.append(f"- survival {_share(counts['survived'], n_finished)}")
    if counts["started_twice"]:
        lines.append(f"- {counts['started_twice']} runs were started twice")
    if plan.study.base_values:
        lines.append(f"- in all runs: {describe(plan.study.base_values)}")
    if plan.study.stopping is not None:
        width = plan.study.stopping.half_width
        lines.append(
            f"- a cell got no more seeds once its interval was within +-{width:g}"
        )
    return "\n".join(lines)


def _levels(analysis: Analysis) -> list[str]:
    fitted = [group for group in analysis.groups if group.fit is not None]
    if not fitted or analysis.axis is None:
        return []
    shares = [level.share for level in fitted[0].fit.levels]  # type: ignore[union-attr]
    head = ["", *(f"{share:.0%} survive at" for share in shares)]
    rows = [
        [group.label or "all", *(level.describe() for level in group.fit.levels)]  # type: ignore[union-attr]
        for group in fitted
    ]
    text = (
        f"Levels of *{analysis.axis.name}* from a logistic fit, with 95 % intervals "
        "(profile likelihood). Nothing is extrapolated beyond the tested values."
    )
    return ["## Levels", text, _table(head, rows)]


def _averaging(plan: Plan, analysis: Analysis, stem: str) -> str:
    if stem == "map" and len(plan.study.factors) > 2:
        return " All other factors vary."
    if not analysis.averaged or stem not in ("survival", "time_to_fall", "metrics"):
        return ""
    names = ", ".join(factor.name for factor in analysis.averaged)
    return f" Averaged over {names}."


def _cells(plan: Plan, analysis: Analysis) -> list[str]:
    if not analysis.rows:
        return []
    factors, metrics = plan.study.factors, plan.study.metrics
    keys = [factor.key for factor in factors]
    if len(plan.cells) > _MAX_CELLS or any(factor.is_sampled for factor in factors):
        text = f"{len(plan.cells)} cells: each run is a row of `results.parquet`."
        return ["## Cells", text]
    by_cell: dict[tuple[Value, ...], list[Row]] = {}
    for row in analysis.rows:
        by_cell.setdefault(tuple(row[key] for key in keys), []).append(row)
    head = [*(factor.name for factor in factors), "survived", "share (95 %)", *metrics]
    rows = []
    for values, (n_up, n) in count_survival(analysis.rows, keys).items():
        up = [row for row in by_cell[values] if row["survived"]]
        sizes = [_median(up, metric) for metric in metrics]
        rows.append([*map(_number, values), f"{n_up}/{n}", _share(n_up, n), *sizes])
    text = "Metrics: median of the size among the runs that survived."
    return ["## Cells", text, _table(head, rows)]


def _median(rows: Sequence[Row], metric: str) -> str:
    sizes = [abs(row[metric]) for row in rows if row.get(metric) is not None]
    return f"{statistics.median(sizes):.3g}" if sizes else "-"


def _share(n_survived: int, n_runs: int) -> str:
    low, high = wilson_interval(n_survived, n_runs)
    return f"{n_survived / n_runs:.1%} ({low:.1%} to {high:.1%})"


def _lost(plan: Plan, outcomes: Sequence[Outcome]) -> list[str]:
    lost = [outcome for outcome in outcomes if outcome.message is not None]
    if not lost:
        return []
    rows = [
        [
            describe(plan.cells[outcome.cell].values) or "all",
            str(outcome.seed),
            outcome.status,
            outcome.message or "",
        ]
        for outcome in lost[:_MAX_LOST]
    ]
    text = f"{len(lost)} runs gave no result and count neither way"
    text += f"; the first {_MAX_LOST}:" if len(lost) > _MAX_LOST else ":"
    return ["## Lost runs", text, _table(("values", "seed", "what", "why"), rows)]


def _number(value: Value) -> str:
    return f"{value:.4g}" if is_number(value) else str(value)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |"
        for line in lines
    )
