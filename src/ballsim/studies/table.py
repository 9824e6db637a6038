"""The table of a study: one row for each run, as columns and as a Parquet file."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from typing import Any

from ballsim.studies.design import Plan
from ballsim.studies.factors import is_number
from ballsim.studies.single_run import Outcome

__all__ = ["CASE", "Row", "flatten_summary", "make_rows", "pack_parquet"]

CASE = "case"  # column with the name of the case

Row = dict[str, Any]


def flatten_summary(summary: Mapping[str, Any], prefix: str = "") -> Row:
    """Return the scalars of a summary; those of its tables by dotted names.

    Examples:
        >>> flatten_summary({"a": 1, "rms": {"x_m": 0.5}})
        {'a': 1, 'rms.x_m': 0.5}
    """
    row: Row = {}
    for key, value in summary.items():
        if isinstance(value, Mapping):
            row |= flatten_summary(value, f"{prefix}{key}.")
        elif value is None or isinstance(value, (bool, int, float, str)):
            row[f"{prefix}{key}"] = value
    return row


def make_rows(plan: Plan, outcomes: Sequence[Outcome]) -> list[Row]:
    """Return a row for each run.

    Args:
        plan: The study.
        outcomes: Its runs, sorted by cell and seed.

    Returns:
        Rows with the same keys: ``cell``, ``case`` if the study has cases, the
        factors, ``seed``, ``status``, and the numbers of the summaries; None where
        a run has none. Nothing depends on the clock or on the workers.
    """
    rows = []
    first = ["cell", CASE] if plan.study.cases else ["cell"]
    for outcome in outcomes:
        cell = plan.cells[outcome.cell]
        head: Row = {"cell": outcome.cell}
        if plan.study.cases:
            head[CASE] = plan.cases[cell.case].name
        head |= cell.values
        head |= {"seed": outcome.seed, "status": outcome.status}
        rows.append({**flatten_summary(outcome.summary), **head})
    keys = [*first, *(factor.key for factor in plan.study.factors), "seed", "status"]
    keys += sorted({key for row in rows for key in row} - set(keys), key=_order(rows))
    return [{key: row.get(key) for key in keys} for row in rows]


def _order(rows: Sequence[Row]) -> Any:
    """Return a sort key: the order of the row that has the most."""
    longest: Row = {}
    for row in rows:
        longest = row if len(row) > len(longest) else longest
    places = {key: i for i, key in enumerate(longest)}
    return lambda key: (places.get(key, len(places)), key)


def pack_parquet(rows: Sequence[Row], metadata: Mapping[str, str]) -> bytes:
    """Return rows as a Parquet file; the same rows give the same bytes.

    Args:
        rows: Rows with the same keys.
        metadata: Texts that are put into the file under ``ballsim``, as JSON.
    """
    import pyarrow as pa  # noqa: PLC0415 (only where a file is written)
    import pyarrow.parquet as pq  # noqa: PLC0415

    names = list(rows[0]) if rows else []
    columns = {name: _uniform([row[name] for row in rows]) for name in names}
    table = pa.table(columns)
    text = json.dumps(metadata, sort_keys=True)
    table = table.replace_schema_metadata({"ballsim": text})
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()


def _uniform(values: list[Any]) -> list[Any]:
    """Return values of one type: floats among numbers, texts among others."""
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) < 2:
        return values
    if all(value is None or is_number(value) for value in values):
        return [None if value is None else float(value) for value in values]
    return [None if value is None else str(value) for value in values]
