"""A piece of a run with everything that the log shows of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ballsim.recording.recorder import RunContext
from ballsim.series import RunSeries, TelemetrySeries
from ballsim.truth import (
    ContactTruth,
    StateTruth,
    compute_contact_truth,
    compute_state_truth,
)
from ballsim_controllers.messages import Array

__all__ = ["Block", "compute_block"]

IntArray = npt.NDArray[np.int_]


@dataclass(frozen=True, slots=True)
class Block:
    """Rows of a run: every tick, and fewer for what changes slowly.

    Attributes:
        context: What does not change.
        series: Time series of the run.
        ticks: Every tick of the block, as a slice of the series.
        slow_ticks: The ticks that the 3-D view and slow plots show.
        truth: True states at the slow ticks, in the robot's world.
        contact: True contact at every tick, in the robot's world.
    """

    context: RunContext
    series: RunSeries
    ticks: slice
    slow_ticks: IntArray
    truth: StateTruth
    contact: ContactTruth

    @property
    def time(self) -> Array:
        """Return the time of every tick, [s]."""
        return self.series.time[self.ticks]

    @property
    def slow_time(self) -> Array:
        """Return the time of the slow ticks, [s]."""
        return self.series.time[self.slow_ticks]

    @property
    def telemetry(self) -> TelemetrySeries:
        """Return what the controller reported, for all ticks of the run."""
        return self.series.telemetry

    @property
    def phases(self) -> npt.NDArray[np.int32]:
        """Return the gait phase at every tick."""
        return self.telemetry.phase[self.ticks]


def compute_block(
    context: RunContext,
    series: RunSeries,
    start: int,
    stop: int,
    slow_ticks: IntArray,
) -> Block:
    """Compute what the log shows of the ticks from start to stop.

    Args:
        context: What does not change.
        series: Time series of the run.
        start: First tick.
        stop: One past the last tick.
        slow_ticks: Ticks between them that the 3-D view and slow plots show.
    """
    ids, world = context.ids, context.world
    qpos, qvel = series.qpos[slow_ticks], series.qvel[slow_ticks]
    return Block(
        context=context,
        series=series,
        ticks=slice(start, stop),
        slow_ticks=slow_ticks,
        truth=compute_state_truth(context.model, ids, world, qpos, qvel),
        contact=compute_contact_truth(ids, world, series, start, stop),
    )
