"""The signals and events of a run that has been kept in memory."""

from __future__ import annotations

import mujoco
import numpy as np

from ballsim.recording.block import compute_block
from ballsim.recording.bounds import (
    BOUNDS,
    ErrorBounds,
    compute_bounds,
    has_bounds,
)
from ballsim.recording.catalogue import make_signals
from ballsim.recording.events import Event, EventFinder
from ballsim.recording.limits import Limits, find_limits
from ballsim.recording.recorder import RunBlock, RunContext
from ballsim.recording.signals import Signal
from ballsim.series import RunSeries
from ballsim.time_series import TimeSeries
from ballsim_controllers.messages import Array

__all__ = ["collect_events", "collect_signals"]


def collect_signals(context: RunContext, series: RunSeries) -> dict[str, TimeSeries]:
    """Return what the log of a run would hold, in double precision, by path.

    Args:
        context: What did not change during the run.
        series: All of its rows.
    """
    block = compute_block(RunBlock(context, series, mujoco.MjData(context.model)))
    last = float(block.time[-1])
    ends = np.array([0.0, last] if last > 0.0 else [0.0])
    limits = [
        _make_series(item, ends, np.tile(item.values, (len(ends), 1)))
        for item in find_limits(context)
    ]
    signals = [
        _make_series(
            signal,
            block.slow_time if signal.is_slow else block.time,
            signal.compute(block),
        )
        for signal in make_signals(context)
    ]
    found = (*limits, *_collect_bounds(context, last), *signals)
    return {series.path: series for series in found}


def _collect_bounds(context: RunContext, last: float) -> list[TimeSeries]:
    """Return the bounds of the estimate's errors up to a time in [s]."""
    if not has_bounds(context.config):
        return []
    time, values = compute_bounds(context.config)
    n = int(np.searchsorted(time, last, side="right"))
    return [_make_series(item, time[:n], values[item.path][:n]) for item in BOUNDS]


def _make_series(
    item: Signal | Limits | ErrorBounds, time: Array, values: Array
) -> TimeSeries:
    path, unit, text = item.path[1:], item.unit, item.description
    return TimeSeries(path, unit, text, item.columns, time, values)


def collect_events(context: RunContext, series: RunSeries) -> tuple[Event, ...]:
    """Return the events of a run, in the order of their times.

    Args:
        context: What did not change during the run.
        series: All of its rows.
    """
    finder = EventFinder(context)
    events, fall = finder.find(series, context.config), finder.finish()
    return (*events, fall) if fall is not None else tuple(events)
