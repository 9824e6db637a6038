"""A page with a picture of each task of the envelope, on all four balls.

``python -m ballsim.inspection.task_page FILE.png`` makes the runs, with perfect
sensors, and draws them.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ballsim.api import run
from ballsim.module_parser import OneLineParser
from ballsim.run_files import write_file
from ballsim.run_result import RunResult
from ballsim.style import COLOURS, REFERENCE, STYLE, make_figure

__all__ = ["TASKS", "Task", "draw_tasks", "main"]

_RADII = (0.25, 0.5, 0.75, 1.0)
_LINES = ("-", "--", "-.", ":")
_COLUMNS = 2

Draw = Callable[[Axes, RunResult, Mapping[str, Any]], None]


@dataclass(frozen=True, slots=True)
class Task:
    """A panel of the page.

    Attributes:
        title: What is asked.
        scenario: Scenario that asks it.
        draw: Draws a run into the panel.
        variants: What is asked for; the balls get every one of them.
        by_ball: True where the balls take turns with the variants.
        base: What all runs have in common.
        labels: Labels of the axes.
        is_map: True for a view from above.
    """

    title: str
    scenario: str
    draw: Draw
    variants: tuple[Mapping[str, Any], ...] = ({},)
    by_ball: bool = False
    base: Mapping[str, Any] = field(default_factory=dict)
    labels: tuple[str, str] = ("time [s]", "ball angle [rad]")
    is_map: bool = False

    def list_runs(self) -> list[tuple[float, dict[str, Any]]]:
        """Return the radius of the ball and the values to change of each run."""
        pairs = [
            (radius, variant)
            for i, radius in enumerate(_RADII)
            for j, variant in enumerate(self.variants)
            if not self.by_ball or j % len(_RADII) == i
        ]
        return [(radius, {**self.base, **variant}) for radius, variant in pairs]


def _draw_angle(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    angle, asked = result["truth/ball/angle"], result["control/ball/angle"]
    ax.step(asked.time, asked["target"], where="post", **REFERENCE)
    ax.plot(angle.time, angle["forward"], **style)


def _draw_speed(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    rate = result["truth/ball/rate"]
    ax.plot(rate.time, rate["forward"], **style)


def _draw_distance(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    time, places = _find_places(result)
    ax.plot(time, 1e3 * np.hypot(*(places - places[0]).T), **style)


def _draw_push(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    """Draw how far the CoM is beside the ball's centre, from the push on."""
    com, push = result["truth/com/position"], result.config.pushes[0]
    _, places = _find_places(result)
    beside = 1e3 * (com["left"] - places[: len(com.time), 1])
    ax.plot(com.time - push.time, beside, **style)
    ax.set_xlim(-1.0, 6.0)


def _draw_map(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    """Draw the way of the ball from above, forwards to the right."""
    _, places = _find_places(result)
    for point in result.config.command.timeline:
        trace = point.path.trace()
        if trace is not None:
            ax.plot(*trace.points.T, **REFERENCE)
    ax.plot(*places.T, **style)


def _draw_heading(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    attitude = result["truth/trunk/attitude"]
    yaw = np.unwrap(attitude["yaw"])
    ax.plot(attitude.time, np.degrees(yaw - yaw[0]), **style)


def _find_places(result: RunResult) -> tuple[np.ndarray, np.ndarray]:
    """Return times, (n,), [s], and the ball's places on the floor, (n, 2), [m]."""
    angle = result["truth/ball/angle"]
    turned = np.column_stack([angle["forward"], angle["left"]])
    return angle.time, result.config.ball.radius * turned


_EIGHT = tuple({"direction": 0.25 * np.pi * i} for i in range(8))
_PUSH = {"direction": 0.5 * np.pi, "force": 60.0}
_FLOOR = ("forwards [m]", "to the left [m]")
_BESIDE = ("time from the push on [s]", "CoM beside the ball [mm]")

#: The tasks, in the order of the page.
TASKS = (
    Task(
        "roll to 4 and -4 rad",
        "roll-to",
        _draw_angle,
        ({"target_angle": 4.0}, {"target_angle": -4.0}),
    ),
    Task(
        "change the target while walking",
        "change-target",
        _draw_angle,
        ({}, {"second": -0.3, "third": 0.5}),
    ),
    Task(
        "roll at 0.4 rad/s",
        "constant-velocity",
        _draw_speed,
        base={"duration": 30.0},
        labels=("time [s]", "ball speed [rad/s]"),
    ),
    Task(
        "stand",
        "stand",
        _draw_distance,
        base={"duration": 20.0},
        labels=("time [s]", "ball from its start [mm]"),
    ),
    Task(
        "push of 60 N from the right, standing",
        "push",
        _draw_push,
        base=_PUSH,
        labels=_BESIDE,
    ),
    Task(
        "the same, rolling at 0.3 rad/s",
        "push-rolling",
        _draw_push,
        base=_PUSH,
        labels=_BESIDE,
    ),
    Task(
        "roll 2 m, two directions each",
        "floor-target",
        _draw_map,
        _EIGHT,
        by_ball=True,
        labels=_FLOOR,
        is_map=True,
    ),
    Task(
        "turn by 90 degrees to either side",
        "heading",
        _draw_heading,
        ({"heading": 0.5 * np.pi}, {"heading": -0.5 * np.pi}),
        labels=("time [s]", "heading [degree]"),
    ),
    Task("circle of 1 m radius", "path", _draw_map, labels=_FLOOR, is_map=True),
    Task(
        "figure eight of 2 m by 1 m",
        "path",
        _draw_map,
        ({"curve": "figure-eight"},),
        labels=_FLOOR,
        is_map=True,
    ),
)


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
                i = _RADII.index(result.config.ball.radius)
                style = {"color": COLOURS[i], "linestyle": _LINES[i]}
                task.draw(ax, result, style)
            across, up = task.labels
            ax.set(title=task.title, xlabel=across, ylabel=up)
            if task.is_map:
                ax.set_aspect("equal", adjustable="datalim")
        for i, radius in enumerate(_RADII):
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
        prog="python -m ballsim.inspection.task_page",
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
