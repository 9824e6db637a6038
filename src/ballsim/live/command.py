"""``ballsim run --live``: what it needs beside an ordinary run."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from ballsim.live.channel import LineChannel
from ballsim.live.keyboard import Keyboard, can_read_keys
from ballsim.live.keys import KEY_SUMMARY
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
        self._keyboard: Keyboard | None = None
        self.view = LiveView(RecordingProcess(address), self._tell)

    @contextmanager
    def conduct(self, prepared: PreparedRun) -> Iterator[Conductor]:
        """Take a run over; tell in the end whether real time was kept.

        Args:
            prepared: The run.

        Yields:
            Who conducts it.
        """
        pacer = Pacer(prepared.config.simulation.control_period, self._tell)
        channel: LineChannel | Keyboard
        if can_read_keys(sys.stdin, sys.stderr):
            channel = Keyboard(_STANDARD_INPUT, sys.stderr)
        else:
            channel = LineChannel(_STANDARD_INPUT)
        session = LiveSession(prepared, channel, pacer, self._tell)
        # The signals first: none of them may leave a terminal that has been changed.
        with session.end_on_signal(), self._use(channel) as help_line:
            self._tell(f"live; {help_line}")
            yield session
        self._tell(pacer.describe())

    @contextmanager
    def _use(self, channel: LineChannel | Keyboard) -> Iterator[str]:
        """Take a terminal over, if it is one, and tell what can be done there."""
        if isinstance(channel, LineChannel):
            yield "type help for what can be said, quit or Ctrl-C to end"
            return
        with channel.take_over():
            self._keyboard = channel
            try:
                yield KEY_SUMMARY
            finally:
                self._keyboard = None

    def _tell(self, line: str) -> None:
        if self._keyboard is not None:
            self._keyboard.tell(line)
        else:
            print(line, file=sys.stderr, flush=True)
