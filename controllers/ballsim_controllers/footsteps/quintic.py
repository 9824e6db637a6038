"""Minimum-jerk motion: the quintic between two states."""

from __future__ import annotations

from ballsim_controllers.compilation import compiled

__all__ = ["mean_acceleration", "quintic_step"]


@compiled
def quintic_step(
    p: float,
    v: float,
    a: float,
    target: float,
    end_velocity: float,
    remaining: float,
    dt: float,
) -> tuple[float, float, float]:
    """Advance along the quintic to (target, end velocity, no acceleration).

    Args:
        p: Position.
        v: Velocity.
        a: Acceleration.
        target: Final position.
        end_velocity: Final velocity.
        remaining: Time to the end, [s].
        dt: Time to advance, [s].

    Returns:
        Position, velocity and acceleration after ``dt``.
    """
    t, d = remaining, dt
    gap = target - p - v * t - 0.5 * a * t * t
    gap_velocity = end_velocity - v - a * t
    gap_acceleration = -a
    c3 = (10 * gap - 4 * gap_velocity * t + 0.5 * gap_acceleration * t * t) / t**3
    c4 = (-15 * gap + 7 * gap_velocity * t - gap_acceleration * t * t) / t**4
    c5 = (6 * gap - 3 * gap_velocity * t + 0.5 * gap_acceleration * t * t) / t**5
    return (
        p + v * d + 0.5 * a * d**2 + c3 * d**3 + c4 * d**4 + c5 * d**5,
        v + a * d + 3 * c3 * d**2 + 4 * c4 * d**3 + 5 * c5 * d**4,
        a + 6 * c3 * d + 12 * c4 * d**2 + 20 * c5 * d**3,
    )


@compiled
def mean_acceleration(
    p: float,
    v: float,
    a: float,
    target: float,
    end_velocity: float,
    duration: float,
    start: float,
    end: float,
) -> float:
    """Return the mean acceleration over a part of a quintic.

    Args:
        p: Position at its beginning.
        v: Velocity.
        a: Acceleration.
        target: Final position.
        end_velocity: Final velocity; the final acceleration is 0.
        duration: Duration of the whole motion, [s].
        start: Where the part begins, [s].
        end: Where it ends, [s].
    """
    _, before, _ = quintic_step(p, v, a, target, end_velocity, duration, start)
    _, after, _ = quintic_step(p, v, a, target, end_velocity, duration, end)
    return (after - before) / (end - start)
