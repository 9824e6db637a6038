"""Pushes from outside: which wrench acts on which body at which tick."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import mujoco
import numpy as np

from ballsim.errors import ConfigError
from ballsim.noise import make_generator
from ballsim.plant_config import PushConfig
from ballsim.scene import SceneIds
from ballsim.world_frame import RobotWorld
from ballsim_controllers.messages import Array

__all__ = ["PushSchedule", "draw_push_times"]

_TIME_STREAM = 2000  # streams of random numbers, far from those of the sensors
_DIGITS = 9  # of a time that is drawn, [s]: no multiple of a period needs more


def draw_push_times(
    pushes: Sequence[PushConfig], seed: int, period: float
) -> tuple[PushConfig, ...]:
    """Return the pushes of a run, with the time of each drawn within its spread.

    Args:
        pushes: The pushes.
        seed: Seed of the run.
        period: Control period, [s]; each push begins at a multiple of it.

    Examples:
        >>> push = PushConfig(time=5.0, time_spread=0.7)
        >>> 5.0 <= draw_push_times([push], seed=3, period=0.005)[0].time <= 5.7
        True
    """
    drawn = []
    for i, push in enumerate(pushes):
        late = 0
        if push.time_spread > 0.0:
            n_ticks = round(push.time_spread / period)
            late = int(make_generator(seed, _TIME_STREAM, i).integers(n_ticks + 1))
        time = (round(push.time / period) + late) * period if late else push.time
        time = round(time, _DIGITS)
        drawn.append(dataclasses.replace(push, time=time, time_spread=0.0))
    return tuple(drawn)


class PushSchedule:
    """The wrenches of all pushes of a run; those that overlap add up.

    Args:
        model: The compiled scene.
        ids: Its ids.
        world: The robot's world, whose axes the directions refer to.
        pushes: The pushes.
        period: Time between two ticks, [s].

    Raises:
        ConfigError: There is no such body.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        ids: SceneIds,
        world: RobotWorld,
        pushes: Sequence[PushConfig],
        period: float,
    ) -> None:
        """Compute the wrench of each push."""
        is_pushable = model.body_rootid == ids.body_trunk
        is_pushable[ids.body_ball] = True
        self._bodies = {
            model.body(int(i)).name: int(i) for i in np.flatnonzero(is_pushable)
        }
        self._world, self._period = world, period
        self._spans: list[tuple[int, int, int, Array]] = []
        self._changes = [0]
        self._wrenches = np.zeros((model.nbody, 6))
        for i, push in enumerate(pushes):
            self.add(push, f"push.{i}.body")

    def add(self, push: PushConfig, key: str = "push.body") -> None:
        """Add a push, whose beginning may be the tick that is asked for next.

        Args:
            push: The push.
            key: What its body is called if there is none of that name.

        Raises:
            ConfigError: There is no such body.
        """
        if push.body not in self._bodies:
            raise ConfigError(key, push.body, f"one of {', '.join(self._bodies)}")
        start = round(push.time / self._period)
        stop = start + round(push.duration / self._period)
        wrench = _compute_wrench(push, self._world)
        self._spans.append((start, stop, self._bodies[push.body], wrench))
        self._changes = sorted({*self._changes, start, stop})

    def at(self, tick: int) -> Array | None:
        """Return what acts from a tick on for a period; ticks must not decrease.

        Args:
            tick: Number of the tick.

        Returns:
            Force and torque on each body in the world at its CoM, shape (nbody, 6),
            [N], [N m]; to be read only, before the next call. None if there is no push
            at all.
        """
        if not self._spans:
            return None
        if self._changes and self._changes[0] <= tick:
            self._changes = [change for change in self._changes if change > tick]
            self._wrenches[:] = 0.0
            for start, stop, body, wrench in self._spans:
                if start <= tick < stop:
                    self._wrenches[body] += wrench
        return self._wrenches


def _compute_wrench(push: PushConfig, world: RobotWorld) -> Array:
    """Return force and torque of a push in the true world, shape (6,)."""
    direction = [math.cos(push.direction), math.sin(push.direction), 0.0]
    force = push.force * (world.rotation_robot_to_true @ direction)
    torque = np.cross([0.0, 0.0, push.height], force)
    return np.concatenate([force, torque])
