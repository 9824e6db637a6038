"""A terminal whose keys come one by one, and that is left as it was found."""

from __future__ import annotations

import os
import select
import signal
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

from ballsim.live.keys import KeyReader

if sys.platform != "win32":
    import termios
    import tty

__all__ = ["Keyboard", "can_read_keys"]

_CHUNK = 4096  # [B]
_CLEAR_LINE = "\r\x1b[K"


def can_read_keys(source: TextIO, screen: TextIO) -> bool:
    """Return True where keys can come one by one: at a terminal that shows them.

    Args:
        source: Where they come from, standard input as a rule.
        screen: Where what is typed can be shown.
    """
    return sys.platform != "win32" and source.isatty() and screen.isatty()


class Keyboard:
    """Reads the keys of a terminal without waiting for any, and shows what is typed.

    Args:
        descriptor: The terminal.
        screen: Shows what is typed, and the replies.
    """

    def __init__(self, descriptor: int, screen: TextIO) -> None:
        """Change nothing yet."""
        self._descriptor, self._screen = descriptor, screen
        self._lines: deque[str] = deque()
        self._reader = KeyReader()
        self._before: list[Any] | None = None  # of the terminal, while it is changed
        self._has_ended = False

    @contextmanager
    def take_over(self) -> Iterator[None]:
        """Get keys one by one while the block runs; then all is as it was before.

        So it is while the process is suspended (Ctrl-Z), too.
        """
        before = signal.signal(signal.SIGTSTP, self._suspend)
        try:
            self._enter()
            yield
        finally:
            self._leave()
            signal.signal(signal.SIGTSTP, before)

    def poll(self) -> str | None:
        """Return the next line that is complete, None if there is none."""
        if not self._lines and not self._has_ended and self._is_ours():
            if self._before is None:  # back from the background
                self._enter()
            if select.select([self._descriptor], [], [], 0.0)[0]:
                self._read()
        return self._lines.popleft() if self._lines else None

    def tell(self, line: str) -> None:
        """Show a line above what is being typed."""
        self._show(f"{_CLEAR_LINE}{line}\n{self._reader.text}")

    def _read(self) -> None:
        try:
            content = os.read(self._descriptor, _CHUNK)
        except OSError:  # the terminal has gone
            content = b""
        self._has_ended = not content
        before = self._reader.text
        self._lines.extend(self._reader.read(content))
        if self._reader.text != before:
            self._show(f"{_CLEAR_LINE}{self._reader.text}")

    def _show(self, text: str) -> None:
        with suppress(OSError):  # the terminal has gone
            print(text, end="", file=self._screen, flush=True)

    def _is_ours(self) -> bool:
        """Return False in the background: who reads there is suspended."""
        try:
            return os.tcgetpgrp(self._descriptor) == os.getpgrp()
        except OSError:  # it is not the terminal that commands us
            return True

    def _enter(self) -> None:
        if self._before is None and self._is_ours():
            self._before = termios.tcgetattr(self._descriptor)
            tty.setcbreak(self._descriptor, termios.TCSADRAIN)

    def _leave(self) -> None:
        if self._before is not None:
            self._show(_CLEAR_LINE)
            before, self._before = self._before, None
            if self._is_ours():
                with suppress(termios.error):
                    termios.tcsetattr(self._descriptor, termios.TCSADRAIN, before)

    def _suspend(self, number: int, _frame: object) -> None:
        """Leave the terminal as it was, stop, and go on once it is ours again."""
        self._leave()
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
        signal.signal(number, self._suspend)
        self._enter()
