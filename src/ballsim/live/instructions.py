"""What an operator can say to a run that goes on: one line, one instruction."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from ballsim.errors import BallsimError

__all__ = [
    "HELP",
    "INSTRUCTIONS",
    "GoTo",
    "Help",
    "Instruction",
    "InstructionError",
    "Push",
    "Quit",
    "RollAt",
    "RollBy",
    "RollTo",
    "Step",
    "Stop",
    "Turn",
    "TurnBy",
    "parse_instruction",
]

_DIRECTIONS = {
    "forward": 0.0,
    "forwards": 0.0,
    "left": 0.5 * math.pi,
    "back": math.pi,
    "backwards": math.pi,
    "right": -0.5 * math.pi,
}
_SWITCH = {"on": True, "off": False}


class InstructionError(BallsimError):
    """A line that is no instruction, or asks for what cannot be.

    Args:
        message: What is wrong and what would be valid, on one line.
    """

    def __init__(self, message: str) -> None:
        """Keep the message."""
        super().__init__(message)
        self._arguments = (message,)


@dataclass(frozen=True, slots=True)
class Push:
    """Push the robot or the ball.

    Attributes:
        force: Size of the force, [N].
        direction: Its direction in the robot's heading at the start: 0 forwards,
            pi/2 to the left, [rad].
        duration: How long, [s].
        body: Body that is pushed.
    """

    force: float
    direction: float
    duration: float = 0.1
    body: str = "trunk"


@dataclass(frozen=True, slots=True)
class RollTo:
    """Roll the ball to an angle along the robot's heading at the start.

    Attributes:
        angle: The angle, [rad].
    """

    angle: float


@dataclass(frozen=True, slots=True)
class RollBy:
    """Roll the ball farther than it has been asked for, along that heading.

    Attributes:
        angle: How much farther, [rad].
    """

    angle: float


@dataclass(frozen=True, slots=True)
class RollAt:
    """Roll the ball on at a speed.

    Attributes:
        speed: The speed, [rad/s].
    """

    speed: float


@dataclass(frozen=True, slots=True)
class GoTo:
    """Roll the ball to a place on the floor.

    Attributes:
        forward: From the ball's start along the robot's heading there, [m].
        left: To the left of that, [m].
    """

    forward: float
    left: float


@dataclass(frozen=True, slots=True)
class Turn:
    """Face a direction.

    Attributes:
        heading: From the robot's heading at the start to the left, [rad].
    """

    heading: float


@dataclass(frozen=True, slots=True)
class TurnBy:
    """Face another direction than has been asked for.

    Attributes:
        angle: How far to the left of that, [rad].
    """

    angle: float


@dataclass(frozen=True, slots=True)
class Step:
    """Step in place, or only where balance needs it.

    Attributes:
        is_wanted: True to step, None for the other way than has been asked for.
    """

    is_wanted: bool | None


@dataclass(frozen=True, slots=True)
class Stop:
    """Bring the ball to rest near where it is."""


@dataclass(frozen=True, slots=True)
class Quit:
    """End the run."""


@dataclass(frozen=True, slots=True)
class Help:
    """Say what can be said."""


Instruction: TypeAlias = (
    Push | RollTo | RollBy | RollAt | GoTo | Turn | TurnBy | Step | Stop | Quit | Help
)


def _push(words: Sequence[str]) -> Push:
    force, direction = _number("FORCE", words[0], "N"), _direction(words[1])
    duration = _number("DURATION", words[2], "s") if len(words) > 2 else 0.1
    return Push(force, direction, duration, *words[3:])


def _direction(word: str) -> float:
    if word.lower() in _DIRECTIONS:
        return _DIRECTIONS[word.lower()]
    valid = "forwards, backwards, left, right, or degrees to the left"
    return math.radians(_number("DIRECTION", word, valid=valid))


def _switch(word: str) -> bool:
    if word.lower() not in _SWITCH:
        raise InstructionError(f"{word!r} is not valid: on or off")
    return _SWITCH[word.lower()]


def _number(name: str, word: str, unit: str = "", valid: str = "") -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        valid = valid or f"a number [{unit}]"
        raise InstructionError(f"{name} = {word!r} is not valid: {valid}")
    return value


@dataclass(frozen=True, slots=True)
class _Verb:
    """A kind of line.

    Attributes:
        usage: How it is written: words in brackets may be left out.
        text: What it does.
        parse: Returns the instruction for the words behind the first one.
    """

    usage: str
    text: str
    parse: Callable[[Sequence[str]], Instruction]

    @property
    def counts(self) -> range:
        """Return how many words may stand behind the first one."""
        words = self.usage.split()[1:]
        most = len(words)
        return range(sum("[" not in word for word in words), most + 1)


_VERBS = {
    verb.usage.split()[0]: verb
    for verb in (
        _Verb(
            "push FORCE DIRECTION [DURATION] [BODY]",
            "push with FORCE [N] forwards, backwards, left, right or at an angle [deg] "
            "to the left of the first heading, for DURATION [s] (0.1), the trunk or "
            "another BODY, such as ball",
            _push,
        ),
        _Verb(
            "target ANGLE",
            "roll the ball to ANGLE [rad] along the first heading",
            lambda words: RollTo(_number("ANGLE", words[0], "rad")),
        ),
        _Verb(
            "roll ANGLE",
            "roll it ANGLE [rad] farther than has been asked for",
            lambda words: RollBy(_number("ANGLE", words[0], "rad")),
        ),
        _Verb(
            "speed SPEED",
            "roll the ball on at SPEED [rad/s]",
            lambda words: RollAt(_number("SPEED", words[0], "rad/s")),
        ),
        _Verb(
            "place FORWARD LEFT",
            "roll the ball to a place on the floor, seen from its start [m]",
            lambda words: GoTo(
                _number("FORWARD", words[0], "m"), _number("LEFT", words[1], "m")
            ),
        ),
        _Verb(
            "heading ANGLE",
            "face ANGLE [deg] to the left of the first heading",
            lambda words: Turn(math.radians(_number("ANGLE", words[0], "deg"))),
        ),
        _Verb(
            "turn ANGLE",
            "face ANGLE [deg] to the left of what has been asked for",
            lambda words: TurnBy(math.radians(_number("ANGLE", words[0], "deg"))),
        ),
        _Verb(
            "stepping [on|off]",
            "step in place, or only where balance needs it; by itself the other way "
            "than has been asked for",
            lambda words: Step(_switch(words[0]) if words else None),
        ),
        _Verb("stop", "bring the ball to rest near where it is", lambda _: Stop()),
        _Verb("quit", "end the run; its files are written", lambda _: Quit()),
        _Verb("help", "show this", lambda _: Help()),
    )
}

INSTRUCTIONS = {verb.usage: verb.text for verb in _VERBS.values()}
"""What each line does, by how it is written."""

HELP = "\n".join(f"{usage}\n    {text}" for usage, text in INSTRUCTIONS.items())
"""What `help` says."""


def parse_instruction(line: str) -> Instruction | None:
    """Return what a line asks for, None for an empty one or a comment (``#``).

    Args:
        line: Words between blanks; the first one says what is to be done.

    Raises:
        InstructionError: It cannot be understood.

    Examples:
        >>> parse_instruction("push 60 left")
        Push(force=60.0, direction=1.5707963267948966, duration=0.1, body='trunk')
        >>> parse_instruction("target far")
        Traceback (most recent call last):
        ...
        ballsim.live.instructions.InstructionError: ANGLE = 'far' is not valid: \
a number [rad]
    """
    words = line.partition("#")[0].split()
    if not words:
        return None
    verb = _VERBS.get(words[0].lower())
    if verb is None:
        valid = ", ".join(_VERBS)
        raise InstructionError(f"{words[0]!r} is not valid: one of {valid}")
    if len(words) - 1 not in verb.counts:
        raise InstructionError(f"{line.strip()!r} is not valid: {verb.usage}")
    return verb.parse(words[1:])
