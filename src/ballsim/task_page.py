"""A page with a picture of each task of the envelope, on all four balls.

``python -m ballsim.task_page FILE.png`` makes the runs, with perfect
sensors, and draws them.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from ballsim.api import run
from ballsim.inspection.tasks import RADII, TASKS, Task
from ballsim.module_parser import OneLineParser
from ballsim.run_files import write_file
from ballsim.run_result import RunResult
from ballsim.style import COLOURS, STYLE, make_figure

__all__ = ["draw_tasks", "main"]

_LINES = ("-", "--", "-.", ":")
_COLUMNS = 2


def draw_tasks(tasks: Sequence[Task], results: Sequence[Sequence[RunResult]]) -> Figure:
    """Draw the page.

    Args:
        tasks: The tasks.
        results: Runs of each task.
    """
    rows = -(-len(tasks) // _COLUMNS)
    with mpl.rc_context(STYLE):
        figure, grid = make_figure(2.1 * rows, rows, _COLUMNS)
        panels = [ax for row in grid for ax in row]
        for ax in panels[len(tasks) :]:
            ax.remove()
        for ax, task, runs in zip(panels, tasks, results, strict=False):
            for result in runs:
                i = RADII.index(result.config.ball.radius)
                style = {"color": COLOURS[i], "linestyle": _LINES[i]}
                task.draw(ax, result, style)
            across, up = task.labels
            ax.set(title=task.title, xlabel=across, ylabel=up)
            if task.is_map:
                ax.set_aspect("equal", adjustable="datalim")
        for i, radius in enumerate(RADII):
            label = f"ball of {radius:g} m"
            panels[0].plot([], [], color=COLOURS[i], linestyle=_LINES[i], label=label)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        return figure


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the runs and draw them; see the module.

    Args:
        arguments: Words of the command line, those of the process if None.
    """
    parser = OneLineParser(
        prog="python -m ballsim.task_page",
        description="Draw a page with a picture of each task, on four balls.",
    )
    add = parser.add_argument
    add("file", metavar="FILE.png", type=Path, help="the picture")
    add("--seed", type=int, default=0, metavar="N", help="of all runs")
    add("--workers", type=int, default=1, metavar="N", help="processes")
    options = parser.parse_args(arguments)
    wanted = [
        (task.scenario, {**changes, "ball_radius": radius, "seed": options.seed})
        for task in TASKS
        for radius, changes in task.list_runs()
    ]
    with ProcessPoolExecutor(max(1, options.workers), get_context("spawn")) as pool:
        made = iter(list(pool.map(_run, wanted)))
    results = [[next(made) for _ in task.list_runs()] for task in TASKS]
    fallen = [result for runs in results for result in runs if not result.survived]
    if fallen:
        print(f"{parser.prog.split()[-1]}: {fallen[0]!r}", file=sys.stderr)
        return 3
    buffer = io.BytesIO()
    draw_tasks(TASKS, results).savefig(buffer, format="png")
    write_file(options.file, buffer.getvalue())
    print(options.file)
    return 0


def _run(wanted: tuple[str, dict[str, Any]]) -> RunResult:
    scenario, changes = wanted
    return run(scenario, **changes)


if __name__ == "__main__":
    sys.exit(main())
