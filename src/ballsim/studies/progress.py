"""What the terminal shows while a study runs."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from ballsim.studies.single_run import FINISHED, Outcome

__all__ = ["OnProgress", "make_study_progress"]

_LINE_PERIOD = 60.0  # between two lines where there is no terminal, [s]

OnProgress = Callable[[int, Outcome | None], None]


class _RateColumn(TextColumn):
    def __init__(self) -> None:
        super().__init__("")

    def render(self, task: Task) -> Text:
        """Return the rate, in runs for each second or minute."""
        rate = task.finished_speed or task.speed
        if not rate:
            return Text("")
        text = f"{rate:.1f} runs/s" if rate >= 1.0 else f"{60.0 * rate:.1f} runs/min"
        return Text(text)


@contextmanager
def make_study_progress(name: str, n_done: int) -> Iterator[OnProgress]:
    """Show a progress bar on stderr; a line now and then if that is no terminal.

    Args:
        name: Name of the study.
        n_done: Runs that are done already.

    Yields:
        What to call with the number of runs that are known to be needed, and each
        outcome.
    """
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        _RateColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[falls]} fell{task.fields[lost]}"),
    )
    is_shown = console.is_terminal
    with Progress(
        *columns, console=console, transient=True, disable=not is_shown
    ) as bar:
        task = bar.add_task(name, total=None, completed=n_done, falls=0, lost="")
        n_new = n_falls = n_lost = 0
        last_line = time.monotonic()

        def update(n_needed: int, outcome: Outcome | None) -> None:
            nonlocal n_new, n_falls, n_lost, last_line
            if outcome is not None:
                n_new += 1
                is_finished = outcome.status == FINISHED
                n_lost += not is_finished
                n_falls += is_finished and not outcome.summary["survived"]
                bar.advance(task)
            lost = f", {n_lost} lost" if n_lost else ""
            if not is_shown and time.monotonic() - last_line > _LINE_PERIOD:
                last_line = time.monotonic()
                n = n_done + n_new
                print(f"{name}: {n}/{n_needed}, {n_falls} fell{lost}", file=sys.stderr)
            bar.update(task, total=n_needed, falls=n_falls, lost=lost)

        yield update
