"""Path of a swinging foot over the ball."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.geometry import sole_rotation_on_ball
from ballsim_controllers.messages import Array

__all__ = ["SwingFoot", "SwingReference"]


@dataclass(frozen=True, slots=True)
class SwingReference:
    """Where the swinging sole shall be now, in the world.

    Attributes:
        position: Sole's centre, shape (3,), [m].
        rotation: Sole to world, shape (3, 3).
        linear_velocity: Shape (3,), [m/s].
        linear_acceleration: Shape (3,), [m/s^2].
    """

    position: Array
    rotation: Array
    linear_velocity: Array
    linear_acceleration: Array


class SwingFoot:
    """Minimum-jerk swing in coordinates that move with the ball's centre.

    The horizontal offset from the ball's centre follows a quintic that is laid
    anew from its present state to the latest target at each call, so that
    targets may move; height is measured along the ball's radius. The sole is
    kept tangent to the ball below it.

    Args:
        ball_radius: Radius of the ball, [m].
        lift: Greatest height of the sole over the ball, [m].
        freeze_time: Time before landing after which the target is kept, [s].
        descent_speed: Speed at which the sole goes on down where the ball is
            not met in time, [m/s].
    """

    def __init__(
        self, ball_radius: float, lift: float, freeze_time: float, descent_speed: float
    ) -> None:
        """Keep the parameters."""
        self._radius = ball_radius
        self._lift = lift
        self._freeze_time = freeze_time
        self._descent_speed = descent_speed
        self._offset = np.zeros((3, 2))  # offset, its velocity and acceleration
        self._start_height = 0.0
        self._duration = 1.0
        self.target = np.zeros(2)

    def lift_off(
        self, offset: Array, offset_velocity: Array, height: float, duration: float
    ) -> None:
        """Begin a swing.

        Args:
            offset: Horizontal offset of the sole's centre from the ball's
                centre, shape (2,), [m].
            offset_velocity: Its rate, shape (2,), [m/s].
            height: Distance of the sole's centre from the ball's surface, [m].
            duration: Planned swing time, [s].
        """
        self._offset = np.vstack((offset, offset_velocity, np.zeros(2)))
        self._start_height = height
        self._duration = duration
        self.target = offset.copy()

    def aim(self, target: Array, time: float) -> None:
        """Set the landing offset from the ball's centre, shape (2,), [m]."""
        if self._duration - time > self._freeze_time:
            self.target = target.copy()

    def advance(
        self, time: float, dt: float, ball_position: Array, ball_velocity: Array
    ) -> SwingReference:
        """Return the reference at a time of the swing and move on by one tick.

        Args:
            time: Time since lift-off, [s].
            dt: Control period, [s].
            ball_position: Ball's centre in the world, shape (3,), [m].
            ball_velocity: Its velocity in the world, shape (3,), [m/s].

        Returns:
            The reference of the sole.
        """
        reference = self._reference(time, ball_position, ball_velocity)
        remaining = self._duration - time
        # At touchdown the sole moves with the ball's surface, which at the top
        # has the speed of the centre relative to it, and less beside it.
        slope = float(self.target @ self.target) / self._radius**2
        end_velocity = ball_velocity[:2] * max(1.0 - slope, 0.0) ** 0.5
        if remaining > dt:
            self._offset = _quintic_step(
                self._offset, self.target, end_velocity, remaining, dt
            )
        else:
            self._offset[0] += end_velocity * dt
            self._offset[1] = end_velocity
            self._offset[2] = 0.0
        return reference

    def _reference(
        self, time: float, ball_position: Array, ball_velocity: Array
    ) -> SwingReference:
        """Return the reference for the present offset from the ball's centre."""
        radius = self._radius
        height, rate, curvature = self._height(time)
        x, y = self._offset[0].tolist()
        limit = 0.9 * radius
        distance = (x * x + y * y) ** 0.5
        if distance > limit:
            x, y = x * limit / distance, y * limit / distance
        z = (radius**2 - x * x - y * y) ** 0.5
        normal = np.array([x, y, z]) / radius
        # The unit normal turns as the offset moves; second order is left out of
        # its vertical part.
        speed_x, speed_y = self._offset[1].tolist()
        turn = np.array([speed_x, speed_y, -(x * speed_x + y * speed_y) / z]) / radius
        bend = np.array([*self._offset[2].tolist(), 0.0]) / radius
        return SwingReference(
            position=ball_position + (radius + height) * normal,
            rotation=sole_rotation_on_ball(normal),
            linear_velocity=ball_velocity + rate * normal + (radius + height) * turn,
            linear_acceleration=curvature * normal
            + 2.0 * rate * turn
            + (radius + height) * bend,
        )

    def _height(self, time: float) -> tuple[float, float, float]:
        """Return height over the ball, its rate and second derivative."""
        duration, start = self._duration, self._start_height
        if time >= duration:
            late = time - duration
            return -self._descent_speed * late, -self._descent_speed, 0.0
        s = time / duration
        # Bump 64 s^3 (1 - s)^3, which starts and ends without acceleration, and
        # the decay of the initial height.
        u = s * (1 - s)
        bump = 64.0 * u**3
        bump_rate = 192.0 * u * u * (1 - 2 * s)
        bump_curvature = 384.0 * u * (1 - 5 * u)
        decay = 1 - s * s * s * (10 - 15 * s + 6 * s * s)
        decay_rate = -30.0 * s * s * (1 - s) ** 2
        decay_curvature = -60.0 * s * (1 - s) * (1 - 2 * s)
        # Meet the ball at the descent speed, so that the contact is firm.
        meet = -self._descent_speed * duration
        press = meet * s**3 * (s - 1)
        press_rate = meet * s * s * (4 * s - 3)
        press_curvature = meet * s * (12 * s - 6)
        return (
            self._lift * bump + start * decay + press,
            (self._lift * bump_rate + start * decay_rate + press_rate) / duration,
            (self._lift * bump_curvature + start * decay_curvature + press_curvature)
            / duration**2,
        )


def _quintic_step(
    state: Array, target: Array, end_velocity: Array, remaining: float, dt: float
) -> Array:
    """Advance along the quintic to (target, end velocity, no acceleration).

    Args:
        state: Position, velocity, acceleration, shape (3, 2).
        target: Final position, shape (2,).
        end_velocity: Final velocity, shape (2,).
        remaining: Time to the end, [s].
        dt: Time to advance, [s].

    Returns:
        Position, velocity and acceleration after ``dt``, shape (3, 2).
    """
    p, v, a = state
    t = remaining
    gap = target - p - v * t - 0.5 * a * t * t
    gap_velocity = end_velocity - v - a * t
    gap_acceleration = -a
    c3 = (10 * gap - 4 * gap_velocity * t + 0.5 * gap_acceleration * t * t) / t**3
    c4 = (-15 * gap + 7 * gap_velocity * t - gap_acceleration * t * t) / t**4
    c5 = (6 * gap - 3 * gap_velocity * t + 0.5 * gap_acceleration * t * t) / t**5
    d = dt
    return np.vstack(
        (
            p + v * d + 0.5 * a * d**2 + c3 * d**3 + c4 * d**4 + c5 * d**5,
            v + a * d + 3 * c3 * d**2 + 4 * c4 * d**3 + 5 * c5 * d**4,
            a + 6 * c3 * d + 12 * c4 * d**2 + 20 * c5 * d**3,
        )
    )
