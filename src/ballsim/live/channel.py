"""Lines that come in while a run goes on; nobody ever waits for them."""

from __future__ import annotations

import os
import threading
from collections import deque

__all__ = ["LineChannel"]

_CHUNK = 4096  # [B]


class LineChannel:
    """Reads lines from a file descriptor in a thread of its own.

    It reads the descriptor itself: a thread that waits in ``sys.stdin`` would hold
    that lock of the interpreter beyond its end.

    Args:
        descriptor: What to read from, standard input as a rule.
    """

    def __init__(self, descriptor: int) -> None:
        """Start to read."""
        self._lines: deque[str] = deque()
        thread = threading.Thread(target=self._read, args=(descriptor,), daemon=True)
        thread.start()

    def poll(self) -> str | None:
        """Return the next line, None if there is none yet."""
        return self._lines.popleft() if self._lines else None

    def _read(self, descriptor: int) -> None:
        rest = b""
        while True:
            try:
                content = os.read(descriptor, _CHUNK)
            except OSError:  # it was closed, or is no terminal of ours
                content = b""
            *lines, rest = (rest + content).split(b"\n")
            if not content and rest:
                lines.append(rest)
            self._lines.extend(line.decode(errors="replace") for line in lines)
            if not content:
                return
