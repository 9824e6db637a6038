"""The command ``ballsim paper``: runs, files, table."""

from __future__ import annotations

import importlib.util
import json
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from ballsim.errors import ConfigError, MissingDependencyError
from ballsim.paper.comparison import Row, compare, format_table
from ballsim.paper.experiments import Progress as ProgressCallback
from ballsim.paper.experiments import run_experiments
from ballsim.paper.report import build_report, format_markdown
from ballsim.run_files import check_out_dir, choose_out_dir, write_file

__all__ = ["REPORT_FILE", "TABLE_FILE", "FinishedPaper", "print_table", "run_paper"]

REPORT_FILE = "paper.json"
TABLE_FILE = "table.md"


@dataclass(frozen=True, slots=True)
class FinishedPaper:
    """A reproduction whose files are written.

    Attributes:
        report: What stands in ``paper.json``.
        rows: The table.
        folder: Folder of the files.
    """

    report: dict[str, Any]
    rows: list[Row]
    folder: Path


def run_paper(out_dir: Path | None, command: str = "ballsim.paper") -> FinishedPaper:
    """Reproduce Section VI and write all files.

    Args:
        out_dir: Folder of the files, created if need be; the first free
            ``runs/paper-<number>`` if None.
        command: Command line, for the report.

    Raises:
        ConfigError: The folder cannot be written; nothing is written then.
        MissingDependencyError: Matplotlib is not installed.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingDependencyError("ballsim paper", "matplotlib")
    folder = out_dir or choose_out_dir("paper")
    check_out_dir(folder)
    _make_folder(folder)
    with _make_progress() as progress:
        experiments = run_experiments(progress)
    rows = compare(experiments)
    report = build_report(experiments, command)
    from ballsim.paper.figures import render  # noqa: PLC0415 (takes a second)

    for name, content in render(experiments):
        write_file(folder / name, content)
    write_file(folder / TABLE_FILE, format_markdown(rows).encode())
    text = json.dumps(report, indent=1, allow_nan=False) + "\n"
    write_file(folder / REPORT_FILE, text.encode())
    return FinishedPaper(report, rows, folder)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        valid = f"a folder that can be written ({error.strerror})"
        raise ConfigError("--out", str(folder), valid, "command line") from error


@contextmanager
def _make_progress() -> Iterator[ProgressCallback | None]:
    """Show a progress bar on stderr, if that is a terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = (TextColumn("{task.description}"), BarColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("simulating Section VI")
        yield lambda n_done, n: bar.update(task, completed=n_done, total=n)


def print_table(rows: Iterable[Row], folder: Path) -> None:
    """Print the table on the terminal.

    Args:
        rows: Rows of the table.
        folder: Folder of the files.
    """
    console = Console(highlight=False)
    head, *body = format_table(rows)
    console.print(_line(head), style="bold", soft_wrap=True, markup=False)
    heading = ""
    for cells in body:
        if heading != (heading := f"Fig. {cells[0]}: {cells[2]}"):
            console.print(heading, style="bold", soft_wrap=True, markup=False)
        console.print(_line(cells), soft_wrap=True, markup=False)
    console.print(f"files in {folder}", soft_wrap=True, markup=False)


def _line(cells: Sequence[str]) -> str:
    """Return a line of the table without figure and quantity, its headings."""
    _, radius, _, paper, ours, difference, parameter_set, note = cells
    columns = f"{radius:>8} {paper:>14} {ours:>8} {difference:>10}"
    return f"{columns}  {parameter_set:<5}  {note}".rstrip()
