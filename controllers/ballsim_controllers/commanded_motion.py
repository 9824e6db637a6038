"""What the ball shall do: from the operator's command to the planner's reference."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import SettledMotion
from ballsim_controllers.footsteps.side_steps import LateralMotion
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, Command
from ballsim_controllers.reference import RampReference, ReferenceSample
from ballsim_controllers.reference_window import ReferenceWindow
from ballsim_controllers.settings import ReferenceSettings
from ballsim_controllers.wheeled_lip import BallPendulumParameters

__all__ = ["CommandedMotion"]

_LEAST_SHARE = 1e-6
"""Of an axis in a straight way: a limit must not be 0."""

_LARGEST_SHIFT = 0.08
"""Of the reference against a lasting error, [m]; a greater one has another cause."""


class CommandedMotion:
    """Shaped reference of the ball, with states that belong to it.

    A way that begins at rest is straight, whatever its direction. Across the heading
    nothing is planned before the first command that asks for it.

    While the robot steps, the reference is shifted against the lasting error of the
    ball's place: the integral part, which state feedback lacks. Legs that swing and
    soles that roll make the measured CoM differ from the model's by millimetres,
    and the ball would rest where feedback makes up for them, centimetres off.

    Args:
        settings: Limits of the reference.
        params: Parameters of robot and ball.
        cop_lag: Time constant from the commanded CoP to the CoP, [s].
        dt: Control period, [s].
        stride: Control periods per cell of the preview.
        count: Cells of the preview.
        step_time: Time from a landing to the next one, [s].
    """

    def __init__(
        self,
        settings: ReferenceSettings,
        params: BallPendulumParameters,
        cop_lag: float,
        dt: float,
        stride: int,
        count: int,
        step_time: float,
    ) -> None:
        """Start at rest."""
        self._radius = radius = params.ball.radius
        self._limits = _Limits.of(settings, radius)
        self._integral_rate = settings.integral_rate_1_s
        self._step_time = step_time
        self._ramps = tuple(
            RampReference(speed, rate, settings.smoothing_time_s)
            for speed, rate in zip(
                self._limits.speeds, self._limits.accelerations, strict=True
            )
        )
        self._window, self._lateral = (
            ReferenceWindow(ramp, dt, stride, count) for ramp in self._ramps
        )
        self._command: Command | None = None
        self._has_moved_sideways = False
        self._settled = SettledMotion(params, cop_lag)
        self._shift = 0.0

    @property
    def present(self) -> ReferenceSample:
        """Return the reference of the ball's angle at this instant."""
        return self._window.present

    @property
    def angle(self) -> float:
        """Return the reference of the ball's angle at this instant, [rad]."""
        return self._window.position

    def find_place(self) -> Array:
        """Return where the ball's centre shall be at this instant, shape (2,), [m]."""
        along = self._radius * self._window.position + self._shift
        return np.array([along, self._radius * self._lateral.position])

    def advance(self, command: Command | None) -> None:
        """Move the reference on by one control period.

        Args:
            command: What to do, or None to go on with what is under way.
        """
        if command is not None and command is not self._command:
            if command != self._command:
                self._aim(command)
            self._command = command
        self._window.advance()
        if self._has_moved_sideways:
            self._lateral.advance()

    def _aim(self, command: Command) -> None:
        """Plan the way to what a command asks for."""
        along, across = self._ramps
        limits, lateral = self._limits, command.lateral_target / self._radius
        way = (
            command.target_ball_angle - self._window.position,
            lateral - self._lateral.position,
        )
        is_straight = along.is_at_rest and across.is_at_rest and way[1] != 0.0
        if command.ball_speed == 0.0 and is_straight:
            limits = limits.share(way)
        for ramp, speed in zip(self._ramps, limits.speeds, strict=True):
            ramp.max_speed = speed
        along.max_acceleration, across.max_acceleration = limits.accelerations
        if command.ball_speed == 0.0:
            along.target = command.target_ball_angle
        else:
            along.cruise(clip(command.ball_speed, -limits.cruise, limits.cruise))
        self._has_moved_sideways = self._has_moved_sideways or lateral != 0.0
        across.target = lateral

    def has_arrived(self, command: Command) -> bool:
        """Return whether the reference rests where a command wants the ball."""
        return (
            command.ball_speed == 0.0
            and self._window.has_arrived(command.target_ball_angle)
            and self._lateral.has_arrived(command.lateral_target / self._radius)
        )

    def correct(self, ball: float, elapsed: float, is_stepping: bool) -> None:
        """Shift the reference against a lasting error of the ball's place.

        Args:
            ball: Where the ball is along the heading, [m].
            elapsed: Time since the last call, [s].
            is_stepping: False to let the shift go: standing needs none.
        """
        error = self._radius * self._window.position - ball
        if not is_stepping:
            error = -self._shift
        shift = self._shift + self._integral_rate * elapsed * error
        self._shift = clip(shift, -_LARGEST_SHIFT, _LARGEST_SHIFT)

    def foresee(self) -> tuple[Array, Array]:
        """Return reference states, (N, 7), and CoP, (N,), [m], of the cells to come."""
        return self._settled.follow(self._window.future(), self._radius, self._shift)

    def foresee_sideways(self) -> LateralMotion | None:
        """Return the reference across the heading, None before it has ever moved."""
        if not self._has_moved_sideways:
            return None
        states, inputs = self._settled.follow(self._lateral.future(), self._radius)
        return LateralMotion(states, inputs, self._step_time)


@dataclass(frozen=True, slots=True)
class _Limits:
    """Limits of the reference along and across the heading.

    Attributes:
        speeds: Largest speeds on the way to a target, [rad/s].
        accelerations: Largest accelerations, [rad/s^2].
        cruise: Largest commanded speed, [rad/s].
    """

    speeds: tuple[float, float]
    accelerations: tuple[float, float]
    cruise: float

    @classmethod
    def of(cls, settings: ReferenceSettings, radius: float) -> _Limits:
        """Return the limits on a ball of some radius, [m]."""
        acceleration = min(
            settings.max_acceleration_rad_s2, settings.max_acceleration_m_s2 / radius
        )
        forwards = min(settings.max_speed_rad_s, settings.max_speed_m_s / radius)
        sideways = min(settings.max_lateral_rad_s, settings.max_lateral_m_s / radius)
        return cls(
            (forwards, sideways),
            (acceleration, acceleration),
            min(settings.max_cruise_rad_s, settings.max_cruise_m_s / radius),
        )

    def share(self, way: tuple[float, float]) -> _Limits:
        """Return limits by which both axes need the same time for a straight way.

        What a direction allows lies on the ellipse through what the axes allow.

        Args:
            way: Along and across the heading, [rad].
        """
        length = math.hypot(*way)
        shares = [max(abs(part) / length, _LEAST_SHARE) for part in way]
        speed, acceleration = (
            1.0 / math.hypot(shares[0] / along, shares[1] / across)
            for along, across in (self.speeds, self.accelerations)
        )
        along, across = shares
        return _Limits(
            (speed * along, speed * across),
            (acceleration * along, acceleration * across),
            self.cruise,
        )
