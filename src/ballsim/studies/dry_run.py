"""What a study would cost, from one measured run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from ballsim.studies.design import load_plan
from ballsim.studies.earlier import Earlier, read_earlier
from ballsim.studies.executors import open_backend
from ballsim.studies.single_run import Task, run_chunk
from ballsim.studies.validation import check_plan

__all__ = ["DryRun", "dry_run"]


@dataclass(frozen=True, slots=True)
class DryRun:
    """What a study would cost.

    Attributes:
        n_cells: Cells.
        n_runs: Runs, at most.
        n_workers: Runs at the same time.
        time_per_run: Wall-clock time of the measured run, [s]; if its robot fell,
            of a run that lasts to the end.
        total_time: Wall-clock time of all runs, at most, [s].
    """

    n_cells: int
    n_runs: int
    n_workers: int
    time_per_run: float
    total_time: float

    def describe(self, name: str) -> str:
        """Return it as words."""
        return (
            f"{name}: {self.n_cells} cells, at most {self.n_runs} runs; a measured "
            f"run took {self.time_per_run:.2f} s; at most "
            f"{_describe_time(self.total_time)} with {self.n_workers} at a time"
        )


def dry_run(
    file: Path,
    n_workers: int,
    scheduler: str | None = None,
    earlier: Earlier | None = None,
) -> DryRun:
    """Check a study, measure one run and tell the cost of all.

    Args:
        file: The study.
        n_workers: Number of local processes.
        scheduler: Address of a Dask scheduler to use instead, or None.
        earlier: Runs that are not done again, or None.

    Raises:
        ConfigError: The study is not valid.
    """
    plan = load_plan(file)
    taken = read_earlier(earlier, plan) if earlier is not None else []
    check_plan(plan)
    n_runs = plan.n_runs - len(taken)
    with open_backend(n_workers, scheduler) as backend:
        n_slots = max(1, min(backend.n_slots, n_runs))
    cell = plan.cells[len(plan.cells) // 2]
    config = replace(cell.config, seed=plan.seeds_of(cell)[0])
    [outcome] = run_chunk([Task(cell.index, config)], plan.study.run_limit)
    simulated = outcome.summary.get("simulated_time") or config.duration
    rate = outcome.wall_time / simulated  # runs of other cells may last longer
    simulated_in_all = sum(
        cell.config.duration * len(plan.seeds_of(cell)) for cell in plan.cells
    ) - sum(plan.cells[outcome.cell].config.duration for outcome in taken)
    return DryRun(
        n_cells=len(plan.cells),
        n_runs=n_runs,
        n_workers=n_slots,
        time_per_run=rate * config.duration,
        total_time=rate * simulated_in_all / n_slots,
    )


def _describe_time(seconds: float) -> str:
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if seconds >= length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s"
