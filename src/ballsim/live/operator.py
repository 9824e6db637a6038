"""Acts on instructions: commands and pushes from a tick on, kept for a repeat."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any

from ballsim.config import CommandConfig, CommandPoint, PathConfig, PushConfig
from ballsim.errors import ConfigError
from ballsim.live.instructions import (
    HELP,
    GoTo,
    Help,
    Instruction,
    InstructionError,
    Push,
    RollAt,
    RollBy,
    RollTo,
    Step,
    Stop,
    Turn,
    TurnBy,
)
from ballsim.live.keys import KEY_SUMMARY
from ballsim.preparation import PreparedRun

__all__ = ["Operator"]

_STOPPING_TIME = 0.5  # at the present speed, until the ball can be at rest, [s]
_DIGITS = 9  # of times, [s], and angles, [rad]

# What a point asks the ball for; an instruction replaces all of it.
_NO_AIM: dict[str, Any] = {
    "target_ball_angle": 0.0,
    "ball_speed": 0.0,
    "distance": 0.0,
    "direction": 0.0,
    "path": PathConfig(),
}


class Operator:
    """Puts what is asked for into the schedules of a run and its configuration.

    The first command takes over: what the scenario's timeline asks for later is
    dropped. Its pushes stay.

    Args:
        prepared: The run.

    Attributes:
        config: The configuration with all that has been asked for.
    """

    def __init__(self, prepared: PreparedRun) -> None:
        """Take the run over."""
        self._commands, self._pushes = prepared.commands, prepared.pushes
        self._controller = prepared.controller
        self._period = prepared.config.simulation.control_period
        self.config = prepared.config

    def act(self, instruction: Instruction, tick: int) -> str:
        """Let an instruction count from a tick on.

        Args:
            instruction: What is asked for.
            tick: The tick that is about to begin.

        Returns:
            What will happen, in words.

        Raises:
            InstructionError: It cannot be; nothing has changed.
        """
        try:
            return self._act(instruction, tick)
        except ConfigError as error:
            name = error.key.rpartition(".")[2]
            message = f"{name} = {error.value!r} is not valid: {error.valid}"
            raise InstructionError(message) from None

    def end(self, tick: int) -> None:
        """Let the run end before a tick: what it is configured for is done."""
        self.config = replace(self.config, duration=self._find_time(tick))

    @functools.singledispatchmethod
    def _act(self, instruction: Instruction, tick: int) -> str:
        raise TypeError(type(instruction).__name__)

    @_act.register
    def _push(self, push: Push, tick: int) -> str:
        n_ticks = max(1, round(push.duration / self._period))
        entry = PushConfig(
            time=self._find_time(tick),
            duration=round(n_ticks * self._period, _DIGITS),
            body=push.body,
            direction=push.direction,
            force=push.force,
        )
        self._pushes.add(entry)
        self.config = replace(self.config, pushes=(*self.config.pushes, entry))
        angle = math.degrees(push.direction)
        return (
            f"push of {entry.force:g} N at {angle:g} deg on the {entry.body} "
            f"for {entry.duration:g} s"
        )

    @_act.register
    def _roll_to(self, aim: RollTo, tick: int) -> str:
        self._ask(tick, {**_NO_AIM, "target_ball_angle": aim.angle})
        return f"target of {aim.angle:g} rad"

    @_act.register
    def _roll_at(self, aim: RollAt, tick: int) -> str:
        if aim.speed == 0.0:
            return self._stop(Stop(), tick)
        self._ask(tick, {**_NO_AIM, "ball_speed": aim.speed})
        return f"speed of {aim.speed:g} rad/s"

    @_act.register
    def _roll_by(self, roll: RollBy, tick: int) -> str:
        _, present = self._split(tick)
        radius = self.config.ball.radius
        if present.ball_speed != 0.0 or present.path.curve != "none":
            x, y = self._find_rest(tick)
        elif present.distance != 0.0:
            x, y = present.find_place(radius)
        else:
            angle = round(present.target_ball_angle + roll.angle, _DIGITS)
            return self._roll_to(RollTo(angle), tick)
        x = round(x + roll.angle * radius, _DIGITS)
        return self._go_to(GoTo(x, round(y, _DIGITS)), tick)

    @_act.register
    def _go_to(self, aim: GoTo, tick: int) -> str:
        self._ask(tick, self._aim_at(aim.forward, aim.left))
        return f"place {aim.forward:g} m forwards, {aim.left:g} m to the left"

    @_act.register
    def _turn(self, turn: Turn, tick: int) -> str:
        self._ask(tick, {"heading": turn.heading})
        return f"heading of {math.degrees(turn.heading):g} deg"

    @_act.register
    def _turn_by(self, turn: TurnBy, tick: int) -> str:
        _, present = self._split(tick)
        heading = math.remainder(present.heading + turn.angle, 2.0 * math.pi)
        return self._turn(Turn(round(heading, _DIGITS)), tick)

    @_act.register
    def _step(self, step: Step, tick: int) -> str:
        is_wanted = step.is_wanted
        if is_wanted is None:
            is_wanted = not self._split(tick)[1].is_stepping
        self._ask(tick, {"is_stepping": is_wanted})
        return "stepping" if is_wanted else "stepping where balance needs it"

    @_act.register
    def _stop(self, _stop: Stop, tick: int) -> str:
        x, y = self._find_rest(tick)
        self._ask(tick, self._aim_at(x, y))
        return f"stop at {x:.3f} m forwards, {y:.3f} m to the left"

    @_act.register
    def _help(self, _help: Help, tick: int) -> str:
        return f"this can be said:\n{HELP}\nin a terminal, {KEY_SUMMARY}"

    def _find_rest(self, tick: int) -> tuple[float, float]:
        """Return where the ball can soon be at rest, forwards and to the left, [m].

        Raises:
            InstructionError: Nothing is known of the ball.
        """
        report = self._controller.telemetry
        if report is None or tick == 0:
            raise InstructionError("stop is not valid: nothing is known of the ball")
        ball = report.estimate
        place, speed = ball.position_ball_in_world, ball.linear_velocity_ball_in_world
        x, y = (place + _STOPPING_TIME * speed)[:2].tolist()
        if not (math.isfinite(x) and math.isfinite(y)):
            raise InstructionError("stop is not valid: nothing is known of the ball")
        if not self._is_sideways(tick):
            y = 0.0
        return round(x, 6), round(y, 6)

    def _ask(self, tick: int, changes: dict[str, Any]) -> None:
        """Ask for something from a tick on, beside what stays as it is."""
        points, present = self._split(tick)
        point = replace(present, time=self._find_time(tick), **changes)
        command = CommandConfig((*points, point))
        self.config = replace(self.config, command=command)
        self._commands.take_over(tick, point)

    def _split(self, tick: int) -> tuple[list[CommandPoint], CommandPoint]:
        """Return the points before a tick, and what holds until there."""
        config = self.config
        find, points = config.find_tick, config.command.timeline
        until = [point for point in points if find(point.time) <= tick]
        before = [point for point in until if find(point.time) < tick]
        return before, until[-1] if until else CommandPoint()

    def _is_sideways(self, tick: int) -> bool:
        """Return True if the ball was ever asked to roll to the side."""
        before, present = self._split(tick)
        radius = self.config.ball.radius
        return any(
            point.path.curve != "none" or point.find_place(radius)[1] != 0.0
            for point in (*before, present)
        )

    def _aim_at(self, forward: float, left: float) -> dict[str, Any]:
        """Return what asks for a place on the floor, from the ball's start, [m]."""
        if left == 0.0:
            angle = round(forward / self.config.ball.radius, _DIGITS)
            return {**_NO_AIM, "target_ball_angle": angle}
        place = {
            "distance": math.hypot(forward, left),
            "direction": math.atan2(left, forward),
        }
        return {**_NO_AIM, **place}

    def _find_time(self, tick: int) -> float:
        return round(tick * self._period, _DIGITS)
