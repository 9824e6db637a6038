"""A dry run that loads all compiled functions before a robot depends on them.

The first call of a compiled function loads its machine code, or compiles it where
none is kept: milliseconds to seconds in which no controller may be. So the first
controller of a kind in a process is preceded by one that stands and steps on made-up
readings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from ballsim_controllers.compilation import IS_COMPILED
from ballsim_controllers.messages import (
    Command,
    Controller,
    ControllerSetup,
    SensorReading,
)
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

__all__ = ["rehearse"]

_DURATION = 0.6  # some steps, [s]
_PATIENCE = 0.05  # of the start: it is considered at some ticks, [s]
_rehearsed: set[object] = set()


def rehearse(
    create: Callable[[ControllerSetup], Controller], setup: ControllerSetup
) -> None:
    """Step a controller of its own, once per process for each kind and robot.

    Args:
        create: Makes the controller.
        setup: Robot, ball and control period; its settings are kept but for an early
            start.
    """
    key = (create, setup.robot.mjcf_path)
    if not IS_COMPILED or key in _rehearsed:
        return
    _rehearsed.add(key)
    gait = {**setup.settings.get("gait", {}), "start_patience_s": _PATIENCE}
    settings = {**setup.settings, "gait": gait}
    controller = create(dataclasses.replace(setup, settings=settings))
    reading = _make_standing_reading(setup)
    command = Command(target_ball_angle=1.0, is_stepping=True, heading=1.0)
    for _ in range(round(_DURATION / setup.control_period)):
        controller.step(reading, command)


def _make_standing_reading(setup: ControllerSetup) -> SensorReading:
    """Return what a robot at rest in its nominal stance reads, about."""
    robot = RobotModel(setup.robot)
    stance = solve_nominal_stance(robot, setup.ball.radius)
    weight = np.array([0.0, 0.0, -0.5 * robot.mass * robot.gravity])
    return SensorReading.of(
        time=0.0,
        joint_positions=stance.qpos[7:],
        joint_velocities=np.zeros(robot.joint_count),
        angular_velocity_imu=np.zeros(3),
        acceleration_imu=np.array([0.0, 0.0, robot.gravity]),
        foot_forces=np.array([weight, weight]),
        foot_torques=np.zeros((2, 3)),
        angular_velocity_ball=np.zeros(3),
    )
