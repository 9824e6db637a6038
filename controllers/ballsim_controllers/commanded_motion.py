"""What the ball shall do: from the operator's command to the planner's reference."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ballsim_controllers.body_pendulum import SettledMotion
from ballsim_controllers.footsteps.side_steps import LateralMotion
from ballsim_controllers.geometry import clip
from ballsim_controllers.heading_frame import HEADING
from ballsim_controllers.messages import Array, Command, Record
from ballsim_controllers.motion_limits import MotionLimits
from ballsim_controllers.reference import RampReference, ReferenceSample
from ballsim_controllers.reference_window import ReferenceSource, ReferenceWindow
from ballsim_controllers.settings import ReferenceSettings
from ballsim_controllers.wheeled_lip import BallPendulumParameters

if TYPE_CHECKING:
    from ballsim_controllers.path_follower import PathFollower

__all__ = ["CommandedMotion"]

_LARGEST_SHIFT = 0.08
"""Of the reference against a lasting error, [m]; a greater one has another cause."""


class CommandedMotion:
    """Shaped reference of the ball, with states that belong to it.

    A way that begins at rest is straight, whatever its direction. Across the heading
    nothing is planned before the first command that asks for it. A path begins once the
    reference rests at its first point; a command that ends a path counts once the
    reference has come to rest on it.

    The reference is in the world, but what is foreseen of it is in the frame that turns
    with the robot's heading, see `heading_frame`.

    The reference is shifted against the lasting error of the ball's place: the integral
    part, which state feedback lacks. Legs that swing and soles that roll make the
    measured CoM differ from the model's by millimetres, as encoders do whose zero
    positions are off, and the ball would rest where feedback makes up for them,
    centimetres off. A robot that stands still and knows where its CoM is needs none.

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
        self._limits = MotionLimits.of(settings, radius)
        self._dt = dt
        self._integral_rate = settings.integral_rate_1_s
        self._step_time = step_time
        self._ramps = self._make_ramps((0.0, 0.0))
        self._turn_limits = settings.max_turn_rad_s, settings.max_turn_rad_s2
        self._turn = self._make_turn(0.0)
        self._window, self._lateral, self._heading = (
            ReferenceWindow(ramp, dt, stride, count)
            for ramp in (*self._ramps, self._turn)
        )
        self._is_turning = False
        self._asked_heading = 0.0
        self._command: Command | None = None
        self._follower: PathFollower | None = None
        self._next: PathFollower | None = None  # begins once the ramps are at rest
        self._is_handing_over = False
        self._has_moved_sideways = False
        #: The robot's frame, shape (1,), dtype `HEADING`.
        self.frame: Record = np.zeros(1, HEADING)
        self.frame["cosine"] = 1.0
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

    @property
    def speed(self) -> float:
        """Return how fast the reference rolls the ball along its way, [m/s]."""
        return abs(self._radius * self._window.present.velocity)

    @property
    def is_turning(self) -> bool:
        """Return whether the heading moves on, or will within the horizon."""
        return self._is_turning

    @property
    def turn_rate(self) -> float:
        """Return the rate of the heading, [rad/s]."""
        return self._heading.present.velocity

    def turn(self) -> tuple[float, float]:
        """Move the heading on by one control period.

        Returns:
            Cosine and sine of the angle from the new frame to the old one.
        """
        before, window = float(self.frame["angle"][0]), self._heading
        window.advance()
        angle = window.position
        for name, value in (
            ("angle", angle),
            ("cosine", math.cos(angle)),
            ("sine", math.sin(angle)),
        ):
            self.frame[name] = value
        end = self._turn.target
        if self._follower is not None and self._follower.is_faced:
            end = float(self._follower.rest[2])
        if window.has_arrived(end):
            self._is_turning = False
        return math.cos(before - angle), math.sin(before - angle)

    def _enter_frame(self, along: Array, across: Array) -> tuple[Array, Array]:
        """Return motions along the world's axes by parts along the frame's ones."""
        angle, sine, cosine = self.frame[0].tolist()
        if angle == 0.0:
            return along, across
        return cosine * along + sine * across, cosine * across - sine * along

    def find_place(self) -> Array:
        """Return where the ball's centre shall be, in the frame, shape (2,), [m]."""
        along, across = self._find_angles()
        return np.array([self._radius * along + self._shift, self._radius * across])

    def _find_angles(self) -> tuple[float, float]:
        """Return the reference in the frame, [rad]."""
        along, across = self._window.position, self._lateral.position
        angle, sine, cosine = self.frame[0].tolist()
        if angle == 0.0:
            return along, across
        return cosine * along + sine * across, cosine * across - sine * along

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

    def _find_limits(self, heading: float) -> MotionLimits:
        """Return the limits for the heading that there is, and one to come, [rad]."""
        is_faced = self._follower is not None and self._follower.is_faced
        is_kept = self._turn.is_at_rest and not is_faced
        if is_kept and self._turn.target == self._find_nearest(heading):
            return self._limits.face(self._turn.target)
        return self._limits.face(None)

    def _find_nearest(self, heading: float) -> float:
        """Return a direction as the angle that is the nearest to the present one."""
        turns = round((self._turn.sample.position - heading) / (2.0 * math.pi))
        return heading + 2.0 * math.pi * turns

    def _make_turn(self, heading: float) -> RampReference:
        """Return the ramp of the heading, at rest at some angle."""
        return RampReference(*self._turn_limits, self._limits.smoothing, heading)

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
        self._asked_heading = command.heading
        if command.path is not None:
            # Who never follows a path need not load SciPy's splines.
            from ballsim_controllers.path_follower import (  # noqa: PLC0415
                PathFollower,
            )

            limits, rate = self._find_limits(command.heading), None
            if command.is_facing_path:
                limits, rate = self._limits, self._turn_limits[0]
            on_path = limits.on_floor(self._radius, command.path_speed, rate)
            self._next = PathFollower(command.path, on_path, self._radius)
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
            along, across, direction = self._follower.samples[:, 0].tolist()
            self._ramps = self._make_ramps((along, across))
            if self._follower.is_faced:
                self._turn = self._make_turn(direction)
            self._follower = None
            self._aim(self._command)
            self._is_handing_over = self._next is not None
        elif self._next is not None and all(
            ramp.is_at_rest for ramp in (*self._ramps, self._turn)
        ):
            self._follower, self._next = self._next, None
            self._is_handing_over = False
        sources: list[ReferenceSource] = [*self._ramps, self._turn]
        if self._follower is not None:
            sources[:2] = self._follower.axes[:2]
            if self._follower.is_faced:
                sources[2], self._is_turning = self._follower.axes[2], True
        windows = self._window, self._lateral, self._heading
        for window, source in zip(windows, sources, strict=True):
            window.follow(source)

    def _aim(self, command: Command) -> None:
        """Plan the way to what a command asks for, or to where its path begins."""
        along, across = self._ramps
        target = command.target_ball_angle, command.lateral_target / self._radius
        speed, heading = command.ball_speed, command.heading
        if self._next is not None:
            target, speed = self._next.start[:2], 0.0
            self._has_moved_sideways = True
            if self._next.is_faced:
                heading = self._next.start[2]
        limits = self._find_limits(heading)
        self._turn.target = self._find_nearest(heading)
        self._is_turning = self._is_turning or not self._turn.is_at_rest
        lateral = target[1]
        way = (target[0] - along.target, lateral - across.target)
        is_turned = limits.heading != 0.0
        is_straight = along.is_at_rest and across.is_at_rest
        if speed == 0.0 and is_straight and (way[1] != 0.0 or (is_turned and any(way))):
            limits = limits.share(way)
        elif is_turned:
            limits = limits.face(None)
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
        """Return whether the reference rests where a command wants ball and heading."""
        if self._asked_heading != command.heading:
            return False
        if self._is_turning and not command.is_facing_path:
            return False
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

    def correct(self, ball: float, elapsed: float, is_needed: bool) -> None:
        """Shift the reference against a lasting error of the ball's place.

        Args:
            ball: Where the ball is along the heading, [m].
            elapsed: Time since the last call, [s].
            is_needed: False to let the shift go.
        """
        error = self._radius * self._find_angles()[0] - ball
        if not is_needed:
            error = -self._shift
        shift = self._shift + self._integral_rate * elapsed * error
        self._shift = clip(shift, -_LARGEST_SHIFT, _LARGEST_SHIFT)

    def foresee(self) -> tuple[Array, Array]:
        """Return reference states, (N, 7), and CoP, (N,), [m], of the cells to come."""
        along, _ = self._enter_frame(self._window.future(), self._lateral.future())
        return self._settled.follow(along, self._radius, self._shift)

    def foresee_sideways(self) -> LateralMotion | None:
        """Return the reference across the heading, None before it has ever moved."""
        if not self._has_moved_sideways and self.frame["angle"][0] == 0.0:
            return None
        _, across = self._enter_frame(self._window.future(), self._lateral.future())
        states, inputs = self._settled.follow(across, self._radius)
        return LateralMotion(states, inputs, self._step_time)
