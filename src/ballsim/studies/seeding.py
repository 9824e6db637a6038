"""Which runs a study still needs: all seeds, or as many as a rule asks for."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

from ballsim.studies.design import Cell, Plan
from ballsim.studies.single_run import FINISHED, Outcome, Task
from ballsim.studies.survival import wilson_interval

__all__ = ["Seeder"]


class Seeder:
    """Hands out the runs of a study, knowing what is done.

    Which runs it hands out in the end depends on their outcomes only, not on the
    order in which these come in.

    Args:
        plan: The study.
        done: Outcomes that are known already.
    """

    def __init__(self, plan: Plan, done: Iterable[Outcome] = ()) -> None:
        self._plan = plan
        self._survived: list[dict[int, bool | None]] = [{} for _ in plan.cells]
        self._n_asked = [0] * len(plan.cells)
        for outcome in done:
            self._note(outcome)

    def first_tasks(self) -> list[Task]:
        """Return the runs that can be done at once, all cells alike."""
        tasks = [
            (i, task)
            for cell in self._plan.cells
            for i, task in enumerate(self._advance(cell))
        ]
        return [task for _, task in sorted(tasks, key=lambda pair: pair[0])]

    def next_tasks(self, outcome: Outcome) -> list[Task]:
        """Return the runs that an outcome makes necessary."""
        self._note(outcome)
        return self._advance(self._plan.cells[outcome.cell])

    def _note(self, outcome: Outcome) -> None:
        is_finished = outcome.status == FINISHED
        is_up = bool(outcome.summary["survived"]) if is_finished else None
        self._survived[outcome.cell][outcome.seed] = is_up

    def _advance(self, cell: Cell) -> list[Task]:
        """Return new runs of a cell: the next batch, once all asked for are done."""
        seeds, done = self._plan.seeds_of(cell), self._survived[cell.index]
        stopping = self._plan.study.stopping
        is_recorded = self._plan.study.keep_recordings == "falls"
        while True:
            n_asked = self._n_asked[cell.index]
            if not all(seed in done for seed in seeds[:n_asked]):
                return []
            if n_asked == len(seeds) or (n_asked > 0 and self._is_enough(cell)):
                return []
            n_more = len(seeds)
            if stopping is not None:
                n_more = stopping.batch if n_asked else stopping.min_seeds
            batch = seeds[n_asked : n_asked + n_more]
            self._n_asked[cell.index] += len(batch)
            tasks = [
                Task(
                    cell=cell.index,
                    config=dataclasses.replace(cell.config, seed=seed),
                    is_fall_recorded=is_recorded,
                )
                for seed in batch
                if seed not in done
            ]
            if tasks:
                return tasks

    def _is_enough(self, cell: Cell) -> bool:
        stopping = self._plan.study.stopping
        if stopping is None:
            return False
        asked = self._plan.seeds_of(cell)[: self._n_asked[cell.index]]
        found = [self._survived[cell.index][seed] for seed in asked]
        survived = [is_up for is_up in found if is_up is not None]
        if not survived:
            return False
        low, high = wilson_interval(sum(survived), len(survived))
        return (high - low) / 2.0 <= stopping.half_width
