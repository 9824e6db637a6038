"""Runs taken over from the results of an earlier study: the rest is run alone."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ballsim.errors import ConfigError
from ballsim.studies.design import Plan
from ballsim.studies.factors import Value, is_number
from ballsim.studies.single_run import FINISHED, Outcome
from ballsim.studies.table import CASE

__all__ = ["Earlier", "choose_earlier", "read_earlier"]

_IDENTITY = ("study", "digest")  # beside the versions, in the metadata of results


@dataclass(frozen=True, slots=True)
class Earlier:
    """Which runs are taken over.

    Attributes:
        file: ``results.parquet`` of the earlier study.
        where: What a run has to be among, each as ``KEY=VALUE,VALUE``: a factor
            and some of its values; all of them have to hold.
    """

    file: Path
    where: Sequence[str] = ()


def choose_earlier(file: Path | None, where: Sequence[str]) -> Earlier | None:
    """Return which runs are taken over, None for none.

    Args:
        file: ``results.parquet`` of the earlier study, or None.
        where: As in `Earlier`.

    Raises:
        ConfigError: There are conditions, but no file.
    """
    if file is not None:
        return Earlier(file, where)
    if where:
        valid = "left out without --from, whose runs it chooses from"
        raise ConfigError("--where", where[0], valid, "command line")
    return None


def read_earlier(earlier: Earlier, plan: Plan) -> list[Outcome]:
    """Return the runs of an earlier study that this one would do, too.

    A run is told by the name of its case, the values of its factors and its seed.
    Neither settings nor code are compared: that they give the same run is for the
    user to know. Runs without a result are left for another try.

    Args:
        earlier: Which runs.
        plan: The study that is to be run.

    Returns:
        The runs, the first with the versions of the code that did them.

    Raises:
        ConfigError: It is no file of results, none of its runs is this study's, or
            `where` names what the study has not.
    """
    import pyarrow as pa  # noqa: PLC0415 (only where a file is read)
    import pyarrow.parquet as pq  # noqa: PLC0415

    where = [_read_condition(text, plan) for text in earlier.where]

    def refuse(valid: str) -> ConfigError:
        return ConfigError("--from", str(earlier.file), valid, "command line")

    try:
        table = pq.read_table(earlier.file)
    except (OSError, pa.ArrowException) as error:
        reason = getattr(error, "strerror", None) or "it is not in Parquet format"
        raise refuse(f"results.parquet of an earlier study ({reason})") from None
    metadata = (table.schema.metadata or {}).get(b"ballsim")
    if metadata is None:
        raise refuse("results.parquet of an earlier study (it has no versions)")
    versions = json.loads(metadata)
    provenance = {k: v for k, v in versions.items() if k not in _IDENTITY}
    outcomes = list(_make_outcomes(table.to_pylist(), plan, where))
    if not outcomes:
        raise refuse("results of which this study would do at least one run, too")
    return [replace(outcomes[0], provenance=provenance), *outcomes[1:]]


def _read_condition(text: str, plan: Plan) -> tuple[str, set[Value]]:
    """Return a factor and those of its values that a condition names."""

    def refuse(valid: str) -> ConfigError:
        return ConfigError("--where", text, valid, "command line")

    key, _, listed = text.partition("=")
    known = [cell.values[key] for cell in plan.cells if key in cell.values]
    if not known:
        keys = ", ".join(factor.key for factor in plan.study.factors)
        raise refuse(f"KEY=VALUE,VALUE with a factor of the study as KEY: {keys}")
    by_text = {_write(value): value for value in known}
    chosen = set[Value]()
    for item in listed.split(","):
        if item.strip() not in by_text:
            words = ", ".join(by_text)
            raise refuse(f"values that {key} has in the study: {words}")
        chosen.add(by_text[item.strip()])
    return key, chosen


def _write(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if is_number(value) else str(value)


def _make_outcomes(
    rows: Iterable[Mapping[str, Any]],
    plan: Plan,
    where: Sequence[tuple[str, set[Value]]],
) -> Iterator[Outcome]:
    """Yield the runs that the study would do, with their summaries."""
    keys = [factor.key for factor in plan.study.factors]
    names = [case.name if plan.study.cases else None for case in plan.cases]
    cells = {
        (names[cell.case], *(cell.values[key] for key in keys)): cell
        for cell in plan.cells
    }
    head = {"cell", CASE, "seed", "status", *keys}
    for row in rows:
        cell = cells.get((row.get(CASE), *(row.get(key) for key in keys)))
        if cell is None or row["status"] != FINISHED:
            continue
        if row["seed"] not in plan.seeds_of(cell):
            continue
        if any(cell.values[key] not in chosen for key, chosen in where):
            continue
        numbers = {key: value for key, value in row.items() if key not in head}
        yield Outcome(cell.index, row["seed"], FINISHED, numbers)
