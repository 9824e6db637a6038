"""What a recorder must offer; it never acts back on the run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import mujoco

from ballsim.config import Config
from ballsim.scene import SceneIds
from ballsim.series import RunSeries
from ballsim.world_frame import RobotWorld
from ballsim_controllers.robot import RobotDescription

__all__ = ["NullRecorder", "Recorder", "RunContext"]


@dataclass(frozen=True, slots=True)
class RunContext:
    """What does not change during a run.

    Attributes:
        config: The configuration.
        model: The compiled scene.
        ids: Its ids.
        world: The robot's world in the true one.
        robot: Description of the robot.
    """

    config: Config
    model: mujoco.MjModel
    ids: SceneIds
    world: RobotWorld
    robot: RobotDescription


class Recorder(Protocol):
    """Gets the time series of a run while they grow."""

    def start(self, context: RunContext) -> None:
        """Begin a recording, before the loop."""
        ...

    def record(self, series: RunSeries, start: int, stop: int) -> None:
        """Keep the rows from start to stop, all of them complete."""
        ...

    def close(self) -> None:
        """End the recording, also after a failure."""
        ...


class NullRecorder:
    """Keeps nothing."""

    def start(self, context: RunContext) -> None:
        """Do nothing."""

    def record(self, series: RunSeries, start: int, stop: int) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
