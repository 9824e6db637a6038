"""Time series of the log, each with its lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ballsim.recording.block import Block
from ballsim.recording.palette import (
    ACTUAL,
    COMMANDED,
    ESTIMATE,
    IDEAL,
    LEFT,
    MEASURED,
    REFERENCE,
    RIGHT,
    TARGET,
    TRUTH,
    Colour,
    joint_colours,
)
from ballsim.recording.recorder import RunContext
from ballsim_controllers.messages import Array, GaitPhase

__all__ = ["PHASE_COLOURS", "PHASE_PATH", "Lines", "Plot", "make_plots"]

PHASE_PATH = "/plots/gait_phase"
PHASE_COLOURS: dict[str, Colour] = {
    GaitPhase.STAND.name: (110, 110, 120),
    GaitPhase.DOUBLE.name: (190, 190, 200),
    GaitPhase.LEFT_SUPPORT.name: LEFT,
    GaitPhase.RIGHT_SUPPORT.name: RIGHT,
}

Lines = Sequence[tuple[str, Colour]]
_XYZ: Lines = (("x", LEFT), ("y", TARGET), ("z", IDEAL))


@dataclass(frozen=True, slots=True)
class Plot:
    """A plot of several lines.

    Attributes:
        path: Entity path.
        title: Title with the unit.
        lines: Name and colour of each line.
        is_slow: True if it is shown at the slow ticks only.
        compute: Returns the values, shape (n, n_lines).
    """

    path: str
    title: str
    lines: Lines
    is_slow: bool
    compute: Callable[[Block], Array]


def make_plots(context: RunContext) -> tuple[Plot, ...]:
    """Return the plots of a run.

    Args:
        context: What does not change during the run.
    """
    return (*_ball_plots(), *_cop_plots(), *_robot_plots(), *_joint_plots(context))


def _ball_plots() -> list[Plot]:
    def angle(block: Block) -> Array:
        radius, rows = block.context.config.ball.radius, block.slow_ticks
        return np.column_stack(
            [
                block.series.target_ball_angles[rows],
                block.telemetry.reference_ball_angle[rows],
                block.telemetry.position_ball_in_world[rows, 0] / radius,
                block.truth.position_ball_in_world[:, 0] / radius,
            ]
        )

    def speed(block: Block) -> Array:
        radius, rows = block.context.config.ball.radius, block.slow_ticks
        believed = block.telemetry.linear_velocity_ball_in_world[rows, 0]
        true = block.truth.linear_velocity_ball_in_world[:, 0]
        return np.column_stack([believed, true]) / radius

    def lateral(block: Block) -> Array:
        believed = block.telemetry.position_ball_in_world[block.slow_ticks, 1]
        return np.column_stack([believed, block.truth.position_ball_in_world[:, 1]])

    both: Lines = (("estimate", ESTIMATE), ("truth", TRUTH))
    four: Lines = (("target", TARGET), ("reference", REFERENCE), *both)
    return [
        Plot("/plots/ball_angle", "ball angle [rad]", four, True, angle),
        Plot("/plots/ball_speed", "ball speed [rad/s]", both, True, speed),
        Plot("/plots/ball_lateral", "ball to the left [m]", both, True, lateral),
    ]


def _cop_plots() -> list[Plot]:
    def cop(axis: int) -> Callable[[Block], Array]:
        def compute(block: Block) -> Array:
            telemetry, rows = block.telemetry, block.ticks
            ball = telemetry.position_ball_in_world[rows, axis]
            return np.column_stack(
                [
                    telemetry.ideal_cop[rows, axis] - ball,
                    telemetry.commanded_cop[rows, axis] - ball,
                    telemetry.cop_in_world[rows, axis] - ball,
                    block.contact.cop_to_ball_in_world[:, axis],
                ]
            )

        return compute

    lines: Lines = (
        ("ideal", IDEAL),
        ("commanded", COMMANDED),
        ("measured", MEASURED),
        ("actual", ACTUAL),
    )
    return [
        Plot(
            "/plots/cop_forward", "CoP on the ball, forward [m]", lines, False, cop(0)
        ),
        Plot("/plots/cop_left", "CoP on the ball, left [m]", lines, False, cop(1)),
    ]


def _robot_plots() -> list[Plot]:
    def com(axis: int) -> Callable[[Block], Array]:
        def compute(block: Block) -> Array:
            telemetry, rows, truth = block.telemetry, block.slow_ticks, block.truth
            believed = (
                telemetry.position_com_in_world[rows, axis]
                - telemetry.position_ball_in_world[rows, axis]
            )
            true = truth.position_com_in_world - truth.position_ball_in_world
            return np.column_stack([believed, true[:, axis]])

        return compute

    def tilt(block: Block) -> Array:
        believed = block.telemetry.quaternion_trunk_to_world[block.slow_ticks]
        true = block.truth.quaternion_trunk_to_world
        return np.column_stack([_pitch_and_roll(believed), _pitch_and_roll(true)])

    def forces(block: Block) -> Array:
        believed = block.telemetry.normal_forces[block.ticks]
        return np.column_stack([believed, block.contact.normal_forces])

    both: Lines = (("estimate", ESTIMATE), ("truth", TRUTH))
    tilts: Lines = (
        ("pitch, estimate", ESTIMATE),
        ("roll, estimate", COMMANDED),
        ("pitch, truth", TRUTH),
        ("roll, truth", IDEAL),
    )
    feet: Lines = (
        ("left, estimate", LEFT),
        ("right, estimate", RIGHT),
        ("left, truth", TRUTH),
        ("right, truth", IDEAL),
    )
    return [
        Plot("/plots/com_forward", "CoM to ball, forward [m]", both, True, com(0)),
        Plot("/plots/com_left", "CoM to ball, left [m]", both, True, com(1)),
        Plot("/plots/trunk_tilt", "trunk tilt [rad]", tilts, True, tilt),
        Plot("/plots/normal_forces", "foot forces [N]", feet, False, forces),
    ]


def _joint_plots(context: RunContext) -> list[Plot]:
    names = context.ids.joint_names
    legs = [set(leg.joints) for leg in context.robot.legs]
    groups = {
        "left leg": [i for i, name in enumerate(names) if name in legs[0]],
        "right leg": [i for i, name in enumerate(names) if name in legs[1]],
        "upper body": [
            i for i, name in enumerate(names) if not any(name in leg for leg in legs)
        ],
    }

    def torques(columns: list[int]) -> Callable[[Block], Array]:
        return lambda block: block.series.actuator_forces[block.ticks][:, columns]

    def reading(name: str) -> Callable[[Block], Array]:
        def compute(block: Block) -> Array:
            values: Array = getattr(block.series.readings, name)[block.ticks]
            return values

        return compute

    plots = [
        Plot(
            f"/plots/torques_{group.replace(' ', '_')}",
            f"torques, {group} [N m]",
            [
                (names[i], colour)
                for i, colour in zip(columns, joint_colours(len(columns)), strict=True)
            ],
            False,
            torques(columns),
        )
        for group, columns in groups.items()
        if columns
    ]
    return plots + [
        Plot(f"/plots/{name}", title, _XYZ, False, reading(name))
        for name, title in (
            ("angular_velocity_imu", "gyro on the trunk [rad/s]"),
            ("acceleration_imu", "accelerometer [m/s2]"),
            ("angular_velocity_ball", "gyro in the ball [rad/s]"),
        )
    ]


def _pitch_and_roll(quaternions: Array) -> Array:
    """Return pitch (forwards) and roll (to the right), shape (n, 2), [rad]."""
    w, x, y, z = quaternions.T
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return np.column_stack([pitch, roll])
