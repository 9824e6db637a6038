"""Lines of an operator: what each means, and what is refused in one line."""

from __future__ import annotations

import math

import pytest

from ballsim.live.instructions import (
    HELP,
    GoTo,
    Help,
    Instruction,
    InstructionError,
    Push,
    Quit,
    RollAt,
    RollBy,
    RollTo,
    Step,
    Stop,
    Turn,
    TurnBy,
    parse_instruction,
)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("push 60 left", Push(60.0, 0.5 * math.pi)),
        ("  PUSH 60 Right 0.2 ball # hard", Push(60.0, -0.5 * math.pi, 0.2, "ball")),
        ("push 1e1 -30", Push(10.0, math.radians(-30.0))),
        ("target -1.5", RollTo(-1.5)),
        ("speed 0.3", RollAt(0.3)),
        ("place 1 -0.5", GoTo(1.0, -0.5)),
        ("heading 90", Turn(0.5 * math.pi)),
        ("stepping on", Step(True)),
        ("stepping off", Step(False)),
        ("stepping", Step(None)),
        ("roll -0.25", RollBy(-0.25)),
        ("turn 90", TurnBy(0.5 * math.pi)),
        ("stop", Stop()),
        ("quit", Quit()),
        ("help", Help()),
        ("", None),
        ("   # nothing", None),
    ],
)
def test_line_is_understood(line: str, expected: Instruction | None) -> None:
    """Case and blanks do not matter; what stands behind # is for people."""
    assert parse_instruction(line) == expected


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("jump", "'jump' is not valid: one of push, target, roll, speed"),
        ("push", "'push' is not valid: push FORCE DIRECTION [DURATION] [BODY]"),
        ("push 60 left 0.1 ball now", "push FORCE DIRECTION [DURATION] [BODY]"),
        ("push hard left", "FORCE = 'hard' is not valid: a number [N]"),
        ("push 60 up", "DIRECTION = 'up' is not valid: forwards, backwards, left"),
        ("push 60 left nan", "DURATION = 'nan' is not valid: a number [s]"),
        ("target 1 2", "'target 1 2' is not valid: target ANGLE"),
        ("heading inf", "ANGLE = 'inf' is not valid: a number [deg]"),
        ("stepping maybe", "'maybe' is not valid: on or off"),
        ("stop now", "'stop now' is not valid: stop"),
    ],
)
def test_line_is_refused(line: str, message: str) -> None:
    """The complaint is one line that names the word and what would be valid."""
    with pytest.raises(InstructionError) as caught:
        parse_instruction(line)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_help_names_every_line_that_is_understood() -> None:
    """Whoever types help sees all verbs that an unknown one is told of."""
    with pytest.raises(InstructionError) as caught:
        parse_instruction("jump")
    verbs = str(caught.value).rpartition("one of ")[2].split(", ")
    assert verbs == [line.split()[0] for line in HELP.splitlines()[::2]]
