"""Lines that come while nobody waits for them."""

from __future__ import annotations

import os
import time

from ballsim.live.channel import LineChannel


def _wait(channel: LineChannel) -> str:
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        if (line := channel.poll()) is not None:
            return line
        time.sleep(0.002)
    raise AssertionError("no line came")


def test_lines_come_whole_and_in_order() -> None:
    """However they are cut on the way; the last one needs no end."""
    reader, writer = os.pipe()
    channel = LineChannel(reader)
    assert channel.poll() is None
    os.write(writer, b"push 60 left\ntar")
    assert _wait(channel) == "push 60 left"
    assert channel.poll() is None
    os.write(writer, "get 1 # \N{RIGHTWARDS ARROW}\n\xff".encode("utf-8", "replace"))
    assert _wait(channel) == "target 1 # \N{RIGHTWARDS ARROW}"
    os.write(writer, b"quit")
    os.close(writer)
    assert _wait(channel).endswith("quit")
    os.close(reader)
