"""What the terminal shows while something takes its time."""

from __future__ import annotations

import time

import pytest

from ballsim.console import explain_delay


def test_a_long_wait_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    """The reason is told during the wait, once, on stderr."""
    with explain_delay("something is slow", patience=0.01):
        deadline = time.monotonic() + 10.0
        seen = ""
        while "slow" not in seen and time.monotonic() < deadline:
            time.sleep(0.01)
            out, new = capsys.readouterr()
            seen += new
            assert out == ""
    assert seen == "something is slow\n"
    assert capsys.readouterr() == ("", "")


def test_a_short_wait_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is told after the wait has ended, whether or not it failed."""
    with explain_delay("quick", patience=0.2):
        pass
    with pytest.raises(ValueError, match="broken"), explain_delay("broken", 0.2):
        raise ValueError("broken")
    time.sleep(0.3)
    assert capsys.readouterr() == ("", "")
