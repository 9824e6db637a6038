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
    pale,
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

_WIDE, _FINE = 3.5, 1.5  # widths of lines, in points

Lines = Sequence[tuple[str, Colour]]
_BOTH: Lines = (("truth", TRUTH), ("estimate", ESTIMATE))
_XYZ: Lines = (("x", LEFT), ("y", TARGET), ("z", IDEAL))


@dataclass(frozen=True, slots=True)
class Plot:
    """A plot of several lines.

    Attributes:
        path: Entity path.
        title: Title with the unit.
        lines: Name and colour of each line.
        n_wide: How many lines, the first ones, are wide: truth lies behind belief.
        is_slow: True if it is shown at the slow rows only.
        compute: Returns the values, shape (n, n_lines).
    """

    path: str
    title: str
    lines: Lines
    n_wide: int
    is_slow: bool
    compute: Callable[[Block], Array]

    @property
    def widths(self) -> list[float]:
        """Return the width of each line, in points."""
        n_fine = len(self.lines) - self.n_wide
        return [_WIDE] * self.n_wide + [_FINE] * n_fine


def make_plots(context: RunContext) -> tuple[Plot, ...]:
    """Return the plots of a run.

    Args:
        context: What does not change during the run.
    """
    return (
        *_ball_plots(),
        *_cop_plots(),
        *_feet_plots(),
        *_robot_plots(),
        *_joint_plots(context),
    )


def _ball_plots() -> list[Plot]:
    def angle(block: Block) -> Array:
        radius, rows = block.context.config.ball.radius, block.slow_rows
        return np.column_stack(
            [
                block.truth.position_ball_in_world[:, 0] / radius,
                block.series.target_ball_angles[rows],
                block.telemetry.reference_ball_angle[rows],
                block.telemetry.position_ball_in_world[rows, 0] / radius,
            ]
        )

    def speed(block: Block) -> Array:
        radius, rows = block.context.config.ball.radius, block.slow_rows
        believed = block.telemetry.linear_velocity_ball_in_world[rows, 0]
        true = block.truth.linear_velocity_ball_in_world[:, 0]
        return np.column_stack([true, believed]) / radius

    def lateral(block: Block) -> Array:
        believed = block.telemetry.position_ball_in_world[block.slow_rows, 1]
        return np.column_stack([block.truth.position_ball_in_world[:, 1], believed])

    four: Lines = (
        ("truth", TRUTH),
        ("target", TARGET),
        ("reference", REFERENCE),
        ("estimate", ESTIMATE),
    )
    return [
        Plot("/plots/ball_angle", "ball angle [rad]", four, 1, True, angle),
        Plot("/plots/ball_speed", "ball speed [rad/s]", _BOTH, 1, True, speed),
        Plot("/plots/ball_lateral", "ball to the left [m]", _BOTH, 1, True, lateral),
    ]


def _cop_plots() -> list[Plot]:
    def cop(axis: int) -> Callable[[Block], Array]:
        def compute(block: Block) -> Array:
            telemetry = block.telemetry
            ball = telemetry.position_ball_in_world[:, axis]
            return np.column_stack(
                [
                    block.contact.cop_to_ball_in_world[:, axis],
                    telemetry.cop_in_world[:, axis] - ball,
                    telemetry.commanded_cop[:, axis] - ball,
                    telemetry.ideal_cop[:, axis] - ball,
                ]
            )

        return compute

    lines: Lines = (
        ("actual", ACTUAL),
        ("measured", MEASURED),
        ("commanded", COMMANDED),
        ("ideal", IDEAL),
    )
    titles = ("CoP to ball, forward [m]", "CoP to ball, left [m]")
    return [
        Plot("/plots/cop_forward", titles[0], lines, 1, False, cop(0)),
        Plot("/plots/cop_left", titles[1], lines, 1, False, cop(1)),
    ]


def _feet_plots() -> list[Plot]:
    def soles(axis: int) -> Callable[[Block], Array]:
        def compute(block: Block) -> Array:
            telemetry, rows, truth = block.telemetry, block.slow_rows, block.truth
            ball = telemetry.position_ball_in_world[rows, axis]
            targets = telemetry.target_soles[rows, :, axis] - ball[:, None]
            true_ball = truth.position_ball_in_world[:, axis]
            true = truth.position_soles_in_world[:, :, axis] - true_ball[:, None]
            return np.column_stack([true, targets])

        return compute

    def forces(block: Block) -> Array:
        believed = block.telemetry.normal_forces
        return np.column_stack([block.contact.normal_forces, believed])

    def lines(belief: str) -> Lines:
        return (
            ("left, truth", pale(LEFT)),
            ("right, truth", pale(RIGHT)),
            (f"left, {belief}", LEFT),
            (f"right, {belief}", RIGHT),
        )

    titles = ("soles to ball, forward [m]", "soles to ball, left [m]")
    force_lines, target_lines = lines("estimate"), lines("target")
    return [
        Plot("/plots/normal_forces", "foot forces [N]", force_lines, 2, False, forces),
        Plot("/plots/soles_forward", titles[0], target_lines, 2, True, soles(0)),
        Plot("/plots/soles_left", titles[1], target_lines, 2, True, soles(1)),
    ]


def _robot_plots() -> list[Plot]:
    def com(axis: int) -> Callable[[Block], Array]:
        def compute(block: Block) -> Array:
            telemetry, rows, truth = block.telemetry, block.slow_rows, block.truth
            believed = (
                telemetry.position_com_in_world[rows, axis]
                - telemetry.position_ball_in_world[rows, axis]
            )
            true = truth.position_com_in_world - truth.position_ball_in_world
            return np.column_stack([true[:, axis], believed])

        return compute

    def tilt(block: Block) -> Array:
        believed = block.telemetry.quaternion_trunk_to_world[block.slow_rows]
        true = block.truth.quaternion_trunk_to_world
        return np.column_stack([_pitch_and_roll(true), _pitch_and_roll(believed)])

    tilts: Lines = (
        ("pitch, truth", pale(ESTIMATE)),
        ("roll, truth", pale(IDEAL)),
        ("pitch, estimate", ESTIMATE),
        ("roll, estimate", IDEAL),
    )
    return [
        Plot("/plots/com_forward", "CoM to ball, forward [m]", _BOTH, 1, True, com(0)),
        Plot("/plots/com_left", "CoM to ball, left [m]", _BOTH, 1, True, com(1)),
        Plot("/plots/trunk_tilt", "trunk tilt [rad]", tilts, 2, True, tilt),
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
        return lambda block: block.series.actuator_forces[:, columns]

    def reading(name: str) -> Callable[[Block], Array]:
        def compute(block: Block) -> Array:
            values: Array = getattr(block.series.readings, name)
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
            0,
            False,
            torques(columns),
        )
        for group, columns in groups.items()
        if columns
    ]
    return plots + [
        Plot(f"/plots/{name}", title, _XYZ, 0, False, reading(name))
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
