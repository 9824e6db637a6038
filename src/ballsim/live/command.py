"""``ballsim run --live``: what it needs beside an ordinary run."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from ballsim.live.channel import LineChannel
from ballsim.live.operator import make_pushable
from ballsim.live.pacer import Pacer
from ballsim.live.session import LiveSession
from ballsim.live.viewer import LiveView, check_viewer, start_viewer
from ballsim.preparation import PreparedRun
from ballsim.recording.recording_process import RecordingProcess
from ballsim.simulation import Conductor

__all__ = ["LiveRun"]

_STANDARD_INPUT = 0


class LiveRun:
    """Viewer, clock and operator of a run.

    Args:
        url: Address of the viewer; None to start one.

    Raises:
        ConfigError: No viewer listens there.
        MissingDependencyError: A viewer cannot be started.

    Attributes:
        view: Shows the run block by block.
    """

    def __init__(self, url: str | None) -> None:
        """Find or start the viewer."""
        address = start_viewer() if url is None else check_viewer(url)
        self.view = LiveView(RecordingProcess(address), _tell)

    @contextmanager
    def conduct(self, prepared: PreparedRun) -> Iterator[tuple[PreparedRun, Conductor]]:
        """Take a run over; tell in the end whether real time was kept.

        Args:
            prepared: The run.

        Yields:
            The run, and who conducts it.
        """
        prepared = make_pushable(prepared)
        pacer = Pacer(prepared.config.simulation.control_period, _tell)
        channel = LineChannel(_STANDARD_INPUT)
        session = LiveSession(prepared, channel, pacer, _tell)
        _tell("live; type help for what can be said, quit or Ctrl-C to end")
        with session.end_on_interrupt():
            yield prepared, session
        _tell(pacer.describe())


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
