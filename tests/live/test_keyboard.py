"""Single keys: what they mean, and a terminal that is left as it was found."""

from __future__ import annotations

import io
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ballsim.config_io import load_config
from ballsim.live.instructions import parse_instruction
from ballsim.live.keyboard import Keyboard, can_read_keys
from ballsim.live.keys import KEY_SUMMARY, KEYS, KeyReader
from ballsim.live.pacer import Pacer
from ballsim.live.session import LiveSession
from ballsim.preparation import prepare
from ballsim.replay import replay
from ballsim.run_files import run_with_files

if sys.platform == "win32":
    pytest.skip("no terminals", allow_module_level=True)

import pty
import termios

UP, RIGHT = "\x1b[A", "\x1b[C"


def _read(*pieces: str | bytes) -> tuple[list[str], str]:
    reader, lines = KeyReader(), []
    for piece in pieces:
        lines += reader.read(piece if isinstance(piece, bytes) else piece.encode())
    return lines, reader.text


def test_each_key_is_an_instruction() -> None:
    """What a key stands for is understood; no two keys send the same."""
    codes = [code for key in KEYS for code in key.codes]
    assert len(codes) == len(set(codes))
    for key in KEYS:
        assert parse_instruction(key.line) is not None
        for code in key.codes:
            assert _read(code) == ([key.line], "")
    assert "\n" not in KEY_SUMMARY


def test_lines_can_be_typed_beside_the_keys() -> None:
    """Within a line blanks, signs and dots are text; arrows act at once even so."""
    typed = "push 1.5 -30\r"
    assert _read(*typed) == (["push 1.5 -30"], "")
    assert _read("push 60", UP, " left\n") == (["push 40 forwards", "push 60 left"], "")
    assert _read("pusch\x7f\x7fh 60 up\x7f") == ([], "push 60 u")
    assert _read("nonsense\x15stop\n+") == (["stop", "roll 0.25"], "")
    assert _read("\n") == ([""], "")


def test_however_the_bytes_come_the_lines_are_the_same() -> None:
    """Sequences and letters may be cut anywhere; unknown keys are ignored."""
    content = (
        f"\x1b[1;5C\x1b[3~{UP}\x1b OBm\N{LATIN SMALL LETTER E WITH ACUTE}\n{RIGHT}"
    )
    whole = _read(content)
    assert whole == (["push 40 forwards", "stop", "OBm\xe9", "push 40 right"], "")
    data = content.encode()
    for cut in range(len(data)):
        assert _read(data[:cut], data[cut:]) == whole
    assert _read(*(data[i : i + 1] for i in range(len(data)))) == whole


@pytest.fixture(name="terminal")
def _terminal() -> Iterator[tuple[int, int]]:
    """Give both ends of a terminal: that of the person, and that of the program."""
    ends = pty.openpty()
    yield ends
    for end in ends:
        os.close(end)


def _settle(keyboard: Keyboard) -> list[str]:
    """Return all lines that come within a moment."""
    lines, deadline = [], time.monotonic() + 0.3
    while time.monotonic() < deadline:
        if (line := keyboard.poll()) is not None:
            lines.append(line)
        time.sleep(0.005)
    return lines


def test_terminal_gives_keys_and_is_left_as_it_was(terminal: tuple[int, int]) -> None:
    """However the block ends; within it, keys come without Enter and are not echoed."""
    person, program = terminal
    before: list[Any] = termios.tcgetattr(program)
    screen = io.StringIO()
    keyboard = Keyboard(program, screen)
    os.write(person, b"before\n")
    for error in (None, KeyboardInterrupt, RuntimeError):
        try:
            with keyboard.take_over():
                assert not termios.tcgetattr(program)[3] & termios.ICANON
                assert not termios.tcgetattr(program)[3] & termios.ECHO
                os.write(person, UP.encode())
                expected = ["before"] if error is None else []
                assert _settle(keyboard) == [*expected, "push 40 forwards"]
                if error is not None:
                    raise error
        except (KeyboardInterrupt, RuntimeError):
            pass
        assert termios.tcgetattr(program) == before
    with keyboard.take_over():
        os.write(person, b"sto")
        assert _settle(keyboard) == []
        keyboard.tell("a reply")
        os.write(person, b"p\n")
        assert _settle(keyboard) == ["stop"]
    # The reply stands above what was being typed.
    assert "\ra reply\nsto" in screen.getvalue().replace("\x1b[K", "")


_PROGRAM = """
import sys, time
from ballsim.live.keyboard import Keyboard
keyboard = Keyboard(0, sys.stderr)
with keyboard.take_over():
    while keyboard.poll() != "stop":
        time.sleep(0.005)
"""


def test_suspended_process_gives_the_terminal_back(terminal: tuple[int, int]) -> None:
    """Ctrl-Z: as before while it is stopped, single keys again when it goes on."""
    person, program = terminal
    before: list[Any] = termios.tcgetattr(program)
    words = [sys.executable, "-c", _PROGRAM]
    # In a group of its own, whose parent is not in it: others are never stopped.
    child = subprocess.Popen(words, stdin=program, stderr=program, process_group=0)
    try:
        assert _wait_for(program, is_canonical=False)
        child.send_signal(signal.SIGTSTP)
        assert os.WIFSTOPPED(os.waitpid(child.pid, os.WUNTRACED)[1])
        assert termios.tcgetattr(program) == before
        child.send_signal(signal.SIGCONT)
        assert _wait_for(program, is_canonical=False)
        os.write(person, b" ")
        assert child.wait(timeout=30) == 0
        assert termios.tcgetattr(program) == before
    finally:
        child.kill()
        child.wait()


def _wait_for(terminal: int, is_canonical: bool) -> bool:
    """Wait until a terminal gives lines, or single keys."""
    deadline = time.monotonic() + 30.0
    while time.monotonic() < deadline:
        if bool(termios.tcgetattr(terminal)[3] & termios.ICANON) == is_canonical:
            return True
        time.sleep(0.005)
    return False


def test_keys_are_read_at_terminals_only(terminal: tuple[int, int]) -> None:
    """A pipe gives lines; so does a terminal where nothing that is typed is shown."""
    _, program = terminal
    reader, writer = os.pipe()
    with (
        open(os.dup(program)) as at_terminal,
        open(reader) as piped,
        open(writer, "w") as other,
    ):
        assert can_read_keys(at_terminal, at_terminal)
        assert not can_read_keys(piped, at_terminal)
        assert not can_read_keys(at_terminal, other)


def test_run_with_keys_is_repeated_bit_for_bit(
    terminal: tuple[int, int], tmp_path: Path
) -> None:
    """Keys of a real terminal count from a tick on, and are kept as lines are."""
    person, program = terminal
    typed = {20: "++", 60: "<", 90: "\t", 120: "speed 0.2\n", 150: "+>", 180: RIGHT}

    class Typist(Pacer):
        def wait(self, tick: int) -> None:
            if tick in typed:
                os.write(person, typed[tick].encode())

    prepared = prepare(load_config("stand", ["duration_s=1"]).config)
    keyboard, replies = Keyboard(program, io.StringIO()), list[str]()
    pacer = Typist(0.005, print)
    session = LiveSession(prepared, keyboard, pacer, replies.append)
    with keyboard.take_over():
        finished = run_with_files(
            prepared, tmp_path, is_logged=False, conductor=session
        )
    assert replay(tmp_path) == finished.summary["trajectory_sha256"]
    config = finished.outcome.config
    (push,) = config.pushes
    assert (push.force, push.direction) == (40.0, -0.5 * math.pi)
    points = config.command.timeline
    asked = [point.target_ball_angle for point in points]
    headings = [math.degrees(point.heading) for point in points]
    speeds = [point.ball_speed for point in points]
    # What goes on from a speed is a place near by.
    assert asked[:4] == [0.5, 0.5, 0.5, 0.0]
    assert asked[4] == pytest.approx(0.25, abs=0.15)
    assert headings == pytest.approx([0.0, 15.0, 15.0, 15.0, 0.0], abs=1e-6)
    assert speeds == [0.0, 0.0, 0.0, 0.2, 0.0]
    assert [point.is_stepping for point in points] == [False, False, True, True, True]
    assert len(replies) == 8
