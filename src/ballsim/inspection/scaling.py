"""Limits of axes: what happens while a robot falls must not hide the rest."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes

from ballsim.recording.events import FALL
from ballsim.run_result import RunResult
from ballsim_controllers.messages import Array

__all__ = ["add_legend", "limit_to_walk"]

_BEFORE_FALL = 0.5  # before it is detected, a fall has begun, [s]
_MARGIN = 0.08


def limit_to_walk(ax: Axes, curves: Iterable[tuple[RunResult, Array, Array]]) -> None:
    """Set the limits of the y axis by what was before a fall.

    Args:
        ax: The axes.
        curves: Run, times [s] and values of each curve.
    """
    low, high = np.inf, -np.inf
    for run, time, values in curves:
        falls = [event.time for event in run.events if event.kind == FALL]
        end = falls[0] - _BEFORE_FALL if falls else np.inf
        shown = values[(time <= max(end, _BEFORE_FALL)) & np.isfinite(values)]
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
    ax.set_ylim(low, high + 0.22 * (high - low))
    ax.legend(
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
