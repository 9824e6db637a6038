"""What the recorder is made of: each track logs one thing of a run."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import rerun as rr

from ballsim.recording.block import Block
from ballsim.recording.recorder import RunContext
from ballsim_controllers.messages import Array

__all__ = ["TIMELINE", "Track", "time_column"]

TIMELINE = "sim_time"


class Track(Protocol):
    """Logs one thing of a run: what does not change, then block by block."""

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log what does not change."""
        ...

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log the rows that follow those of the block before."""
        ...

    def finish(self, stream: rr.RecordingStream) -> None:
        """Log what is known at the end only."""
        ...


def time_column(times: Array) -> list[rr.TimeColumn]:
    """Return the index of some rows.

    Args:
        times: Times of the rows, shape (n,), [s].
    """
    nanoseconds = np.round(1e9 * times).astype("timedelta64[ns]")
    return [rr.TimeColumn(TIMELINE, duration=nanoseconds)]
