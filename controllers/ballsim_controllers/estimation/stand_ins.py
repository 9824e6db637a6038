"""What a sensor that is ill would read by now, from its last healthy value on."""

from __future__ import annotations

from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Array

__all__ = ["load_wrench", "move_rate"]

_PATIENCE = 10  # ticks after which a rate that stands in fades
_FADING = 0.9  # of it, per tick

# A foot is taken to carry something from this part of the weight on.
_LOADED = 0.15
_MOST_SCALE = 2.0


@compiled
def move_rate(rate: float, acceleration: float, missed: float, dt: float) -> float:
    """Return a rate one tick later: it follows what is asked for, and fades in the end.

    Args:
        rate: The rate that stands in, [rad/s].
        acceleration: What is asked for, [rad/s^2].
        missed: Ticks since the last healthy value.
        dt: Control period, [s].
    """
    if missed > _PATIENCE:
        return _FADING * rate
    return rate + dt * acceleration


@compiled
def load_wrench(force: Array, torque: Array, load: float, weight: float) -> None:
    """Give a wrench that stands in another load (in place).

    Args:
        force: Force of the shank on the foot, in the sensor, shape (3,), [N].
        torque: Its torque, shape (3,), [N m].
        load: What the foot is to carry, [N].
        weight: Weight of the robot, [N].
    """
    if -force[2] > _LOADED * weight:
        scale = min(load / -force[2], _MOST_SCALE)
        force *= scale
        torque *= scale
    elif load > 2.0 * _LOADED * weight:  # it has come down meanwhile
        force[0], force[1], force[2] = 0.0, 0.0, -load
        torque[:] = 0.0
