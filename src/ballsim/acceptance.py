"""The acceptance grid: scenarios x radii x seeds, a table and a JSON file.

``python -m ballsim.acceptance`` runs it; the exit code is 0 if no robot fell, 3 if
one fell, 2 for bad input, 1 if a run gave no result. The runs are executed as those
of a study are.
"""

from __future__ import annotations

import itertools
import json
import os
import statistics
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ballsim.config_io import LoadedConfig, load_config
from ballsim.errors import ConfigError
from ballsim.metrics import collect_versions
from ballsim.module_parser import ModuleParser
from ballsim.preparation import prepare
from ballsim.run_files import check_out_dir, write_file
from ballsim.studies.execution import StudyError, execute
from ballsim.studies.executors import local_backend
from ballsim.studies.single_run import FINISHED, Outcome
from ballsim.studies.single_run import Task as RunTask
from ballsim.studies.survival import wilson_interval

__all__ = ["Task", "main", "summarise_cell"]

_SCENARIOS = ("stand", "step", "roll-to", "roll-to,target_angle=4")
_RADII = (0.25, 0.5, 0.75, 1.0)  # the paper's balls, [m]


@dataclass(frozen=True, slots=True)
class Task:
    """One run.

    Attributes:
        scenario: Name of the scenario, then its overrides, separated by commas.
        radius: Radius of the ball, [m].
        seed: Seed.
        overrides: Further texts ``key=value`` for all runs.
    """

    scenario: str
    radius: float
    seed: int
    overrides: tuple[str, ...] = ()

    def load(self) -> LoadedConfig:
        """Return the configuration."""
        name, *own = self.scenario.split(",")
        given = (f"ball.radius_m={self.radius}", f"seed={self.seed}")
        return load_config(name, [*own, *given, *self.overrides])


def summarise_cell(runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the numbers of one scenario on one ball.

    Args:
        runs: Summaries of all its runs.

    Returns:
        Numbers by name, in SI units; errors, steps and factor are those of the
        runs that stayed up, None if there is none or the scenario has no such number.
        The overshoot of a target of 0 is the largest angle either way.
    """
    up = [run for run in runs if run["survived"]]

    def pick(choose: Callable[[Iterable[Any]], Any], key: str) -> Any:
        values = [abs(run[key]) for run in up if run.get(key) is not None]
        return choose(values) if values else None

    scenario, radius = runs[0]["cell"]
    return {
        "scenario": scenario,
        "radius": radius,
        "runs": len(runs),
        "falls": len(runs) - len(up),
        "survival_95_percent": wilson_interval(len(up), len(runs)),
        "max_ball_angle_error": pick(max, "ball_angle_error"),
        "max_ball_angle_overshoot": pick(max, "ball_angle_overshoot"),
        "max_hold_error": pick(max, "hold_error_max"),
        "max_floor_target_error": pick(max, "floor_target_error"),
        "max_cross_track_rms": pick(max, "cross_track_rms"),
        "max_cross_track": pick(max, "cross_track_max"),
        "max_heading_error": pick(max, "heading_error"),
        "min_ball_speed_mean": pick(min, "ball_speed_mean"),
        "max_ball_speed_mean": pick(max, "ball_speed_mean"),
        "max_ball_speed_stride_std": pick(max, "ball_speed_stride_std"),
        "max_ball_lateral_drift": pick(max, "ball_lateral_drift"),
        "min_step_count": pick(min, "step_count"),
        "max_step_count": pick(max, "step_count"),
        "median_realtime_factor": pick(statistics.median, "realtime_factor"),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the grid; see the module.

    Args:
        arguments: Words of the command line, those of the process if None.
    """
    parser = ModuleParser("acceptance", __doc__)
    parser.add_seeds()
    add = parser.add_argument
    add("--scenarios", nargs="+", default=_SCENARIOS, metavar="NAME[,KEY=VALUE...]")
    add("--radii", nargs="+", type=float, default=_RADII, metavar="R", help="[m]")
    add("--workers", type=int, default=os.cpu_count() or 1, metavar="N")
    add("--out", type=Path, default=Path("runs/acceptance.json"), metavar="FILE")
    options = parser.parse_args(arguments)
    seeds = range(max(1, options.seeds))
    grid = itertools.product(options.scenarios, options.radii, seeds)
    tasks = [Task(*cell, tuple(options.overrides)) for cell in grid]
    try:
        check_out_dir(options.out.parent)
        runs = _run(tasks, max(1, options.workers))
    except ConfigError as error:
        parser.complain(error)
        return 2
    except StudyError as error:
        parser.complain(error)
        return 1
    groups = itertools.groupby(runs, key=lambda run: run["cell"])
    cells = [summarise_cell(list(group)) for _, group in groups]
    content = {"versions": collect_versions(), "cells": cells, "runs": runs}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_file(options.out, json.dumps(content, indent=2, allow_nan=False).encode())
    _print_table(cells)
    print(f"all numbers in {options.out}")
    return 3 if any(cell["falls"] for cell in cells) else 0


def _run(tasks: Sequence[Task], n_workers: int) -> list[dict[str, Any]]:
    """Return the summaries of all runs, in the order of the tasks.

    Raises:
        ConfigError: The input is not valid; nothing has been run then.
        StudyError: A run gave no result.
    """
    configs = []
    for task in tasks:
        loaded = task.load()
        try:
            if task.seed == tasks[0].seed:  # the first of its cell
                prepare(loaded.config)
        except ConfigError as error:
            raise loaded.source.locate(error) from None
        configs.append(loaded.config)
    outcomes: dict[int, Outcome] = {}

    def finish(outcome: Outcome) -> tuple[RunTask, ...]:
        if outcome.status != FINISHED:
            raise StudyError(f"{tasks[outcome.cell]}: {outcome.message}")
        outcomes[outcome.cell] = outcome
        print(f"\r{len(outcomes)}/{len(tasks)}", end="", file=sys.stderr)
        return ()

    with local_backend(n_workers) as backend:
        run_tasks = [RunTask(i, config) for i, config in enumerate(configs)]
        execute(run_tasks, backend, finish)
    print("\r", end="", file=sys.stderr)
    return [
        {
            **outcomes[i].summary,
            "realtime_factor": outcomes[i].realtime_factor,
            "cell": [task.scenario, task.radius],
            "seed": task.seed,
        }
        for i, task in enumerate(tasks)
    ]


def _print_table(cells: Iterable[dict[str, Any]]) -> None:
    table = Table(box=None, pad_edge=False)
    for head in ("scenario", "radius m", "falls", "survival 95 %", "max error rad"):
        table.add_column(head, justify="left" if head == "scenario" else "right")
    heads = (
        "holds rad",
        "floor mm",
        "track mm",
        "heading rad",
        "overshoot rad",
        "drift mm",
        "steps",
        "x real time",
    )
    for head in heads:
        table.add_column(head, justify="right")

    def number(value: float | None, digits: int = 3, factor: float = 1.0) -> str:
        return "-" if value is None else f"{factor * value:.{digits}f}"

    for cell in cells:
        least, most = cell["min_step_count"], cell["max_step_count"]
        table.add_row(
            cell["scenario"],
            f"{cell['radius']:g}",
            f"{cell['falls']}/{cell['runs']}",
            f"> {100.0 * cell['survival_95_percent'][0]:.0f} %",
            number(cell["max_ball_angle_error"]),
            number(cell["max_hold_error"]),
            number(cell["max_floor_target_error"], 1, 1e3),
            number(cell["max_cross_track_rms"], 1, 1e3),
            number(cell["max_heading_error"]),
            number(cell["max_ball_angle_overshoot"]),
            number(cell["max_ball_lateral_drift"], 1, 1e3),
            "-" if least is None else f"{least}-{most}",
            number(cell["median_realtime_factor"], 1),
        )
    Console(highlight=False, width=160).print(table)


if __name__ == "__main__":
    sys.exit(main())
