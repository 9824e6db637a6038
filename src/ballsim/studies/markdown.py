"""Pieces of a Markdown report."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence

from ballsim.studies.factors import Value, is_number
from ballsim.studies.survival import wilson_interval
from ballsim.studies.table import Row

__all__ = ["format_median", "format_share", "format_table", "format_value"]


def format_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table.

    Args:
        head: Its first line.
        rows: The others, with as many cells each.
    """
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |"
        for line in lines
    )


def format_share(n_survived: int, n_runs: int) -> str:
    """Return a share with its 95 % Wilson interval, as in ``50.0% (9.5% to 90.5%)``.

    Args:
        n_survived: Runs that count.
        n_runs: All runs, at least one.
    """
    low, high = wilson_interval(n_survived, n_runs)
    return f"{n_survived / n_runs:.1%} ({low:.1%} to {high:.1%})"


def format_median(rows: Sequence[Row], metric: str) -> str:
    """Return the median of a metric's size, a dash if no run has it.

    Args:
        rows: The runs.
        metric: Name of the number.
    """
    sizes = [abs(row[metric]) for row in rows if row.get(metric) is not None]
    return f"{statistics.median(sizes):.3g}" if sizes else "-"


def format_value(value: Value) -> str:
    """Return a value of a factor."""
    return f"{value:.4g}" if is_number(value) else str(value)
