"""``ballsim run --live``: what it needs beside an ordinary run."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from ballsim.live.channel import LineChannel
from ballsim.live.keyboard import Keyboard, can_read_keys
from ballsim.live.keys import KEY_SUMMARY
from ballsim.live.pacer import Pacer
from ballsim.live.session import Channel, LiveSession
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
        with ExitStack() as stack:
            channel: Channel
            if can_read_keys(sys.stdin, sys.stderr):
                channel = self._keyboard = Keyboard(_STANDARD_INPUT, sys.stderr)
                stack.enter_context(channel.take_over())
                stack.callback(setattr, self, "_keyboard", None)
                self._tell(f"live; {KEY_SUMMARY}")
            else:
                channel = LineChannel(_STANDARD_INPUT)
                self._tell("live; type help for what can be said, quit or Ctrl-C ends")
            session = LiveSession(prepared, channel, pacer, self._tell)
            stack.enter_context(session.end_on_signal())
            yield session
        self._tell(pacer.describe())

    def _tell(self, line: str) -> None:
        if self._keyboard is not None:
            self._keyboard.tell(line)
        else:
            print(line, file=sys.stderr, flush=True)
