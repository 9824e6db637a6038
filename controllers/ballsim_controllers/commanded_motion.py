"""What the ball shall do: from the operator's command to the planner's reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import SettledMotion
from ballsim_controllers.footsteps.side_steps import LateralMotion
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, Command
from ballsim_controllers.path_follower import PathFollower, PathLimits
from ballsim_controllers.reference import RampReference, ReferenceSample
from ballsim_controllers.reference_window import ReferenceSource, ReferenceWindow
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
    nothing is planned before the first command that asks for it. A path begins once the
    reference rests at its first point; a command that ends a path counts once the
    reference has come to rest on it.

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
        self._dt = dt
        self._integral_rate = settings.integral_rate_1_s
        self._step_time = step_time
        self._ramps = self._make_ramps((0.0, 0.0))
        self._window, self._lateral = (
            ReferenceWindow(ramp, dt, stride, count) for ramp in self._ramps
        )
        self._command: Command | None = None
        self._follower: PathFollower | None = None
        self._next: PathFollower | None = None  # begins once the ramps are at rest
        self._is_handing_over = False
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
            has_changed, self._command = command != self._command, command
            if has_changed:
                self._accept(command)
        if self._is_handing_over:
            self._hand_over()
        if self._follower is not None:
            self._follower.advance(self._dt)
        self._window.advance()
        if self._has_moved_sideways:
            self._lateral.advance()

    def _make_ramps(self, places: tuple[float, float]) -> tuple[RampReference, ...]:
        """Return the ramps of both axes, at rest at some angles."""
        limits = self._limits
        return tuple(
            RampReference(speed, rate, limits.smoothing, place)
            for speed, rate, place in zip(
                limits.speeds, limits.accelerations, places, strict=True
            )
        )

    def _accept(self, command: Command) -> None:
        """Begin with what a command asks for, or with what has to come before."""
        self._next, self._is_handing_over = None, True
        if command.path is not None:
            limits = self._limits.on_floor(self._radius, command.path_speed)
            self._next = PathFollower(command.path, limits, self._radius)
        if self._follower is not None:
            self._follower.stop()
            return
        self._aim(command)
        self._is_handing_over = self._next is not None

    def _hand_over(self) -> None:
        """Change from a path to the ramps, or back, once the reference is at rest."""
        if self._follower is not None:
            if not self._follower.is_at_rest or self._command is None:
                return
            along, across = self._follower.samples[:, 0].tolist()
            self._ramps = self._make_ramps((along, across))
            self._follower = None
            self._aim(self._command)
            self._is_handing_over = self._next is not None
        elif self._next is not None and all(ramp.is_at_rest for ramp in self._ramps):
            self._follower, self._next = self._next, None
            self._is_handing_over = False
        sources: Sequence[ReferenceSource] = self._ramps
        if self._follower is not None:
            sources = self._follower.axes
        for window, source in zip((self._window, self._lateral), sources, strict=True):
            window.follow(source)

    def _aim(self, command: Command) -> None:
        """Plan the way to what a command asks for, or to where its path begins."""
        along, across = self._ramps
        limits = self._limits
        target = command.target_ball_angle, command.lateral_target / self._radius
        speed = command.ball_speed
        if self._next is not None:
            target, speed = self._next.start, 0.0
            self._has_moved_sideways = True
        lateral = target[1]
        way = (target[0] - along.target, lateral - across.target)
        is_straight = along.is_at_rest and across.is_at_rest and way[1] != 0.0
        if speed == 0.0 and is_straight:
            limits = limits.share(way)
        for ramp, largest in zip(self._ramps, limits.speeds, strict=True):
            ramp.max_speed = largest
        along.max_acceleration, across.max_acceleration = limits.accelerations
        if speed == 0.0:
            along.target = target[0]
        else:
            along.cruise(clip(speed, -limits.cruise, limits.cruise))
        self._has_moved_sideways = self._has_moved_sideways or lateral != 0.0
        across.target = lateral

    def has_arrived(self, command: Command) -> bool:
        """Return whether the reference rests where a command wants the ball."""
        if command.path is not None or self._follower is not None:
            return (
                command.path is not None
                and command == self._command
                and self._follower is not None
                and not self._is_handing_over
                and self._window.has_arrived(float(self._follower.rest[0]))
                and self._lateral.has_arrived(float(self._follower.rest[1]))
            )
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
        smoothing: Window over which the acceleration is smoothed, [s].
    """

    speeds: tuple[float, float]
    accelerations: tuple[float, float]
    cruise: float
    smoothing: float

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
            settings.smoothing_time_s,
        )

    def on_floor(self, radius: float, top_speed: float) -> PathLimits:
        """Return the limits on a path.

        Args:
            radius: Radius of the ball, [m].
            top_speed: Largest speed in every direction, [m/s]; 0 for no other one.
        """
        along, across = self.speeds
        top = top_speed or max(self.speeds) * radius
        rate = self.accelerations[0] * radius
        return PathLimits((along * radius, across * radius), top, rate, self.smoothing)

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
            self.smoothing,
        )
