"""What the terminal shows: progress on stderr, a readable summary on stdout."""

from __future__ import annotations

import os
import shutil
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from ballsim.config import Config
from ballsim.errors import ConfigError, MissingDependencyError
from ballsim.simulation import Progress as ProgressCallback

__all__ = ["explain_delay", "make_progress", "open_viewer", "print_summary"]

# For this machine only, at ports that are free: rerun's default is every network.
_WEB_OPTIONS = (
    *("--web-viewer", "--bind", "127.0.0.1"),
    *("--web-viewer-port", "0", "--port", "auto"),
)

# Rows of the table: label, key of the summary, factor for display, unit.
_ROWS = (
    ("simulated", "simulated_time", 1.0, "s"),
    ("ball angle, target", "target_ball_angle", 1.0, "rad"),
    ("ball angle, final", "final_ball_angle", 1.0, "rad"),
    ("ball angle, error", "ball_angle_error", 1.0, "rad"),
    ("ball angle, overshoot", "ball_angle_overshoot", 1.0, "rad"),
    ("hold errors, largest", "hold_error_max", 1.0, "rad"),
    ("distance to the target", "floor_target_error", 1e3, "mm"),
    ("cross-track error, rms", "cross_track_rms", 1e3, "mm"),
    ("cross-track error, max", "cross_track_max", 1e3, "mm"),
    ("heading error", "heading_error", 1.0, "rad"),
    ("ball speed, last half", "ball_speed_mean", 1.0, "rad/s"),
    ("lateral drift", "ball_lateral_drift", 1e3, "mm"),
    ("CoP deviation, rms", "cop_deviation_rms", 1e3, "mm"),
    ("CoP deviation, max", "cop_deviation_max", 1e3, "mm"),
    ("steps", "step_count", 1, ""),
    ("peak joint torque", "peak_joint_torque", 1.0, "N m"),
    ("speed", "realtime_factor", 1.0, "x real time"),
)


@contextmanager
def explain_delay(reason: str, patience: float) -> Iterator[None]:
    """Say on stderr why something takes long, should it do so.

    Args:
        reason: One line.
        patience: Time until then, [s].
    """
    console = Console(stderr=True)
    timer = threading.Timer(patience, console.print, (reason,), {"highlight": False})
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextmanager
def make_progress(config: Config) -> Iterator[ProgressCallback | None]:
    """Show a progress bar on stderr, if that is a terminal.

    Args:
        config: The run.

    Yields:
        What to call with ticks done and ticks in all, or None.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[time]:6.1f} s"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(config.scenario, total=config.n_ticks, time=0.0)
        period = config.simulation.control_period

        def update(n_done: int, _n_ticks: int) -> None:
            bar.update(task, completed=n_done, time=n_done * period)

        yield update


def print_summary(summary: Mapping[str, Any], folder: Path) -> None:
    """Print the summary of a run as a table.

    Args:
        summary: The summary.
        folder: Folder of the files.
    """
    console = Console(highlight=False)
    if summary["survived"]:
        verdict = "[green]still up at the end[/green]"
    else:
        time, reason = summary["fall_time"], escape(summary["fall_reason"])
        verdict = f"[red]fell at {time:.2f} s: {reason}[/red]"
    name, controller = escape(summary["scenario"]), escape(summary["controller"])
    console.print(f"[bold]{name}[/bold] with {controller}: {verdict}")
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column()
    table.add_column(justify="right")
    table.add_column()
    for label, key, factor, unit in _ROWS:
        value = summary[key]
        is_repeated = key == "hold_error_max" and len(summary["hold_errors"]) < 2
        if value is None or is_repeated:
            continue
        text = str(value) if isinstance(value, int) else f"{factor * value:.3f}"
        table.add_row(label, text, unit)
    console.print(table)
    console.print(f"files in {folder}", soft_wrap=True, markup=False)


def open_viewer(path: Path, is_web: bool) -> int:
    """Replace this process by the rerun viewer.

    Args:
        path: Folder of a run, or a recording.
        is_web: True to show it in a browser.

    Raises:
        ConfigError: There is no recording.
        MissingDependencyError: The viewer is not installed.
    """
    recording = path / "run.rrd" if path.is_dir() else path
    if not recording.is_file():
        valid = "the folder of a run with run.rrd, or an .rrd file"
        raise ConfigError("DIR_OR_RRD", str(path), valid, "command line")
    beside_python = str(Path(sys.executable).parent)
    viewer = shutil.which("rerun", path=beside_python) or shutil.which("rerun")
    if viewer is None:
        raise MissingDependencyError("ballsim view", "the rerun viewer (rerun-sdk)")
    arguments = [viewer, *(_WEB_OPTIONS if is_web else ()), str(recording)]
    if is_web:  # it has to tell its address
        os.environ["RUST_LOG"] = "warn,re_sdk::web_viewer=info"
    os.execv(viewer, arguments)
