"""Limits of axes: what happens while a robot falls must not hide the rest."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes

from ballsim.recording.events import FALL
from ballsim.run_result import RunResult
from ballsim_controllers.messages import Array

__all__ = ["add_legend", "find_walk_end", "limit_to_walk"]

_BEFORE_FALL = 0.5  # before it is detected, a fall has begun, [s]
_MARGIN = 0.08
_LEGEND_ROW = 0.1  # height of a row, as a part of the axes


def find_walk_end(run: RunResult) -> float:
    """Return the time from which on a run is a fall, infinity if it is none, [s].

    At least the first half second counts as a walk.

    Args:
        run: The run.
    """
    falls = [event.time for event in run.events if event.kind == FALL]
    return max(falls[0] - _BEFORE_FALL, _BEFORE_FALL) if falls else math.inf


def limit_to_walk(ax: Axes, curves: Iterable[tuple[RunResult, Array, Array]]) -> None:
    """Set the limits of the y axis by what was before a fall.

    Args:
        ax: The axes.
        curves: Run, times [s] and values of each curve.
    """
    low, high = np.inf, -np.inf
    for run, time, values in curves:
        shown = values[(time <= find_walk_end(run)) & np.isfinite(values)]
        if shown.size > 0:
            low, high = min(low, float(shown.min())), max(high, float(shown.max()))
    if high > low:
        margin = _MARGIN * (high - low)
        ax.set_ylim(low - margin, high + margin)


def add_legend(ax: Axes, columns: int = 2) -> None:
    """Add a legend that the curves do not make unreadable.

    Args:
        ax: The axes.
        columns: Number of columns.
    """
    low, high = ax.get_ylim()
    handles, labels = ax.get_legend_handles_labels()
    part = _LEGEND_ROW * math.ceil(len(handles) / columns)
    ax.set_ylim(low, low + (high - low) / (1.0 - part))
    ax.legend(
        handles,
        labels,
        ncols=columns,
        loc="upper center",
        frameon=True,
        framealpha=0.85,
        edgecolor="none",
        borderpad=0.2,
        fontsize=6.5,
        handlelength=2.5,
        columnspacing=1.0,
    )
