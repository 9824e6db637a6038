"""How a run ended."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from ballsim.config import Config
from ballsim.recording.recorder import RunContext
from ballsim.scene import SceneIds
from ballsim.series import RunSeries
from ballsim.world_frame import RobotWorld
from ballsim_controllers.messages import Array
from ballsim_controllers.robot import RobotDescription

__all__ = ["KeptRun", "RunOutcome"]


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """How a run ended.

    Attributes:
        context: What did not change during the run.
        n_ticks: Control periods that were simulated.
        simulated_time: Time that was simulated, [s].
        fall_time: When the robot fell, [s], or None.
        fall_reason: Why it counts as a fall, or None.
        wall_time: Time that the loop took, [s].
    """

    context: RunContext
    n_ticks: int
    simulated_time: float
    fall_time: float | None
    fall_reason: str | None
    wall_time: float

    @property
    def config(self) -> Config:
        """Return the configuration."""
        return self.context.config

    @property
    def robot(self) -> RobotDescription:
        """Return the description of the robot."""
        return self.context.robot

    @property
    def scene_xml(self) -> str:
        """Return the scene as MJCF text."""
        return self.context.scene_xml

    @property
    def model(self) -> mujoco.MjModel:
        """Return the model compiled from the scene."""
        return self.context.model

    @property
    def ids(self) -> SceneIds:
        """Return the ids of the scene."""
        return self.context.ids

    @property
    def world(self) -> RobotWorld:
        """Return the robot's world in the true one."""
        return self.context.world

    @property
    def is_upright(self) -> bool:
        """Return True if the robot was up at the end."""
        return self.fall_time is None


@dataclass(frozen=True, slots=True)
class KeptRun(RunOutcome):
    """How a run ended, and all its rows, kept in memory.

    Attributes:
        series: Time series of the whole run.
    """

    series: RunSeries

    @property
    def inputs(self) -> Array:
        """Return what MuJoCo's drives were told at each tick, shape (n, nu), [rad]."""
        return self.context.find_inputs(self.series.ctrl)

    @classmethod
    def of(cls, outcome: RunOutcome, series: RunSeries) -> KeptRun:
        """Return the outcome of a run together with its series."""
        return cls(
            outcome.context,
            outcome.n_ticks,
            outcome.simulated_time,
            outcome.fall_time,
            outcome.fall_reason,
            outcome.wall_time,
            series,
        )
