"""The report of a study, as Markdown and as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from ballsim.studies.analysis import Analysis, Group, count_survival
from ballsim.studies.case_report import (
    CASES_CAPTION,
    PUSHES_CAPTION,
    build_case_json,
    describe_verdicts,
    format_cases,
)
from ballsim.studies.design import Plan
from ballsim.studies.factors import Value, describe
from ballsim.studies.markdown import (
    format_median,
    format_share,
    format_table,
    format_value,
)
from ballsim.studies.single_run import Outcome
from ballsim.studies.table import Row
from ballsim.studies.verdicts import Verdict

__all__ = ["build_json", "format_report"]

_MAX_CELLS = 200  # of the table
_MAX_LOST = 20
_CAPTIONS = {
    "cases": CASES_CAPTION,
    "pushes": PUSHES_CAPTION,
    "survival": "Survival with 95 % Wilson intervals{fit}.",
    "time_to_fall": "Time to the fall (Kaplan-Meier, 95 % bands); runs that were still "
    "up when they ended count as censored.",
    "metrics": "Size of each metric among the runs that survived: median, quartiles.",
    "map": "Survival over two factors.",
    "indices": "Sobol indices: the share of each quantity's variance that a factor "
    "explains on its own (first order), and on its own and together with others "
    "(total); 95 % bootstrap intervals.",
    "sensitivity": "Standardised rank regression: how many standard deviations the "
    "rank of each quantity moves with that of each factor; 95 % bootstrap intervals.",
}


def format_report(
    plan: Plan,
    analysis: Analysis,
    outcomes: Sequence[Outcome],
    versions: Mapping[str, str],
    figures: Iterable[str],
    verdicts: Sequence[Verdict] = (),
) -> str:
    """Return the report as Markdown.

    Args:
        plan: The study.
        analysis: Its numbers.
        outcomes: Its runs.
        versions: Versions and revision of the code that made them.
        figures: Names of the pictures beside the report.
        verdicts: Verdicts of its cells, if it has cases.
    """
    parts = [
        f"# {plan.name}",
        plan.study.description,
        _overview(plan, analysis, outcomes, verdicts),
    ]
    parts += _levels(analysis)
    for name in figures:
        stem = name.removesuffix(".png").rstrip("_0123456789")
        is_fitted = any(group.fit is not None for group in analysis.groups)
        fit = " and the logistic fit" if is_fitted else ""
        caption = _CAPTIONS[stem].format(fit=fit) + _averaging(plan, analysis, stem)
        parts.append(f"![{stem}]({name})\n\n{caption}")
    if plan.study.cases:
        parts += format_cases(plan, verdicts, analysis.rows)
    else:
        parts += _cells(plan, analysis)
    parts += _lost(plan, outcomes)
    parts.append("## Provenance")
    rows = [("study (SHA-256)", plan.digest), *sorted(versions.items())]
    parts.append(format_table(("what", "which"), rows))
    return "\n\n".join(parts) + "\n"


def build_json(
    plan: Plan,
    analysis: Analysis,
    outcomes: Sequence[Outcome],
    versions: Mapping[str, str],
    verdicts: Sequence[Verdict] = (),
) -> dict[str, Any]:
    """Return the numbers of the report as JSON can hold them."""
    cases = build_case_json(plan, verdicts) if plan.study.cases else {}
    indices = {name: asdict(found) for name, found in analysis.indices.items()}
    return {
        "study": plan.name,
        "digest": plan.digest,
        "cells": len(plan.cells),
        **_counts(analysis, outcomes),
        **cases,
        "axis": None if analysis.axis is None else analysis.axis.key,
        "groups": [_group_json(group) for group in analysis.groups],
        "sensitivities": {
            name: {"explained": found.explained, "coefficients": found.coefficients}
            for name, found in analysis.sensitivities.items()
        },
        **({"sobol_indices": indices} if indices else {}),
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


def _overview(
    plan: Plan,
    analysis: Analysis,
    outcomes: Sequence[Outcome],
    verdicts: Sequence[Verdict],
) -> str:
    counts = _counts(analysis, outcomes)
    n_finished = len(analysis.rows)
    runs = f"scenario `{plan.cases[0].scenario}`, {plan.bases[0].duration:g} s a run"
    if plan.study.cases:
        runs = f"{len(plan.cases)} cases; {describe_verdicts(verdicts)}"
    lines = [
        f"- {runs}",
        f"- {len(plan.cells)} cell{'s' if len(plan.cells) > 1 else ''}, "
        f"{len(outcomes)} runs: {counts['survived']} "
        f"still up at the end, {counts['fell']} fell, {counts['lost']} lost",
    ]
    if n_finished:
        lines.append(f"- survival {format_share(counts['survived'], n_finished)}")
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
    return ["## Levels", text, format_table(head, rows)]


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
        sizes = [format_median(up, metric) for metric in metrics]
        rows.append(
            [*map(format_value, values), f"{n_up}/{n}", format_share(n_up, n), *sizes]
        )
    text = "Metrics: median of the size among the runs that survived."
    return ["## Cells", text, format_table(head, rows)]


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
    return ["## Lost runs", text, format_table(("values", "seed", "what", "why"), rows)]
