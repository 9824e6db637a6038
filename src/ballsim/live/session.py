"""Conducts a run at real time, as an operator asks for it."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from ballsim.config import Config
from ballsim.live.instructions import InstructionError, Quit, parse_instruction
from ballsim.live.operator import Operator
from ballsim.live.pacer import Pacer
from ballsim.preparation import PreparedRun

__all__ = ["Channel", "LiveSession"]

# Ctrl-C, `kill`, and a terminal that is closed, where there are such signals.
_ENDING = [
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP")
    if hasattr(signal, name)
]


class Channel(Protocol):
    """Where lines come from."""

    def poll(self) -> str | None:
        """Return the next line, None if there is none yet."""
        ...


class LiveSession:
    """Begins each tick when it is due, and acts on all lines that have come until then.

    Args:
        prepared: The run.
        channel: Where the operator's lines come from.
        pacer: Who waits.
        reply: Gets what happens, in words.

    Attributes:
        block_period: How often the viewer gets what is new, [s].
    """

    block_period = 0.2

    def __init__(
        self,
        prepared: PreparedRun,
        channel: Channel,
        pacer: Pacer,
        reply: Callable[[str], None],
    ) -> None:
        """Take the run over."""
        self._operator = Operator(prepared)
        self._channel, self._pacer, self._reply = channel, pacer, reply
        self._period = prepared.config.simulation.control_period
        self._is_ending = False

    @property
    def config(self) -> Config:
        """Return the configuration, with all that has been asked for."""
        return self._operator.config

    def begin_tick(self, tick: int) -> bool:
        """Wait until a tick is due; return False if the run shall end before it."""
        self._pacer.wait(tick)
        while not self._is_ending and (line := self._channel.poll()) is not None:
            self._answer(line, tick)
        if self._is_ending and tick > 0:  # a run has one tick at least
            self._operator.end(tick)
            return False
        return True

    @contextmanager
    def end_on_signal(self) -> Iterator[None]:
        """Let signals such as Ctrl-C end the run as ``quit`` does.

        A second one breaks it off.
        """

        def end(_number: int, _frame: object) -> None:
            if self._is_ending:
                raise KeyboardInterrupt
            self._is_ending = True

        before = {
            number: signal.signal(number, end)
            for number in _ENDING
            if signal.getsignal(number) != signal.SIG_IGN  # as with nohup
        }
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _answer(self, line: str, tick: int) -> None:
        try:
            instruction = parse_instruction(line)
            if instruction is None:
                return
            if isinstance(instruction, Quit):
                self._is_ending = True
                return
            answer = self._operator.act(instruction, tick)
        except InstructionError as error:
            answer = str(error)
        self._reply(f"{tick * self._period:8.3f} s  {answer}")
