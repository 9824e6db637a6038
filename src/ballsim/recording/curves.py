"""The signals, as curves, and how fast the loop was."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from ballsim.config import Config
from ballsim.recording.block import Block
from ballsim.recording.bounds import BOUNDS, ErrorBounds, compute_bounds, has_bounds
from ballsim.recording.catalogue import make_signals
from ballsim.recording.columns import make_scalars
from ballsim.recording.limits import Limits, find_limits
from ballsim.recording.palette import ERROR_COLOURS, ESTIMATE, joint_colours, pale
from ballsim.recording.paths import SPEED_PATH
from ballsim.recording.recorder import RunBlock, RunContext
from ballsim.recording.signals import Signal
from ballsim.recording.tracks import time_column
from ballsim_controllers.messages import Array

__all__ = ["BoundLines", "Curves", "LimitLines", "SpeedCurve"]

_FINE, _HAIRLINE = 1.3, 0.5
# The viewer draws in the order of the paths: what lies below must be wider.
_WIDTHS = {"control": 4.0, "estimate": 2.6, "truth": _FINE, "sensors": _FINE}  # [pt]


class Curves:
    """All signals."""

    def __init__(self) -> None:
        """Prepare to start."""
        self._signals: tuple[Signal, ...] = ()

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log names, units and colours."""
        self._signals = make_signals(context)
        for signal in self._signals:
            width = _WIDTHS[signal.kind]
            lines = rr.SeriesLines(
                names=signal.line_names,
                colors=signal.colours,
                widths=[width] * len(signal.columns),
            )
            _log_static(stream, signal, lines)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log the values, in single precision."""
        fast, slow = time_column(block.time), time_column(block.slow_time)
        for signal in self._signals:
            values = signal.compute(block)
            time = slow if signal.is_slow else fast
            stream.send_columns(signal.path, time, make_scalars(values))

    def finish(self, stream: rr.RecordingStream) -> None:
        """Do nothing."""


class LimitLines:
    """The limits of joints and drives, from the start of the run to its end."""

    def __init__(self) -> None:
        """Prepare to start."""
        self._limits: tuple[Limits, ...] = ()
        self._last = 0.0

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log names, units and colours, and where the lines begin."""
        self._limits = find_limits(context)
        colours = joint_colours(len(context.ids.joint_names))
        for limits in self._limits:
            lines = rr.SeriesLines(
                names=[name.replace("_", " ") for name in limits.columns],
                colors=colours * 2,
                widths=[_HAIRLINE] * len(limits.columns),
            )
            _log_static(stream, limits, lines)
        self._send(stream, 0.0)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Remember how long the run is."""
        self._last = float(block.time[-1])

    def finish(self, stream: rr.RecordingStream) -> None:
        """Log where the lines end."""
        if self._last > 0.0:
            self._send(stream, self._last)

    def _send(self, stream: rr.RecordingStream, time: float) -> None:
        for limits in self._limits:
            columns = make_scalars(limits.values[None])
            stream.send_columns(limits.path, time_column(np.array([time])), columns)


class BoundLines:
    """How large the errors of the estimate should be.

    They follow from the configuration. They are computed while the run goes on, when
    the controller has loaded what is compiled, and logged at its end.
    """

    def __init__(self) -> None:
        """Prepare to start."""
        self._config: Config | None = None
        self._time, self._values = np.zeros(0), dict[str, Array]()
        self._last = -1.0

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log names, units and colours."""
        if not has_bounds(context.config):
            return
        self._config = context.config
        for bounds in BOUNDS:
            n = len(bounds.columns)
            lines = rr.SeriesLines(
                names=[name.replace("_", " ") for name in bounds.columns],
                colors=[pale(colour) for colour in ERROR_COLOURS[: n // 2]] * 2,
                widths=[_HAIRLINE] * n,
            )
            _log_static(stream, bounds, lines)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Compute them once, and remember how long the run is."""
        if self._config is not None and self._last < 0.0:
            self._time, self._values = compute_bounds(self._config)
        self._last = float(block.time[-1])

    def finish(self, stream: rr.RecordingStream) -> None:
        """Log them up to the end of the run."""
        n = int(np.searchsorted(self._time, self._last, side="right"))
        for path, values in self._values.items():
            time = time_column(self._time[:n])
            stream.send_columns(path, time, make_scalars(values[:n]))


class SpeedCurve:
    """Simulated time by wall-clock time of each block but the first."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._last = math.nan
        self._times: list[float] = []
        self._factors: list[float] = []

    def start(self, stream: rr.RecordingStream) -> None:
        """Log name and unit."""
        lines = rr.SeriesLines(names=["speed"], colors=[ESTIMATE], widths=[_FINE])
        values = rr.AnyValues(
            unit="x real time",
            description="simulated time by wall-clock time of the loop, block by block",
            columns=["factor"],
        )
        stream.log(SPEED_PATH, lines, values, static=True)

    def add(self, block: RunBlock) -> None:
        """Take a block as the loop has handed it over."""
        times = block.series.time
        elapsed = block.wall_time - self._last
        if elapsed > 0.0:
            self._times.append(float(times[-1]))
            self._factors.append(float(times[-1] - times[0]) / elapsed)
        self._last = block.wall_time

    def send(self, stream: rr.RecordingStream) -> None:
        """Log what has come in."""
        if self._times:
            columns = make_scalars(np.array(self._factors)[:, None])
            time = time_column(np.array(self._times))
            stream.send_columns(SPEED_PATH, time, columns)
        self._times, self._factors = [], []


def _log_static(
    stream: rr.RecordingStream,
    item: Signal | Limits | ErrorBounds,
    lines: rr.SeriesLines,
) -> None:
    """Log how a series is drawn, and what it is, for those who read it back."""
    values = rr.AnyValues(
        unit=item.unit, description=item.description, columns=list(item.columns)
    )
    stream.log(item.path, lines, values, static=True)
