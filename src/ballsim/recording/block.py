"""A piece of a run with everything that the log shows of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ballsim.recording.recorder import RunBlock, RunContext
from ballsim.series import RunSeries, TelemetrySeries
from ballsim.truth import ContactTruth, StateTruth, compute_state_truth
from ballsim_controllers.messages import Array

__all__ = ["SLOW_PERIOD", "Block", "compute_block"]

IntArray = npt.NDArray[np.int_]

SLOW_PERIOD = 0.02
"""Time between two rows of what changes slowly, [s]."""


@dataclass(frozen=True, slots=True)
class Block:
    """Rows of a run: every tick, and fewer for what changes slowly.

    Attributes:
        context: What does not change.
        series: The rows.
        slow_rows: The rows that the 3-D view and the slow signals show.
        truth: True states at the slow rows, in the robot's world.
        contact: True contact at every row, in the robot's world.
    """

    context: RunContext
    series: RunSeries
    slow_rows: IntArray
    truth: StateTruth
    contact: ContactTruth

    @property
    def time(self) -> Array:
        """Return the time of every tick, [s]."""
        return self.series.time[:-1]

    @property
    def slow_time(self) -> Array:
        """Return the time of the slow rows, [s]."""
        return self.series.time[self.slow_rows]

    @property
    def telemetry(self) -> TelemetrySeries:
        """Return what the controller reported."""
        return self.series.telemetry


def compute_block(block: RunBlock) -> Block:
    """Compute what the log shows of a piece of a run.

    Args:
        block: The piece.
    """
    context, series = block.context, block.series
    period = context.config.simulation.control_period
    stride = max(1, round(SLOW_PERIOD / period))
    slow = np.arange(-series.first_tick % stride, series.n_ticks, stride)
    truth = compute_state_truth(
        context.model,
        context.ids,
        context.world,
        series.qpos[slow],
        series.qvel[slow],
        block.scratch,
    )
    return Block(context, series, slow, truth, block.contact)
