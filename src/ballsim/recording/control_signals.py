"""What the controller gets, wants and commands."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ballsim.recording.block import Block
from ballsim.recording.palette import (
    COMMANDED,
    IDEAL,
    LEFT,
    REFERENCE,
    RIGHT,
    TARGET,
    Colour,
    joint_colours,
)
from ballsim.recording.recorder import RunContext
from ballsim.recording.signals import FORWARD_LEFT, FORWARD_LEFT_UP, Signal
from ballsim_controllers.messages import Array

__all__ = ["make_control_signals", "make_sensor_signals"]

_WANTED_COPS = ("ideal", "commanded")
_XYZ = ("x", "y", "z")
_XYZ_COLOURS: tuple[Colour, ...] = (LEFT, TARGET, IDEAL)
_FEET_XYZ = tuple(f"{foot}_{axis}" for foot in ("left", "right") for axis in _XYZ)


def make_control_signals() -> tuple[Signal, ...]:
    """Return the signals below ``/control``."""

    def angle(block: Block) -> Array:
        rows = block.slow_rows
        target = block.series.target_ball_angles[rows]
        return np.column_stack([target, block.telemetry.reference_ball_angle[rows]])

    def com(block: Block) -> Array:
        telemetry, rows = block.telemetry, block.slow_rows
        ball: Array = telemetry.position_ball_in_world[rows]
        wanted: Array = telemetry.target_com[rows]
        return wanted - ball

    def soles(block: Block) -> Array:
        telemetry, rows = block.telemetry, block.slow_rows
        ball = telemetry.position_ball_in_world[rows]
        targets: Array = telemetry.target_soles[rows] - ball[:, None]
        return targets.reshape(-1, 6)

    def cop(block: Block) -> Array:
        telemetry = block.telemetry
        ball = telemetry.position_ball_in_world[:, :2]
        wanted = [getattr(telemetry, f"{kind}_cop") for kind in _WANTED_COPS]
        return np.column_stack([place - ball for place in wanted])

    def landings(block: Block) -> Array:
        places: Array = block.telemetry.landings[block.slow_rows]
        return places.reshape(-1, 4)

    return (
        Signal(
            "/control/ball/angle",
            "rad",
            "ball angle that is asked for, and the reference that leads there",
            ("target", "reference"),
            (TARGET, REFERENCE),
            True,
            angle,
        ),
        Signal(
            "/control/cop",
            "m",
            "CoP that the balance controller wants, and what the soles allow of it, "
            "from the estimated ball's centre",
            tuple(
                f"{kind}_{a}" for kind in ("ideal", "commanded") for a in FORWARD_LEFT
            ),
            (IDEAL, IDEAL, COMMANDED, COMMANDED),
            False,
            cop,
        ),
        Signal(
            "/control/com",
            "m",
            "target of the CoM, from the estimated ball's centre",
            FORWARD_LEFT_UP,
            (IDEAL,) * 3,
            True,
            com,
        ),
        Signal(
            "/control/soles",
            "m",
            "targets of the soles' centres, from the estimated ball's centre",
            tuple(f"{f}_{axis}" for f in ("left", "right") for axis in FORWARD_LEFT_UP),
            (LEFT,) * 3 + (RIGHT,) * 3,
            True,
            soles,
        ),
        Signal(
            "/control/landings",
            "m",
            "where the plan wants each foot to land next, from where the ball's centre "
            "will be then; not a number for a foot that stays",
            tuple(f"{f}_{axis}" for f in ("left", "right") for axis in FORWARD_LEFT),
            (LEFT,) * 2 + (RIGHT,) * 2,
            True,
            landings,
        ),
    )


def make_sensor_signals(context: RunContext) -> tuple[Signal, ...]:
    """Return the signals below ``/sensors``: what the controller was given.

    Args:
        context: What does not change during the run.
    """

    def reading(name: str) -> Callable[[Block], Array]:
        def compute(block: Block) -> Array:
            values: Array = getattr(block.series.readings, name)
            return values

        return compute

    def slow(name: str) -> Callable[[Block], Array]:
        def compute(block: Block) -> Array:
            values: Array = getattr(block.series.readings, name)[block.slow_rows]
            return values.reshape(len(values), math.prod(values.shape[1:]))

        return compute

    feet = (LEFT,) * 3 + (RIGHT,) * 3
    joints = tuple(context.ids.joint_names)
    colours = tuple(joint_colours(len(joints)))
    return (
        Signal(
            "/sensors/imu/gyro",
            "rad/s",
            "gyro on the trunk, in the IMU's frame",
            _XYZ,
            _XYZ_COLOURS,
            False,
            reading("angular_velocity_imu"),
        ),
        Signal(
            "/sensors/imu/accelerometer",
            "m/s2",
            "specific force (+g upwards at rest), in the IMU's frame",
            _XYZ,
            _XYZ_COLOURS,
            False,
            reading("acceleration_imu"),
        ),
        Signal(
            "/sensors/ball/gyro",
            "rad/s",
            "gyro in the ball, in the ball's own frame",
            _XYZ,
            _XYZ_COLOURS,
            True,
            slow("angular_velocity_ball"),
        ),
        Signal(
            "/sensors/feet/force",
            "N",
            "force of the shank on the foot through the ankle's sensor, in its frame",
            _FEET_XYZ,
            feet,
            True,
            slow("foot_forces"),
        ),
        Signal(
            "/sensors/feet/torque",
            "N m",
            "torque of the same wrench about the sensor's origin",
            _FEET_XYZ,
            feet,
            True,
            slow("foot_torques"),
        ),
        Signal(
            "/sensors/joints/position",
            "rad",
            "encoder of each joint",
            joints,
            colours,
            True,
            slow("joint_positions"),
        ),
    )
