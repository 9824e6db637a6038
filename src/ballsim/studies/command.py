"""The command ``ballsim study``: checks, runs, files, what is printed."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ballsim.config_io import format_config
from ballsim.errors import ConfigError
from ballsim.run_files import check_out_dir, write_file
from ballsim.studies.analysis import analyse
from ballsim.studies.design import Plan, load_plan
from ballsim.studies.earlier import Earlier, read_earlier
from ballsim.studies.execution import execute
from ballsim.studies.executors import Backend, open_backend
from ballsim.studies.ledger import Ledger, open_ledger
from ballsim.studies.progress import make_study_progress
from ballsim.studies.report import build_json, format_report
from ballsim.studies.seeding import Seeder
from ballsim.studies.single_run import Outcome, Task
from ballsim.studies.table import make_rows, pack_parquet
from ballsim.studies.validation import check_plan
from ballsim.studies.verdicts import judge

__all__ = ["FinishedStudy", "choose_workers", "print_study", "run_study"]

RESULTS_FILE = "results.parquet"
REPORT_FILE = "report.md"
NUMBERS_FILE = "report.json"
STUDY_FILE = "study.toml"
CONFIG_FILE = "config.toml"
CASES_FOLDER = "cases"
FALLS_FOLDER = "falls"

_IS_PICTURE = (
    "cases",
    "pushes",
    "survival",
    "time_to_fall",
    "metrics",
    "map_",
    "sensitivity",
    "indices",
)


@dataclass(frozen=True, slots=True)
class FinishedStudy:
    """A study whose files are written.

    Attributes:
        numbers: What stands in ``report.json``.
        folder: Folder of the files.
    """

    numbers: dict[str, Any]
    folder: Path


def choose_workers(text: str | None, scheduler: str | None = None) -> int:
    """Return the number of local workers: as given, else one for each core.

    Args:
        text: The number as given, or None.
        scheduler: Address of a Dask scheduler, which has workers of its own.

    Raises:
        ConfigError: The text is not a number of at least 1, or not wanted.
    """
    if text is None:
        if hasattr(os, "sched_getaffinity"):
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1
    if scheduler is not None:
        valid = "left out with --scheduler, whose cluster has workers of its own"
        raise ConfigError("--workers", text, valid, "command line")
    if not text.isdecimal() or int(text) < 1:
        valid = "a whole number of at least 1"
        raise ConfigError("--workers", text, valid, "command line")
    return int(text)


def run_study(
    file: Path,
    out_dir: Path | None = None,
    n_workers: int = 1,
    scheduler: str | None = None,
    earlier: Earlier | None = None,
) -> FinishedStudy:
    """Run a study, or the rest of it, and write all files.

    Args:
        file: The study.
        out_dir: Folder of the files; ``runs/study-<name>`` if None.
        n_workers: Number of local processes.
        scheduler: Address of a Dask scheduler to use instead, or None.
        earlier: Runs that are not done again, or None.

    Raises:
        ConfigError: Something is not valid; nothing is written then.
        StudyError: The workers cannot work; what is done is kept.
    """
    plan = load_plan(file)
    folder = out_dir or Path("runs") / f"study-{plan.name}"
    check_out_dir(folder)
    taken = read_earlier(earlier, plan) if earlier is not None else []
    check_plan(plan)
    with ExitStack() as stack:
        backend = stack.enter_context(open_backend(n_workers, scheduler))
        _make_folder(folder)
        ledger = stack.enter_context(open_ledger(folder, plan.digest, plan.name))
        write_file(folder / STUDY_FILE, plan.text.encode())
        _write_configs(plan, folder)
        _take_over(taken, ledger)
        _execute(plan, ledger, backend, folder)
        numbers = _write_results(plan, ledger, folder)
    return FinishedStudy(numbers, folder)


def print_study(finished: FinishedStudy) -> None:
    """Print what came out.

    Args:
        finished: The study.
    """
    numbers, console = finished.numbers, Console(highlight=False)
    lost = f", {numbers['lost']} without a result" if numbers["lost"] else ""
    console.print(
        f"{numbers['study']}: {numbers['runs']} runs, {numbers['survived']} still up "
        f"at the end, {numbers['fell']} fell{lost}",
        markup=False,
        soft_wrap=True,
    )
    if "cells_met" in numbers:
        n_met, n_cells = numbers["cells_met"], numbers["cells"]
        console.print(f"{n_met} of {n_cells} cells met all that their cases require")
    table = Table(box=None, pad_edge=False, show_header=False)
    for group in numbers["groups"]:
        for level in group["levels"]:
            words = f"{level['survival']:.0%} survive at {level['words']}"
            table.add_row(escape(group["label"]), words)
    if table.row_count:
        console.print(f"levels of {numbers['axis']}", markup=False)
        console.print(table)
    console.print(
        f"report in {finished.folder / REPORT_FILE}", markup=False, soft_wrap=True
    )


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        valid = f"a folder that can be written ({error.strerror})"
        raise ConfigError("--out", str(folder), valid, "command line") from error


def _write_configs(plan: Plan, folder: Path) -> None:
    """Write the configuration of all runs, of each case if there are several."""
    if not plan.study.cases:
        write_file(folder / CONFIG_FILE, format_config(plan.bases[0]).encode())
        return
    (folder / CASES_FOLDER).mkdir(exist_ok=True)
    for i, base in enumerate(plan.bases):
        file = folder / CASES_FOLDER / f"case-{i}.toml"
        write_file(file, format_config(base).encode())


def _take_over(taken: Sequence[Outcome], ledger: Ledger) -> None:
    """Enter earlier runs; those that were entered or done before stay."""
    done = {(outcome.cell, outcome.seed) for outcome in ledger.read()}
    for outcome in taken:
        if (outcome.cell, outcome.seed) not in done:
            ledger.write(outcome)


def _execute(plan: Plan, ledger: Ledger, backend: Backend, folder: Path) -> None:
    done = ledger.read()
    seeder = Seeder(plan, done)
    tasks = seeder.first_tasks()
    n_needed = len(done) + len(tasks)
    with make_study_progress(plan.name, len(done)) as progress:

        def finish(outcome: Outcome) -> Sequence[Task]:
            nonlocal n_needed
            if outcome.recording is not None:
                name = f"cell-{outcome.cell}-seed-{outcome.seed}.rrd"
                (folder / FALLS_FOLDER).mkdir(exist_ok=True)
                write_file(folder / FALLS_FOLDER / name, outcome.recording)
            ledger.write(outcome)
            more = seeder.next_tasks(outcome)
            n_needed += len(more)
            progress(n_needed, outcome)
            return more

        progress(n_needed, None)
        execute(tasks, backend, finish, plan.study.run_limit)


def _write_results(plan: Plan, ledger: Ledger, folder: Path) -> dict[str, Any]:
    from ballsim.studies.figures import render, render_cases  # noqa: PLC0415 (slow)

    outcomes, versions = ledger.read(), ledger.read_versions()
    rows = make_rows(plan, outcomes)
    metadata = {"study": plan.name, "digest": plan.digest, **versions}
    write_file(folder / RESULTS_FILE, pack_parquet(rows, metadata))
    analysis = analyse(plan.study, rows)
    for old in folder.glob("*.png"):
        if old.stem.startswith(_IS_PICTURE):
            old.unlink()
    verdicts = judge(plan, rows)
    names = []
    if analysis.rows:
        pictures = render(plan.study, analysis)
        if plan.study.cases:
            pictures = render_cases(plan, verdicts)
        for name, content in pictures:
            write_file(folder / name, content)
            names.append(name)
    report = format_report(plan, analysis, outcomes, versions, names, verdicts)
    write_file(folder / REPORT_FILE, report.encode())
    numbers = build_json(plan, analysis, outcomes, versions, verdicts)
    text = json.dumps(numbers, indent=1, allow_nan=False) + "\n"
    write_file(folder / NUMBERS_FILE, text.encode())
    return numbers
