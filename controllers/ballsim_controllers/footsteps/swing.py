"""Path of a swinging foot over the ball."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.quintic import quintic_step
from ballsim_controllers.geometry import clip, cross, sole_rotation_on_ball
from ballsim_controllers.messages import (
    Array,
    ArrayField,
    Message,
    Record,
    StateEstimate,
    make_record,
)
from ballsim_controllers.robot_model import FootKinematics

__all__ = [
    "SWING",
    "SwingFoot",
    "SwingReference",
    "advance_swing",
    "mean_lifting",
    "slew",
]

#: Fields of a `SwingReference`.
SWING = np.dtype(
    [
        ("position", np.float64, 3),
        ("rotation", np.float64, (3, 3)),
        ("linear_velocity", np.float64, 3),
        ("linear_acceleration", np.float64, 3),
        ("angular_velocity", np.float64, 3),
        ("angular_acceleration", np.float64, 3),
    ]
)
#: What the path depends on and what it keeps from tick to tick; the heading is the
#: direction of the toes about the vertical, [rad].
_PATH = np.dtype(
    [
        ("radius", np.float64),
        ("lift", np.float64),
        ("descent_speed", np.float64),
        ("offset", np.float64, (3, 2)),  # offset, its velocity and acceleration
        ("start_height", np.float64),
        ("depth", np.float64),
        ("duration", np.float64),
        ("target", np.float64, 2),
        ("heading", np.float64),
    ]
)


@dataclass(frozen=True, slots=True)
class SwingReference(Message):
    """Where the swinging sole shall be now, in the world.

    Attributes:
        record: All of the below, shape (1,), dtype `SWING`.
        position: Sole's centre, shape (3,), [m].
        rotation: Sole to world, shape (3, 3).
        linear_velocity: Shape (3,), [m/s].
        linear_acceleration: Relative to the ball's centre, one tick later: torques that
            are found now take that long to act, shape (3,), [m/s^2].
        angular_velocity: Shape (3,), [rad/s].
        angular_acceleration: One tick later, shape (3,), [rad/s^2].
    """

    position = ArrayField()
    rotation = ArrayField()
    linear_velocity = ArrayField()
    linear_acceleration = ArrayField()
    angular_velocity = ArrayField()
    angular_acceleration = ArrayField()

    @classmethod
    def of(cls, **values: Any) -> SwingReference:
        """Return a reference from the values of all fields by name."""
        return cls(make_record(SWING, values))


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

    Attributes:
        path: Constants and state of the path, shape (1,).
        target: Landing offset from the ball's centre, shape (2,), [m].
    """

    def __init__(
        self, ball_radius: float, lift: float, freeze_time: float, descent_speed: float
    ) -> None:
        """Keep the parameters."""
        self._freeze_time = freeze_time
        self.path: Record = np.zeros(1, _PATH)
        self.path["radius"] = ball_radius
        self.path["lift"] = lift
        self.path["descent_speed"] = descent_speed
        self.path["duration"] = 1.0
        self.target: Array = self.path["target"][0]

    def lift_off(
        self,
        offset: Array,
        offset_velocity: Array,
        height: float,
        duration: float,
        depth: float = 0.0,
    ) -> None:
        """Begin a swing.

        Args:
            offset: Horizontal offset of the sole's centre from the ball's
                centre, shape (2,), [m].
            offset_velocity: Its rate, shape (2,), [m/s].
            height: Distance of the sole's centre from the ball's surface, [m].
            duration: Planned swing time, [s].
            depth: How far below the ball's surface the path ends, [m].
        """
        path = self.path[0]
        path["offset"][0], path["offset"][1] = offset, offset_velocity
        path["offset"][2] = 0.0
        path["start_height"], path["depth"] = height, depth
        path["duration"] = duration
        self.target[:] = offset

    def leave(
        self,
        sole: FootKinematics,
        estimate: StateEstimate,
        duration: float,
        depth: float,
    ) -> None:
        """Begin a swing where a sole is.

        Args:
            sole: The sole.
            estimate: State estimate, for the ball.
            duration: Planned swing time, [s].
            depth: How far below the ball's surface the path ends, [m].
        """
        offset = sole.position - estimate.position_ball_in_world
        height = float(np.sqrt(offset @ offset)) - float(self.path["radius"][0])
        velocity = sole.linear_velocity - estimate.linear_velocity_ball_in_world
        self.lift_off(offset[:2], velocity[:2], height, duration, depth)

    def aim(self, target: Array, time: float) -> None:
        """Set the landing offset from the ball's centre, shape (2,), [m]."""
        if self.path["duration"][0] - time > self._freeze_time:
            self.target[:] = target

    def landing_range(
        self, landing: Array, time: float, slew_rate: float
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return where the foot may land yet, least and greatest along each axis.

        Args:
            landing: Landing offset as it is aimed at now, shape (2,), [m].
            time: Time since lift-off, [s].
            slew_rate: How fast it may move along either axis, [m/s].
        """
        left = float(self.path["duration"][0]) - time - self._freeze_time
        x, y = (self.target if left <= 0.0 else landing).tolist()
        way = slew_rate * max(left, 0.0)
        return (x - way, x + way), (y - way, y + way)

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
        swing: Record = np.empty(1, SWING)
        advance_swing(swing, self.path, time, dt, ball_position, ball_velocity)
        return SwingReference(swing)


@compiled
def slew(present: Array, target: Array, limit: float) -> Array:
    """Return a place on the way to a target, within a limit along each axis.

    Args:
        present: Where to start from, shape (2,), [m].
        target: Where to go, shape (2,), [m].
        limit: Largest change of a coordinate, [m].
    """
    result = present.copy()
    for i in range(2):
        result[i] += clip(target[i] - present[i], -limit, limit)
    return result


@compiled
def advance_swing(
    swings: Record,
    paths: Record,
    time: float,
    dt: float,
    ball_position: Array,
    ball_velocity: Array,
) -> None:
    """Write the reference at a time of the swing and move the path on.

    Args:
        swings: The reference, shape (1,), dtype `SWING`.
        paths: The path, shape (1,), dtype of `SwingFoot.path`.
        time: Time since lift-off, [s].
        dt: Control period, [s].
        ball_position: Ball's centre in the world, shape (3,), [m].
        ball_velocity: Its velocity in the world, shape (3,), [m/s].
    """
    path = paths[0]
    _write_motion(swings[0], path, time, ball_position, ball_velocity)
    offset, target, radius = path["offset"], path["target"], path["radius"]
    remaining = path["duration"] - time
    # At touchdown the sole moves with the ball's surface, which at the top
    # has the speed of the centre relative to it, and less beside it.
    slope = (target[0] ** 2 + target[1] ** 2) / radius**2
    share = max(1.0 - slope, 0.0) ** 0.5
    for axis in range(2):
        end_velocity = ball_velocity[axis] * share
        if remaining > dt:
            position, velocity, acceleration = quintic_step(
                offset[0, axis],
                offset[1, axis],
                offset[2, axis],
                target[axis],
                end_velocity,
                remaining,
                dt,
            )
        else:
            position = offset[0, axis] + end_velocity * dt
            velocity, acceleration = end_velocity, 0.0
        offset[0, axis], offset[1, axis] = position, velocity
        offset[2, axis] = acceleration
    _write_accelerations(swings[0], path, time + dt)


@compiled
def _find_normal(path: Record) -> tuple[Array, Array]:
    """Return the ball's unit normal under the sole and the rate of it, (3,) each.

    Where the sole has left the ball, the normal is that of its edge.
    """
    radius, offset = path["radius"], path["offset"]
    x, y = offset[0, 0], offset[0, 1]
    limit = 0.9 * radius
    distance = (x * x + y * y) ** 0.5
    if distance > limit:
        x, y = x * limit / distance, y * limit / distance
    z = (radius**2 - x * x - y * y) ** 0.5
    # The normal turns as the offset moves: x x + y y + z z = r^2, derived.
    slide = -(x * offset[1, 0] + y * offset[1, 1]) / z
    return (
        np.array([x, y, z]) / radius,
        np.array([offset[1, 0], offset[1, 1], slide]) / radius,
    )


@compiled
def _write_motion(
    swing: Record,
    path: Record,
    time: float,
    ball_position: Array,
    ball_velocity: Array,
) -> None:
    """Write pose and velocities for the present offset from the ball's centre."""
    height, rate, _ = _height(
        time,
        path["duration"],
        path["start_height"],
        path["depth"],
        path["lift"],
        path["descent_speed"],
    )
    normal, turn = _find_normal(path)
    distance = path["radius"] + height
    swing["rotation"][:] = sole_rotation_on_ball(normal, path["heading"])
    swing["angular_velocity"][:] = cross(normal, turn)
    for i in range(3):
        swing["position"][i] = ball_position[i] + distance * normal[i]
        swing["linear_velocity"][i] = (
            ball_velocity[i] + rate * normal[i] + distance * turn[i]
        )


@compiled
def _write_accelerations(swing: Record, path: Record, time: float) -> None:
    """Write the accelerations for the present offset from the ball's centre."""
    height, rate, curvature = _height(
        time,
        path["duration"],
        path["start_height"],
        path["depth"],
        path["lift"],
        path["descent_speed"],
    )
    normal, turn = _find_normal(path)
    radius, offset = path["radius"], path["offset"]
    distance = radius + height
    bend = np.array([offset[2, 0], offset[2, 1], 0.0]) / radius
    # n n = 1, derived twice: n n'' = -n' n'.
    along = normal[0] * bend[0] + normal[1] * bend[1]
    for i in range(3):
        along += turn[i] * turn[i]
    bend[2] = -along / normal[2]
    swing["angular_acceleration"][:] = cross(normal, bend)
    for i in range(3):
        swing["linear_acceleration"][i] = (
            curvature * normal[i] + 2.0 * rate * turn[i] + distance * bend[i]
        )


def mean_lifting(lift: float, count: int, cell: float) -> tuple[float, ...]:
    """Return the mean acceleration of a sole away from the ball, by cell of a swing.

    Without the speed at which it meets the ball: what that takes comes back at landing.

    Args:
        lift: Greatest height of the sole over the ball, [m].
        count: Cells of the swing.
        cell: Length of a cell, [s].

    Returns:
        A value for each cell, [m/s^2].
    """
    duration = count * cell
    times = [k * cell for k in range(count + 1)]
    rates = [_height(time, duration, 0.0, 0.0, lift, 0.0)[1] for time in times]
    return tuple((after - before) / cell for before, after in pairwise(rates))


@compiled
def _height(
    time: float,
    duration: float,
    start: float,
    depth: float,
    lift: float,
    descent_speed: float,
) -> tuple[float, float, float]:
    """Return height over the ball, its rate and second derivative."""
    if time >= duration:
        late = time - duration
        return -depth - descent_speed * late, -descent_speed, 0.0
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
    meet = -descent_speed * duration
    fall = start + depth
    press = meet * s**3 * (s - 1)
    press_rate = meet * s * s * (4 * s - 3)
    press_curvature = meet * s * (12 * s - 6)
    return (
        lift * bump + fall * decay - depth + press,
        (lift * bump_rate + fall * decay_rate + press_rate) / duration,
        (lift * bump_curvature + fall * decay_curvature + press_curvature)
        / duration**2,
    )
