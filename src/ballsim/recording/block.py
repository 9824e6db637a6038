"""A piece of a run with everything that the log shows of it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ballsim.recording.recorder import RunBlock, RunContext
from ballsim.series import RunSeries, TelemetrySeries
from ballsim.truth import ContactTruth, StateTruth
from ballsim_controllers.messages import Array

__all__ = ["Block", "compute_block"]

IntArray = npt.NDArray[np.int_]


@dataclass(frozen=True, slots=True)
class Block:
    """Rows of a run: every tick, and fewer for what changes slowly.

    Attributes:
        context: What does not change.
        series: The rows.
        slow_rows: The rows that the 3-D view and slow plots show.
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


def compute_block(block: RunBlock, stride: int) -> Block:
    """Compute what the log shows of a piece of a run.

    Args:
        block: The piece.
        stride: Ticks between two that the 3-D view and slow plots show; the
            first is that of the run.
    """
    series = block.series
    first = -series.first_tick % stride
    slow = np.arange(first, series.n_ticks, stride)
    truth = StateTruth(
        **{
            field.name: getattr(block.truth, field.name)[slow]
            for field in dataclasses.fields(StateTruth)
        }
    )
    return Block(block.context, series, slow, truth, block.contact)
