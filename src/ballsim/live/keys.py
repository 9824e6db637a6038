"""Single keys of an operator at a terminal: each stands for a line."""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass

__all__ = ["KEYS", "KEY_SUMMARY", "Key", "KeyReader"]


@dataclass(frozen=True, slots=True)
class Key:
    """A key that acts at once.

    Attributes:
        name: What stands on it.
        codes: What a terminal may send for it.
        line: The instruction that it stands for.
    """

    name: str
    codes: tuple[str, ...]
    line: str


def _make_arrow(name: str, letter: str, line: str) -> Key:
    # A terminal sends the second one in its "application mode".
    return Key(name, (f"\x1b[{letter}", f"\x1bO{letter}"), line)


KEYS = (
    _make_arrow("Up", "A", "push 40 forwards"),
    _make_arrow("Down", "B", "push 40 backwards"),
    _make_arrow("Left", "D", "push 40 left"),
    _make_arrow("Right", "C", "push 40 right"),
    Key("+", ("+", "="), "roll 0.25"),
    Key("-", ("-",), "roll -0.25"),
    Key("<", ("<", ","), "turn 15"),
    Key(">", (">", "."), "turn -15"),
    Key("Tab", ("\t",), "stepping"),
    Key("Space", (" ",), "stop"),
    Key("?", ("?",), "help"),
)
"""No letter, no digit: these begin a line."""

KEY_SUMMARY = (
    "keys: arrows push, + - roll on or back, < > turn, Tab steps or not, Space stops, "
    "? tells more; or type a line, such as push 60 left; quit or Ctrl-C ends"
)
"""What the keys do, on one line."""

_ENTER, _ERASE, _ERASE_ALL = "\r\n", "\x7f\b", "\x15"  # the last one is Ctrl-U
_SEQUENCE = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|O[ -~])")
_BEGUN = re.compile(r"\x1b(?:\[[0-?]*[ -/]*|O)?")
_LINES = {code: key.line for key in KEYS for code in key.codes}


class KeyReader:
    """Makes lines of what a terminal sends key by key.

    A key that acts at once does so where no line has been begun; an arrow does always.
    All else is text of a line, which can be corrected until Enter.

    Attributes:
        text: The line that has been begun.
    """

    def __init__(self) -> None:
        """Begin with an empty line."""
        self.text = ""
        self._rest = ""
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")

    def read(self, content: bytes) -> list[str]:
        """Return the lines that are complete.

        Args:
            content: What has come; it may end within a key's sequence.
        """
        lines = []
        text = self._rest + self._decoder.decode(content)
        while text:
            if _BEGUN.fullmatch(text):
                break  # the rest of the sequence is on its way
            found = _SEQUENCE.match(text)
            code = found[0] if found else text[0]
            text = text[len(code) :]
            if code in _LINES and (found or not self.text):
                lines.append(_LINES[code])
            elif code in _ENTER:
                lines.append(self.text)
                self.text = ""
            elif code in _ERASE:
                self.text = self.text[:-1]
            elif code in _ERASE_ALL:
                self.text = ""
            elif code.isprintable():
                self.text += code
        self._rest = text
        return lines
