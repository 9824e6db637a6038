"""From the rows of a study to what the report says; pure functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ballsim.studies.definition import Study
from ballsim.studies.factors import Factor, Value
from ballsim.studies.levels import LogisticFit, fit_logistic
from ballsim.studies.sampling import SALTELLI
from ballsim.studies.sensitivity import Sensitivity, rank_sensitivities
from ballsim.studies.single_run import FINISHED
from ballsim.studies.survival import wilson_interval
from ballsim.studies.table import CASE, Row
from ballsim.studies.variance import VarianceIndices, estimate_indices

__all__ = ["Analysis", "Group", "Point", "analyse", "count_survival", "pick_axis"]

SURVIVED = "survived"
TIME_UP = "simulated_time"
_MAX_GROUPS = 8  # curves in one picture
_N_BINS = 10  # of a sampled axis
_BOOTSTRAP_SEED = 0


@dataclass(frozen=True, slots=True)
class Point:
    """The runs of a group at one level of the axis.

    Attributes:
        level: The level; the median of a bin if the axis is sampled.
        n_runs: Finished runs.
        n_survived: Those whose robot stayed up.
        interval: 95 % Wilson interval of the survival.
        quartiles: Lower quartile, median, upper quartile of the size of each
            metric, among the runs that survived; None if there are none.
        rows: The runs.
    """

    level: Value
    n_runs: int
    n_survived: int
    interval: tuple[float, float]
    quartiles: Mapping[str, tuple[float, float, float] | None]
    rows: Sequence[Row]

    @property
    def share(self) -> float:
        """Return the share that survived."""
        return self.n_survived / self.n_runs


@dataclass(frozen=True, slots=True)
class Group:
    """Runs that differ in the axis and in what is averaged over only.

    Attributes:
        label: What they have in common.
        values: The same as values by key.
        rows: Finished runs.
        points: Levels of the axis, in order.
        fit: Logistic fit along the axis, or None.
    """

    label: str
    values: Mapping[str, Value]
    rows: Sequence[Row]
    points: Sequence[Point]
    fit: LogisticFit | None


@dataclass(frozen=True, slots=True)
class Analysis:
    """All numbers of the report.

    Attributes:
        axis: Factor along which survival is drawn, or None.
        groups: Groups of runs, one curve each.
        averaged: Factors that the groups average over.
        rows: Finished runs.
        lost: Runs without a result.
        sensitivities: Rank regression of survival and of each metric on the numeric
            factors, by the name of the quantity; for two factors or more and one
            scenario.
        indices: Sobol indices of survival, of the time that the robot stayed up, and
            of each metric, by the name of the quantity; for a ``saltelli`` design.
    """

    axis: Factor | None
    groups: Sequence[Group]
    averaged: Sequence[Factor]
    rows: Sequence[Row]
    lost: Sequence[Row]
    sensitivities: Mapping[str, Sensitivity]
    indices: Mapping[str, VarianceIndices]


def pick_axis(study: Study) -> Factor | None:
    """Return the factor along which survival is drawn, see `Study.axis`."""
    if not study.factors:
        return None
    if study.axis is not None:
        return next(f for f in study.factors if f.key == study.axis)
    return max(
        study.factors,
        key=lambda f: (
            f.is_numeric,
            f.harder is not None,
            f.is_sampled,
            len(f.levels),
        ),
    )


def analyse(study: Study, rows: Sequence[Row]) -> Analysis:
    """Compute all numbers of the report.

    Args:
        study: The study.
        rows: Its rows, from `table.make_rows`.
    """
    finished = [row for row in rows if row["status"] == FINISHED]
    axis = pick_axis(study)
    others = [f for f in study.factors if f is not axis and not f.is_sampled]
    while len(_split(finished, _key_of(others))) > _MAX_GROUPS:
        others.pop()
    groups = [
        _make_group(
            study, axis, case | dict(zip((f.key for f in others), key, strict=True)), g
        )
        for case, some in _split_cases(study, finished)
        for key, g in _split(some, _key_of(others)).items()
    ]
    averaged = [f for f in study.factors if f is not axis and f not in others]
    return Analysis(
        axis=axis,
        groups=groups,
        averaged=averaged,
        rows=finished,
        lost=[row for row in rows if row["status"] != FINISHED],
        sensitivities=_rank(study, finished),
        indices=_apportion(study, finished),
    )


def count_survival(
    rows: Sequence[Row], keys: Sequence[str]
) -> dict[tuple[Value, ...], tuple[int, int]]:
    """Return survivors and runs by the values of some factors.

    Args:
        rows: Finished runs.
        keys: Keys of the factors.
    """
    split = _split(rows, lambda row: tuple(row[key] for key in keys))
    return {
        values: (sum(row[SURVIVED] for row in some), len(some))
        for values, some in split.items()
    }


def _key_of(factors: Sequence[Factor]) -> Callable[[Row], tuple[Value, ...]]:
    keys = [factor.key for factor in factors]
    return lambda row: tuple(row[key] for key in keys)


def _split(rows: Sequence[Row], key_of: Callable[[Row], Any]) -> dict[Any, list[Row]]:
    """Return rows by a key, in the order in which the keys come."""
    split: dict[Any, list[Row]] = {}
    for row in rows:
        split.setdefault(key_of(row), []).append(row)
    return split


def _split_cases(
    study: Study, rows: list[Row]
) -> list[tuple[dict[str, Value], list[Row]]]:
    """Return the rows of each case, with its name as a value if there are cases."""
    if not study.cases:
        return [({}, rows)]
    split = _split(rows, lambda row: row[CASE])
    return [({CASE: name}, some) for name, some in split.items()]


def _make_group(
    study: Study, axis: Factor | None, values: dict[str, Value], rows: list[Row]
) -> Group:
    names = {CASE: CASE, **{factor.key: factor.name for factor in study.factors}}
    label = ", ".join(
        f"{names[key]} {value:g}"
        if isinstance(value, float)
        else f"{names[key]} {value}"
        for key, value in values.items()
    )
    fit = None
    if axis is None:
        points = [_make_point(study, "all", rows)]
    else:
        levels = _split(rows, lambda row: row[axis.key])
        if axis.is_numeric:
            levels = dict(sorted(levels.items()))
            counts = [(sum(r[SURVIVED] for r in g), len(g)) for g in levels.values()]
            n_survived, n_runs = zip(*counts, strict=True)
            if axis.harder is not None:
                fit = fit_logistic(
                    list(levels), n_survived, n_runs, axis.harder, axis.is_log
                )
        if axis.is_sampled:
            levels = _bin(levels)
        points = [_make_point(study, level, some) for level, some in levels.items()]
    return Group(label, values, rows, points, fit)


def _bin(levels: Mapping[Any, list[Row]]) -> dict[Any, list[Row]]:
    """Return bins of as many levels each, by the median of their levels."""
    numbers = sorted(levels)
    parts = np.array_split(np.array(numbers), min(_N_BINS, len(numbers)))
    return {
        float(np.median(part)): [row for n in part.tolist() for row in levels[n]]
        for part in parts
    }


def _make_point(study: Study, level: Value, rows: Sequence[Row]) -> Point:
    up = [row for row in rows if row[SURVIVED]]
    return Point(
        level=level,
        n_runs=len(rows),
        n_survived=len(up),
        interval=wilson_interval(len(up), len(rows)),
        quartiles={metric: _quartiles(up, metric) for metric in study.metrics},
        rows=rows,
    )


def _quartiles(rows: Sequence[Row], metric: str) -> tuple[float, float, float] | None:
    sizes = [abs(row[metric]) for row in rows if row.get(metric) is not None]
    if not sizes:
        return None
    low, middle, high = np.percentile(sizes, [25, 50, 75]).tolist()
    return low, middle, high


def _rank(study: Study, rows: Sequence[Row]) -> dict[str, Sensitivity]:
    """Return the sensitivities, each cell counting once."""
    numeric = [factor for factor in study.factors if factor.is_numeric]
    if len(numeric) < 2 or study.cases:
        return {}
    cells = list(_split(rows, lambda row: row["cell"]).values())
    factors = {f.key: [float(cell[0][f.key]) for cell in cells] for f in numeric}
    quantities = {SURVIVED: _means(cells, SURVIVED)}
    for metric in study.metrics:
        quantities[metric] = _medians(cells, metric)
    ranked = {
        name: rank_sensitivities(
            factors, values, np.random.default_rng(_BOOTSTRAP_SEED)
        )
        for name, values in quantities.items()
    }
    return {name: found for name, found in ranked.items() if found is not None}


def _apportion(study: Study, rows: Sequence[Row]) -> dict[str, VarianceIndices]:
    """Return the Sobol indices, each cell counting once.

    A quantity that is missing in a cell has none: the design would have gaps where
    it is most extreme.
    """
    sampling, keys = study.sampling, [factor.key for factor in study.factors]
    if sampling is None or sampling.method != SALTELLI:
        return {}
    by_cell = _split(rows, lambda row: row["cell"])
    cells = [by_cell.get(i, []) for i in range(sampling.count_points(len(keys)))]
    quantities = {name: _means(cells, name) for name in (SURVIVED, TIME_UP)}
    for metric in study.metrics:
        quantities.setdefault(metric, _medians(cells, metric))
    found = {
        name: estimate_indices(
            keys,
            np.array(values).reshape(-1, sampling.count),
            np.random.default_rng(_BOOTSTRAP_SEED),
        )
        for name, values in quantities.items()
    }
    return {name: indices for name, indices in found.items() if indices is not None}


def _means(cells: Sequence[Sequence[Row]], name: str) -> list[float]:
    """Return the mean of a number that all runs have; NaN for a cell without runs."""
    return [float(np.mean([r[name] for r in c])) if c else np.nan for c in cells]


def _medians(cells: Sequence[Sequence[Row]], metric: str) -> list[float]:
    """Return the median size among the survivors; NaN where there are none."""
    found = [_quartiles([r for r in c if r[SURVIVED]], metric) for c in cells]
    return [np.nan if q is None else q[1] for q in found]
