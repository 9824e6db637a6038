"""Command shaper: from a target angle to a smooth reference on the way there.

A raw step of the target throws the robot off; the reference must be a ramp
(full-physics.md section 2). The shaper works in two exact stages:

1. the time-optimal motion to the target under the limits of speed and
   acceleration (trapezoidal speed), from whatever motion is under way;
2. its moving average over a short window, which turns the steps of the
   acceleration into ramps. An average of motions within the limits is within
   them, and it neither overshoots nor stops short.

Nothing is integrated numerically: the first stage is kept as pieces of constant
acceleration, and the average over them is exact for every step size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import Array

__all__ = [
    "RampReference",
    "ReferenceSample",
    "compute_lead_time",
    "constant_velocity_target",
    "plan_trapezoid",
]


class ReferenceSample(NamedTuple):
    """Reference at one instant; angles here, though any unit will do.

    Attributes:
        position: theta_1^r, [rad].
        velocity: Its rate, [rad/s].
        acceleration: Its second derivative, [rad/s^2].
        jerk: Its third derivative, [rad/s^3].
    """

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0


def plan_trapezoid(
    distance: float, velocity: float, max_speed: float, max_acceleration: float
) -> tuple[tuple[float, float], ...]:
    """Return the fastest motion to rest at a distance, within the limits.

    Args:
        distance: Where to come to rest, from here, [rad].
        velocity: Present velocity, at most the largest speed, [rad/s].
        max_speed: Largest speed, [rad/s].
        max_acceleration: Largest acceleration, [rad/s^2].

    Returns:
        Up to three phases (duration in [s], acceleration in [rad/s^2]). The
        motion overshoots only where it cannot brake in time.

    Source:
        Bang-bang control of the double integrator with a bounded velocity.

    Examples:
        >>> plan_trapezoid(3.0, 0.0, 1.0, 1.0)
        ((1.0, 1.0), (2.0, 0.0), (1.0, -1.0))
    """
    stop = velocity * abs(velocity) / (2.0 * max_acceleration)
    sign = 1.0 if distance >= stop else -1.0
    d, v = sign * distance, sign * velocity
    peak = float(np.sqrt(max(0.0, max_acceleration * d + 0.5 * v * v)))
    peak = min(max(peak, v), max(max_speed, v))
    braked = (2.0 * peak * peak - v * v) / (2.0 * max_acceleration)
    cruise = max(0.0, (d - braked) / peak) if peak > 0.0 else 0.0
    phases = (
        ((peak - v) / max_acceleration, sign * max_acceleration),
        (cruise, 0.0),
        (peak / max_acceleration, -sign * max_acceleration),
    )
    return tuple(phase for phase in phases if phase[0] > 0.0)


class RampReference:
    """Smooth reference of one axis, from targets that may jump.

    Args:
        max_speed: Largest speed, [rad/s].
        max_acceleration: Largest acceleration, [rad/s^2].
        smoothing_time: Window of the moving average, [s]; the jerk is at most
            twice the largest acceleration over this time (once, if the motion
            starts or ends at rest or cruise). 0 for none.
        position: Where to start, at rest, [rad].

    Raises:
        InvalidSettingError: If a limit is not positive or the window negative.

    Examples:
        >>> ramp = RampReference(max_speed=0.4, max_acceleration=0.1)
        >>> ramp.target = 4.0
        >>> samples = [ramp.advance(0.01) for _ in range(2000)]
        >>> samples[-1]
        ReferenceSample(position=4.0, velocity=0.0, acceleration=0.0, jerk=0.0)
        >>> round(max(sample.velocity for sample in samples), 6)
        0.4
    """

    def __init__(
        self,
        max_speed: float,
        max_acceleration: float,
        smoothing_time: float = 0.5,
        position: float = 0.0,
    ) -> None:
        """Start at rest."""
        for key, value in (
            ("max_speed", max_speed),
            ("max_acceleration", max_acceleration),
        ):
            if not (np.isfinite(value) and value > 0.0):
                raise InvalidSettingError(key, value, "a positive finite number")
        if not (np.isfinite(smoothing_time) and smoothing_time >= 0.0):
            raise InvalidSettingError("smoothing_time", smoothing_time, "0 or more")
        self.max_speed = max_speed
        self.max_acceleration = max_acceleration
        self.smoothing_time = smoothing_time
        self._time = 0.0
        self._target = position
        self._speed = math.nan  # that is to be kept, NaN where a target is
        self._table = np.array([[-smoothing_time, position, 0.0, 0.0]])
        self._sample = ReferenceSample(position)

    @property
    def target(self) -> float:
        """Return where the reference comes to rest, [rad]; NaN where it cruises."""
        return self._target

    @target.setter
    def target(self, target: float) -> None:
        """Plan a new way from the present motion to another target."""
        if target == self._target:
            return
        if not np.isfinite(target):
            raise InvalidSettingError("target", target, "a finite number")
        self._target, self._speed = target, math.nan
        position, velocity, _ = _move(self._table[self._find_piece()], self._time)
        allowed = min(max(velocity, -self.max_speed), self.max_speed)
        # A cruise may have been faster: it slows down first.
        slowing = self._change_speed(velocity, allowed)
        covered = 0.5 * (velocity + allowed) * slowing[0]
        phases = plan_trapezoid(
            target - position - covered, allowed, self.max_speed, self.max_acceleration
        )
        if slowing[0] > 0.0:
            phases = (slowing, *phases)
        end, _ = self._append((self._time, position, velocity), phases)
        self._table = np.vstack((self._table, [end, target, 0.0, 0.0]))

    def stop(self) -> None:
        """Plan to come to rest as soon as the limit of acceleration allows."""
        position, velocity, _ = _move(self._table[self._find_piece()], self._time)
        self.target = position + velocity * abs(velocity) / (
            2.0 * self.max_acceleration
        )

    def cruise(self, speed: float) -> None:
        """Plan the way from the present motion to a speed, which is then kept.

        It may be larger than the largest speed on the way to a target. Where the
        reference will be is left open: `target` is NaN from now on.

        Args:
            speed: Wanted velocity, [rad/s].
        """
        if speed == self._speed:
            return
        if not np.isfinite(speed):
            raise InvalidSettingError("speed", speed, "a finite number")
        self._target, self._speed = math.nan, speed
        position, velocity, _ = _move(self._table[self._find_piece()], self._time)
        phase = self._change_speed(velocity, speed)
        end, place = self._append((self._time, position, velocity), (phase,))
        self._table = np.vstack((self._table, [end, place, speed, 0.0]))

    def _change_speed(self, velocity: float, wanted: float) -> tuple[float, float]:
        """Return duration and acceleration of the way from a velocity to another."""
        gain, limit = wanted - velocity, self.max_acceleration
        return abs(gain) / limit, math.copysign(limit, gain)

    def _find_piece(self) -> int:
        """Return the row of the piece that is under way."""
        return int(np.searchsorted(self._table[:, 0], self._time, side="right")) - 1

    def _append(
        self,
        motion: tuple[float, float, float],
        phases: Sequence[tuple[float, float]],
    ) -> tuple[float, float]:
        """Replace all pieces that are to come.

        Args:
            motion: Time, position and velocity at their start.
            phases: Duration and acceleration of each.

        Returns:
            Time and position at their end.
        """
        start, position, velocity = motion
        pieces = list(self._table[self._table[:, 0] < start])
        for duration, acceleration in phases:
            piece = np.array([start, position, velocity, acceleration])
            pieces.append(piece)
            start += duration
            position, velocity, _ = _move(piece, start)
        self._table = np.array(pieces).reshape(-1, 4)
        return start, position

    @property
    def sample(self) -> ReferenceSample:
        """Return the reference at the present instant."""
        return self._sample

    @property
    def is_at_rest(self) -> bool:
        """Return whether the reference has arrived at its target for good."""
        return len(self._table) == 1 and not math.isnan(self._target)

    def advance(self, dt: float) -> ReferenceSample:
        """Move on by one step and return the reference there.

        Args:
            dt: Step, [s].

        Returns:
            The reference at the end of the step.

        Raises:
            InvalidSettingError: If the step is not positive.
        """
        if self._rests_after(dt):
            return ReferenceSample(self._target)
        average = np.empty((1, 4))
        _average(average, 0, 0, self._table, self._time, self.smoothing_time)
        self._sample = ReferenceSample(*average[0].tolist())
        return self._sample

    def advance_into(self, samples: Array, first: int, second: int, dt: float) -> None:
        """Move on by one step and write the reference there into two rows.

        Args:
            samples: Rows of position, velocity, acceleration and jerk, shape (n, 4).
            first: Row.
            second: Another row.
            dt: Step, [s].

        Raises:
            InvalidSettingError: If the step is not positive.
        """
        if not self._rests_after(dt):
            _average(
                samples, first, second, self._table, self._time, self.smoothing_time
            )
        elif samples.item(first, 1) != 0.0 or samples.item(first, 0) != self._target:
            samples[first] = samples[second] = (self._target, 0.0, 0.0, 0.0)

    def _rests_after(self, dt: float) -> bool:
        """Move the time on; return whether the reference rests at its target then."""
        if not 0.0 < dt < math.inf:
            raise InvalidSettingError("dt", dt, "a positive finite number")
        is_cruising = math.isnan(self._target)
        if len(self._table) == 1 and not is_cruising:
            return True
        self._time += dt
        oldest = self._time - self.smoothing_time
        while len(self._table) > 1 and self._table.item(1, 0) <= oldest:
            self._table = self._table[1:]
            if len(self._table) == 1 and not is_cruising:
                self._time = 0.0
                self._table = np.array([[-self.smoothing_time, self._target, 0.0, 0.0]])
                self._sample = ReferenceSample(self._target)
                return True
        return False


@compiled
def _average(
    samples: Array, first: int, second: int, pieces: Array, now: float, window: float
) -> None:
    """Write the moving average of pieces of constant acceleration, exactly.

    Args:
        samples: Rows of position, velocity, acceleration and jerk, shape (m, 4).
        first: Row to write.
        second: Another one.
        pieces: Start, position, velocity and acceleration of each, in order of time;
            the first has begun at the start of the window, shape (n, 4).
        now: End of the window, [s].
        window: Its length, [s]; 0 for the motion itself.
    """
    last = 0
    for i in range(len(pieces)):
        if pieces[i, 0] <= now:
            last = i
    row = samples[first]
    if last == 0 and pieces[0, 2] == 0.0 and pieces[0, 3] == 0.0:
        row[0], row[1], row[2], row[3] = pieces[0, 1], 0.0, 0.0, 0.0
    elif window == 0.0:
        row[0], row[1], row[2] = _move(pieces[last], now)
        row[3] = 0.0
    else:
        oldest, area, end = now - window, 0.0, now
        for i in range(last, -1, -1):
            start = max(pieces[i, 0], oldest)
            place, speed, rate = _move(pieces[i], start)
            t = end - start
            area += (place + (speed / 2.0 + rate * t / 6.0) * t) * t
            end = start
        position, velocity, acceleration = _move(pieces[last], now)
        old_position, old_velocity, old_acceleration = _move(pieces[0], oldest)
        row[0] = area / window
        row[1] = (position - old_position) / window
        row[2] = (velocity - old_velocity) / window
        row[3] = (acceleration - old_acceleration) / window
    samples[second] = row


@compiled
def _move(piece: Array, time: float) -> tuple[float, float, float]:
    """Return position, velocity and acceleration of a piece at a time."""
    t, a = time - piece[0], piece[3]
    return piece[1] + (piece[2] + 0.5 * a * t) * t, piece[2] + a * t, a


def compute_lead_time(poles: Sequence[complex]) -> float:
    """Return KT'/KT of the paper's feedback from its poles alone.

    The wheeled LIP has a double integrator beside even factors, which makes
    the ratio the sum of the poles' time constants for every ball.

    Args:
        poles: Poles of A - B K, [rad/s].

    Returns:
        KT'/KT, [s].

    Source:
        simplified-model.md section 1; equals the ratio in equation (9).

    Examples:
        >>> round(compute_lead_time([-24.9, -25, -4.55, -4.5, -1.05, -1]), 6)
        2.474544
    """
    return float(sum(-1.0 / complex(pole) for pole in poles).real)


def constant_velocity_target(sample: ReferenceSample, lead_time: float) -> float:
    """Return the target angle that makes the paper's feedback track a ramp.

    Args:
        sample: Reference theta_1^r and its rate.
        lead_time: KT'/KT, [s].

    Returns:
        theta_1^*, [rad].

    Source:
        Equation (9).

    Examples:
        >>> constant_velocity_target(ReferenceSample(1.0, 0.4), 2.5)
        2.0
    """
    return sample.position + lead_time * sample.velocity
