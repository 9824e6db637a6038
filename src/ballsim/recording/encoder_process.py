"""A process that writes a recording, as the process of the loop sees it.

This module is light: the process can be started before anything heavy is imported,
so that its own imports go on beside those of the run.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from types import TracebackType
from typing import Any, Self

from ballsim.errors import BallsimError

__all__ = ["EncoderProcess"]

_MODULE = "ballsim.recording.encoder"
_PIPE_SIZE = 1 << 20  # the most that Linux gives to everyone, [B]


class EncoderProcess:
    """A process that runs `ballsim.recording.encoder`.

    It is in a session of its own, so that Ctrl-C does not reach it. It ends by itself
    when its input ends: no matter how this process dies, the recording is finished.

    Attributes:
        cpu_time: What the recording took there, imports left out, [s]; known once
            it is closed.
    """

    def __init__(self) -> None:
        """Start the process."""
        paths = (entry or os.getcwd() for entry in sys.path)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", _MODULE],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,  # its report; complaints go to our stderr
            bufsize=0,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            start_new_session=True,
        )
        self._is_used = self._is_closed = False
        self.cpu_time = 0.0
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        _widen(self._pipe)

    def __enter__(self) -> Self:
        """Return the process."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the process."""
        self.close()

    def send(self, message: dict[str, Any]) -> None:
        """Send a message; wait while the process is far behind.

        Args:
            message: See `ballsim.recording.encoder`.

        Raises:
            BallsimError: The process has failed.
        """
        from ballsim.recording.frames import write_frame  # noqa: PLC0415 - light start

        self._is_used = True
        try:
            write_frame(self._pipe, message)
        except BrokenPipeError:
            self.close()
            raise BallsimError("the recording has ended early") from None

    def close(self) -> None:
        """End the input and wait until the process has ended; may be called again.

        Raises:
            BallsimError: The process has failed.
        """
        if self._is_closed:
            return
        self._is_closed = True
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        with process.stdout:
            process.stdin.close()
            if not self._is_used:
                process.kill()
                process.wait()
                return
            report = process.stdout.read()
            code = process.wait()
        answer = {}
        with contextlib.suppress(ValueError):
            answer = json.loads(report)
        if "error" in answer:
            raise BallsimError(f"the recording failed: {answer['error']}")
        if code != 0 or "cpu_time" not in answer:
            cause = signal.strsignal(-code) if code < 0 else f"exit code {code}"
            raise BallsimError(f"the process of the recording died: {cause}")
        self.cpu_time = float(answer["cpu_time"])


def _widen(pipe: int) -> None:
    """Make room for some blocks, where the platform can: writing then rarely waits."""
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import fcntl  # noqa: PLC0415 - not on every system

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _PIPE_SIZE)
