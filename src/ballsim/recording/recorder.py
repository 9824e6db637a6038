"""Who gets the blocks of a run; nobody of them acts back on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import mujoco

from ballsim.config import Config
from ballsim.scene import SceneIds
from ballsim.series import RunSeries
from ballsim.truth import (
    ContactTruth,
    StateTruth,
    compute_contact_truth,
    compute_state_truth,
)
from ballsim.world_frame import RobotWorld
from ballsim_controllers.messages import Array
from ballsim_controllers.robot import RobotDescription

__all__ = ["Recorder", "RunBlock", "RunContext", "SeriesKeeper"]


@dataclass(frozen=True, slots=True)
class RunContext:
    """What does not change during a run.

    Attributes:
        config: The configuration.
        robot: Description of the robot.
        scene_xml: The scene as MJCF text.
        model: The model compiled from it.
        ids: Its ids.
        world: The robot's world in the true one.
        encoder_zeros: What each drive reads too much of its joint's angle, shape (nu,),
            [rad].
    """

    config: Config
    robot: RobotDescription
    scene_xml: str = field(repr=False)  # long
    model: mujoco.MjModel
    ids: SceneIds
    world: RobotWorld
    encoder_zeros: Array

    def find_inputs(self, ctrl: Array) -> Array:
        """Return what MuJoCo's drives were told where the controller sent set-points.

        Args:
            ctrl: The set-points, shape (..., nu), [rad].
        """
        return ctrl - self.encoder_zeros


@dataclass(frozen=True)
class RunBlock:
    """Some rows of a run, and what was true then: computed once, if asked for.

    A recorder may keep a block: the loop has done with it.

    Attributes:
        context: What does not change; but its configuration grows while somebody
            conducts the run.
        series: The rows.
        scratch: Data that recorders may compute in.
        wall_time: When the loop had done the rows, [s] from an arbitrary moment; NaN
            if nobody has looked.
    """

    context: RunContext
    series: RunSeries
    scratch: mujoco.MjData
    wall_time: float = math.nan

    @property
    def is_first(self) -> bool:
        """Return True for the block that a run begins with."""
        return self.series.first_tick == 0

    @cached_property
    def truth(self) -> StateTruth:
        """Return the true states in the robot's world, n_ticks + 1 rows."""
        context, series = self.context, self.series
        return compute_state_truth(
            context.model,
            context.ids,
            context.world,
            series.qpos,
            series.qvel,
            self.scratch,
        )

    @cached_property
    def contact(self) -> ContactTruth:
        """Return the true contact of the feet, n_ticks rows."""
        return compute_contact_truth(self.context.ids, self.context.world, self.series)


class Recorder(Protocol):
    """Gets a run block by block while it goes on: a log, a summary, a file.

    A recorder serves one run.
    """

    def start(self, context: RunContext) -> None:
        """Begin, before the loop."""
        ...

    def record(self, block: RunBlock) -> None:
        """Take the rows that follow those of the block before."""
        ...

    def close(self) -> None:
        """End, also after a failure; called once."""
        ...


class SeriesKeeper:
    """Keeps all rows in memory."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._blocks: list[RunSeries] = []

    def start(self, context: RunContext) -> None:
        """Do nothing."""

    def record(self, block: RunBlock) -> None:
        """Keep a block."""
        self._blocks.append(block.series)

    def close(self) -> None:
        """Do nothing."""

    @property
    def series(self) -> RunSeries:
        """Return the rows so far as one series; there must be some."""
        if len(self._blocks) > 1:
            self._blocks[:] = [RunSeries.join(self._blocks)]
        return self._blocks[0]
