"""What the runs of a study with cases kept, cell by cell; pure functions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from ballsim.studies.cases import Requirement
from ballsim.studies.design import Cell, Plan
from ballsim.studies.single_run import FINISHED
from ballsim.studies.table import Row

__all__ = ["Extremes", "Tally", "Verdict", "judge", "tally"]

_SURVIVED = "survived"


@dataclass(frozen=True, slots=True)
class Extremes:
    """The worst values of a limited number, among the runs that survived.

    Attributes:
        requirement: The limits.
        least: Least value, None if there is none.
        greatest: Greatest value, None if there is none.
        n_undefined: Runs in which the number is not defined.
        is_kept: True if all runs that survived kept the limits.
    """

    requirement: Requirement
    least: float | None
    greatest: float | None
    n_undefined: int
    is_kept: bool

    @property
    def size(self) -> float | None:
        """Return the largest size, None if there is none."""
        if self.least is None or self.greatest is None:
            return None
        return max(abs(self.least), abs(self.greatest))


@dataclass(frozen=True, slots=True)
class Tally:
    """How many runs did what.

    Attributes:
        n_runs: Runs, those without a result among them.
        n_lost: Runs without a result.
        n_survived: Runs whose robot stayed up.
        n_met: Runs whose robot stayed up and kept all limits.
    """

    n_runs: int
    n_lost: int
    n_survived: int
    n_met: int

    @property
    def n_finished(self) -> int:
        """Return the number of runs that have a result."""
        return self.n_runs - self.n_lost

    @property
    def is_met(self) -> bool:
        """Return True if every run has a result and met everything."""
        return self.n_runs > 0 and self.n_met == self.n_runs


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the runs of a cell kept.

    Attributes:
        cell: The cell.
        tally: Its runs.
        extremes: The worst values, one for each limit of its case.
    """

    cell: Cell
    tally: Tally
    extremes: tuple[Extremes, ...]


def judge(plan: Plan, rows: Iterable[Row]) -> list[Verdict]:
    """Compare the runs of each cell with what its case requires.

    A run that gave no result counts as one that did not meet the requirements: a
    cell must not pass because its worst runs are missing.

    Args:
        plan: The study.
        rows: Its rows, from `table.make_rows`.

    Returns:
        Verdicts of the cells that have runs, in the order of the cells.
    """
    by_cell: dict[int, list[Row]] = {}
    for row in rows:
        by_cell.setdefault(row["cell"], []).append(row)
    verdicts = []
    for cell in plan.cells:
        own = by_cell.get(cell.index, [])
        if not own:
            continue
        requirements = plan.cases[cell.case].requirements
        up = [r for r in own if r["status"] == FINISHED and r[_SURVIVED]]
        n_lost = sum(row["status"] != FINISHED for row in own)
        n_met = sum(all(r.is_kept(r.evaluate(row)) for r in requirements) for row in up)
        extremes = tuple(_find_extremes(up, r) for r in requirements)
        counts = Tally(len(own), n_lost, len(up), n_met)
        verdicts.append(Verdict(cell, counts, extremes))
    return verdicts


def tally(
    verdicts: Iterable[Verdict], is_wanted: Callable[[Cell], bool]
) -> Tally | None:
    """Return the counts of several cells together, None if there are no runs.

    Args:
        verdicts: Verdicts of the cells.
        is_wanted: True for the cells that count.
    """
    some = [verdict.tally for verdict in verdicts if is_wanted(verdict.cell)]
    if not some:
        return None
    return Tally(
        n_runs=sum(counts.n_runs for counts in some),
        n_lost=sum(counts.n_lost for counts in some),
        n_survived=sum(counts.n_survived for counts in some),
        n_met=sum(counts.n_met for counts in some),
    )


def _find_extremes(rows: Sequence[Row], requirement: Requirement) -> Extremes:
    values = [requirement.evaluate(row) for row in rows]
    defined = [value for value in values if value is not None]
    return Extremes(
        requirement=requirement,
        least=min(defined, default=None),
        greatest=max(defined, default=None),
        n_undefined=len(values) - len(defined),
        is_kept=all(requirement.is_kept(value) for value in values),
    )
