"""Makes the blocks of a run and hands them to all who want them."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace

import mujoco
import numpy as np

from ballsim.config import Config
from ballsim.recording.recorder import Recorder, RunBlock, RunContext
from ballsim.series import LiveState, RunSeries, StateSeries
from ballsim_controllers.messages import Array

__all__ = ["BlockDistributor"]

_N_LAST_STATES = 500  # ticks of the dump after a failure


class BlockDistributor:
    """Makes the blocks of a run, and hands each that is full to the recorders.

    Where nobody records, the blocks hold no more than the last states need.

    Args:
        context: What does not change during the run.
        recorders: Who gets the blocks.
        period: Time that a block holds, [s].
        is_pushed: True to keep the wrenches.

    Attributes:
        n_rows: Rows of a full block.
    """

    def __init__(
        self,
        context: RunContext,
        recorders: Iterable[Recorder],
        period: float,
        is_pushed: bool,
    ) -> None:
        """Make room for the last blocks."""
        self._context, self._recorders = context, tuple(recorders)
        self._is_pushed = is_pushed
        self._scratch = mujoco.MjData(context.model)
        self.n_rows = context.config.count_ticks(period)
        n_last = 1 + math.ceil(_N_LAST_STATES / self.n_rows)
        self._last: deque[RunSeries] = deque(maxlen=n_last)

    def start(self, live: LiveState) -> RunSeries:
        """Start the recorders and return the first block, with the state at the start.

        Args:
            live: The run, before its first step.
        """
        for recorder in self._recorders:
            recorder.start(self._context)
        kind = RunSeries if self._recorders else StateSeries
        model, is_pushed = self._context.model, self._is_pushed
        series = kind(self.n_rows, model, is_pushed=is_pushed)
        series.store_state(0, live)
        return series

    def hand_over(self, series: RunSeries, config: Config) -> RunSeries:
        """Give a block that is full, or the last one, to all; return the next.

        Args:
            series: The block; the loop must not write into it any more.
            config: The configuration as it is by now.
        """
        if config is not self._context.config:
            self._context = replace(self._context, config=config)
        series.trim()
        self._last.append(series)
        if series.n_ticks > 0:
            now = time.perf_counter()
            block = RunBlock(self._context, series, self._scratch, now)
            for recorder in self._recorders:
                recorder.record(block)
        return series.begin_next()

    def close(self) -> None:
        """End all recorders, each of them even if another one fails."""
        with ExitStack() as stack:
            for recorder in self._recorders:
                stack.callback(recorder.close)

    def last_states(self) -> dict[str, Array]:
        """Return time [s], states and inputs of the last ticks, by name."""
        series = RunSeries.join(list(self._last))
        rows = slice(max(0, series.n_ticks - _N_LAST_STATES), None)
        names = ("time", "qpos", "qvel", "ctrl")
        return {name: np.array(getattr(series, name)[rows]) for name in names}
