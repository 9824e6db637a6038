"""Two runs beside each other: their figures overlaid, and what differs in numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ballsim.inspection.page import load_complete, render, write_figures
from ballsim.inspection.scaling import add_legend, limit_to_walk
from ballsim.run_files import check_out_dir, choose_out_dir, write_file
from ballsim.run_result import RunResult
from ballsim.settings import write_table
from ballsim.style import COLOURS, STYLE, make_figure
from ballsim_controllers.messages import Array

__all__ = ["Comparison", "compare", "compare_runs"]

_LINES: tuple[dict[str, Any], ...] = (
    {"color": COLOURS[0], "linestyle": "-"},
    {"color": COLOURS[1], "linestyle": "--"},
)
# What a repeat does not give again, what is no number, what the settings tell.
_LEFT_OUT = (
    "ball_inertia",
    "ball_mass",
    "ball_radius",
    "command",
    "controller",
    "duration",
    "realtime_factor",
    "robot",
    "scenario",
    "seed",
    "sensors",
    "trajectory_sha256",
    "versions",
    "wall_time",
)
Curve = Callable[[RunResult], tuple[Array, Array]]


@dataclass(frozen=True, slots=True)
class Comparison:
    """What differs between two runs.

    Attributes:
        names: What the two are called.
        settings: Dotted keys of the configuration whose values differ, with both.
        numbers: Numbers of the summary that differ, with both.
    """

    names: tuple[str, str]
    settings: Mapping[str, tuple[Any, Any]]
    numbers: Mapping[str, tuple[Any, Any]]

    def format_markdown(self) -> str:
        """Return two tables: settings, and numbers with their difference."""
        first, second = self.names
        lines = [f"# {first} and {second}", ""]
        if self.settings:
            lines += [f"| setting | {first} | {second} |", "| --- | --- | --- |"]
            for key, pair in self.settings.items():
                lines.append(f"| {key} | {_show(pair[0])} | {_show(pair[1])} |")
        else:
            lines.append("The same settings.")
        lines.append("")
        if not self.numbers:
            return "\n".join([*lines, "The same numbers.", ""])
        lines += [
            f"| number | {first} | {second} | difference |",
            "| --- | ---: | ---: | ---: |",
        ]
        for key, (one, other) in self.numbers.items():
            change = f"{other - one:+.4g}" if _are_numbers(one, other) else ""
            lines.append(f"| {key} | {_show(one)} | {_show(other)} | {change} |")
        return "\n".join([*lines, ""])


def compare(first: RunResult, second: RunResult, names: tuple[str, str]) -> Comparison:
    """Return what differs between two runs.

    Args:
        first: A run.
        second: Another one.
        names: What the two are called.
    """
    tables = [dict(_flatten(write_table(run.config))) for run in (first, second)]
    summaries = [dict(_flatten(run.summary)) for run in (first, second)]
    numbers = {
        key: pair
        for key, pair in _find_differences(*summaries).items()
        if key.split(".")[0] not in _LEFT_OUT
    }
    return Comparison(names, _find_differences(*tables), numbers)


def compare_runs(
    first: Path, second: Path, out: Path | None = None
) -> tuple[Comparison, Path]:
    """Compare two runs, and write table and figures.

    Args:
        first: Folder of a run, or its recording.
        second: Folder of another one.
        out: Folder of the files, ``runs/compare-...`` if None.

    Returns:
        What differs, and the folder of the files.

    Raises:
        ConfigError: A recording is missing, or the folder cannot be written.
    """
    runs = (load_complete(first), load_complete(second))
    folder = out or choose_out_dir("compare")
    check_out_dir(folder)
    names = _choose_names(first, second)
    comparison = compare(*runs, names)
    content = list(render(_draw(*runs, names)))
    write_figures(folder, "comparison", content)
    write_file(folder / "comparison.md", comparison.format_markdown().encode())
    return comparison, folder


def _draw(first: RunResult, second: RunResult, names: tuple[str, str]) -> Figure:
    """Draw curves of two runs over each other."""
    with mpl.rc_context(STYLE):
        figure, grid = make_figure(8.6, 4, 2)
        axes = [ax for row in grid for ax in row]
        for ax, (title, label, curve) in zip(axes, _PANELS, strict=True):
            _draw_panel(ax, curve, (first, second), names)
            ax.set(title=title, ylabel=label, xlabel="time [s]")
        add_legend(axes[0])
        return figure


def _draw_panel(
    ax: Axes,
    curve: Curve,
    runs: tuple[RunResult, RunResult],
    names: tuple[str, str],
) -> None:
    limit_to_walk(ax, [(run, *curve(run)) for run in runs])
    for run, name, line in zip(runs, names, _LINES, strict=True):
        ax.plot(*curve(run), label=name, **line)
        for event in run.events:
            if event.kind == "fall":
                ax.axvline(event.time, color=line["color"], linewidth=0.8)


def _signal(path: str, column: str, scale: float = 1.0) -> Curve:
    def curve(run: RunResult) -> tuple[Array, Array]:
        return run[path].time, scale * run[path][column]

    return curve


def _cop_deviation(run: RunResult) -> tuple[Array, Array]:
    actual, wanted = run["truth/cop"], run["control/cop"]
    x = actual["forward"] - wanted["ideal_forward"]
    y = actual["left"] - wanted["ideal_left"]
    return actual.time, 1e3 * np.hypot(x, y)


def _largest_torque(run: RunResult) -> tuple[Array, Array]:
    torques, limits = run["truth/joints/torque"], run["limits/joints/torque"]
    high = np.array([limits[f"{name}_high"][0] for name in torques.columns])
    return torques.time, np.abs(torques.values / high).max(axis=1)


_PANELS: tuple[tuple[str, str, Curve], ...] = (
    ("ball angle", "angle [rad]", _signal("truth/ball/angle", "forward")),
    ("ball speed", "speed [rad/s]", _signal("truth/ball/rate", "forward")),
    ("ball, to the left", "angle [rad]", _signal("truth/ball/angle", "left")),
    ("CoP forward", "from the ball [mm]", _signal("truth/cop", "forward", 1e3)),
    ("CoP left", "from the ball [mm]", _signal("truth/cop", "left", 1e3)),
    (r"CoP, actual $-$ ideal", "distance [mm]", _cop_deviation),
    ("largest joint torque", "part of its limit", _largest_torque),
    (
        "error of the estimated ball angle",
        "error [mrad]",
        _signal("estimate/error/angles", "ball_forward", 1e3),
    ),
)


def _choose_names(first: Path, second: Path) -> tuple[str, str]:
    one, other = (
        path.stem if path.is_file() else path.name for path in (first, second)
    )
    return (one, other) if one != other else (str(first), str(second))


def _find_differences(
    first: Mapping[str, Any], second: Mapping[str, Any]
) -> dict[str, tuple[Any, Any]]:
    return {
        key: (first.get(key), second.get(key))
        for key in dict.fromkeys((*first, *second))
        if first.get(key) != second.get(key)
    }


def _flatten(value: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted keys and single values of nested tables and lists."""
    if isinstance(value, Mapping):
        pairs = ((str(key), item) for key, item in value.items())
    elif isinstance(value, (list, tuple)):
        pairs = ((str(i), item) for i, item in enumerate(value))
    else:
        yield prefix, value
        return
    for key, item in pairs:
        yield from _flatten(item, f"{prefix}.{key}" if prefix else key)


def _are_numbers(*values: Any) -> bool:
    return all(
        isinstance(value, (int, float)) and not isinstance(value, bool)
        for value in values
    )


def _show(value: Any) -> str:
    if value is None:
        return "none"
    return f"{value:.5g}" if isinstance(value, float) else str(value)
