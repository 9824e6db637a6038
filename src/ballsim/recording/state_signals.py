"""State of robot and ball: the truth, and what the robot believes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ballsim.recording.block import Block
from ballsim.recording.palette import (
    ERROR_COLOURS,
    ESTIMATE,
    LEFT,
    RIGHT,
    TRUTH,
    joint_colours,
    pale,
)
from ballsim.recording.recorder import RunContext
from ballsim.recording.signals import FORWARD_LEFT, FORWARD_LEFT_UP, Signal
from ballsim_controllers.messages import Array

__all__ = ["make_state_signals"]

Getter = Callable[[str], Array]

_COLOURS = {"truth": TRUTH, "estimate": ESTIMATE}


@dataclass(frozen=True, slots=True)
class _Quantity:
    """A part of the state.

    Attributes:
        path: Path below ``/truth`` or ``/estimate``.
        unit: Unit.
        description: What it is.
        columns: Names of the components.
        compute: Returns the values from fields of the state by name and the radius.
    """

    path: str
    unit: str
    description: str
    columns: tuple[str, ...]
    compute: Callable[[Getter, float], Array]


def make_state_signals(context: RunContext) -> tuple[Signal, ...]:
    """Return the signals below ``/truth`` and ``/estimate``.

    Args:
        context: What does not change during the run.
    """
    return (
        *(_make_signal(kind, part) for kind in _COLOURS for part in _QUANTITIES),
        *_contact_signals(),
        *_error_signals(),
        *_joint_signals(context),
    )


def _ball_angle(get: Getter, radius: float) -> Array:
    return get("position_ball_in_world")[:, :2] / radius


def _ball_rate(get: Getter, radius: float) -> Array:
    rolling = get("linear_velocity_ball_in_world")[:, :2] / radius
    return np.column_stack([rolling, get("angular_velocity_ball_in_world")[:, 2]])


def _com_to_ball(get: Getter, _radius: float) -> Array:
    return get("position_com_in_world") - get("position_ball_in_world")


def _attitude(get: Getter, _radius: float) -> Array:
    """Return roll (to the right), pitch (forwards) and yaw (to the left), [rad]."""
    w, x, y, z = get("quaternion_trunk_to_world").T
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.column_stack([roll, pitch, yaw])


_QUANTITIES = (
    _Quantity(
        "ball/angle",
        "rad",
        "how far the ball has rolled in the robot's world: way of its centre by radius",
        FORWARD_LEFT,
        _ball_angle,
    ),
    _Quantity(
        "ball/rate",
        "rad/s",
        "speed of the ball's centre by radius; spin about the vertical",
        (*FORWARD_LEFT, "spin"),
        _ball_rate,
    ),
    _Quantity(
        "com/position",
        "m",
        "robot's centre of mass from the ball's centre, robot's world",
        FORWARD_LEFT_UP,
        _com_to_ball,
    ),
    _Quantity(
        "com/velocity",
        "m/s",
        "velocity of the robot's centre of mass, robot's world",
        FORWARD_LEFT_UP,
        lambda get, _: get("linear_velocity_com_in_world"),
    ),
    _Quantity(
        "trunk/attitude",
        "rad",
        "trunk to robot's world: roll to the right, pitch forwards, yaw to the left",
        ("roll", "pitch", "yaw"),
        _attitude,
    ),
)


def _true(block: Block) -> Getter:
    return lambda name: getattr(block.truth, name)


def _believed(block: Block) -> Getter:
    return lambda name: getattr(block.telemetry, name)[block.slow_rows]


_GETTERS: dict[str, Callable[[Block], Getter]] = {"truth": _true, "estimate": _believed}


def _make_signal(kind: str, part: _Quantity) -> Signal:
    def compute(block: Block) -> Array:
        return part.compute(_GETTERS[kind](block), block.context.config.ball.radius)

    colours = (_COLOURS[kind],) * len(part.columns)
    return Signal(
        f"/{kind}/{part.path}",
        part.unit,
        part.description,
        part.columns,
        colours,
        True,
        compute,
    )


def _contact_signals() -> list[Signal]:
    def measured_cop(block: Block) -> Array:
        telemetry = block.telemetry
        cop: Array = telemetry.cop_in_world - telemetry.position_ball_in_world[:, :2]
        return cop

    cop, forces = "centre of pressure from the ball's centre, robot's world", "N"
    on_feet = "force of the ball on each foot along the normal of the contact"
    feet, pales = ("left", "right"), (pale(LEFT), pale(RIGHT))
    return [
        Signal(
            "/truth/cop",
            "m",
            f"actual {cop}",
            FORWARD_LEFT,
            (TRUTH, TRUTH),
            False,
            lambda block: block.contact.cop_to_ball_in_world,
        ),
        Signal(
            "/estimate/cop",
            "m",
            f"measured {cop}",
            FORWARD_LEFT,
            (ESTIMATE, ESTIMATE),
            False,
            measured_cop,
        ),
        Signal(
            "/truth/foot_forces",
            forces,
            on_feet,
            feet,
            pales,
            False,
            lambda block: block.contact.normal_forces,
        ),
        Signal(
            "/estimate/foot_forces",
            forces,
            on_feet,
            feet,
            (LEFT, RIGHT),
            True,
            lambda block: block.telemetry.normal_forces[block.slow_rows],
        ),
        Signal(
            "/truth/soles",
            "m",
            "centres of the soles from the ball's centre, robot's world",
            tuple(f"{foot}_{axis}" for foot in feet for axis in FORWARD_LEFT_UP),
            (pale(LEFT),) * 3 + (pale(RIGHT),) * 3,
            True,
            _true_soles,
        ),
    ]


def _true_soles(block: Block) -> Array:
    truth = block.truth
    soles = truth.position_soles_in_world - truth.position_ball_in_world[:, None]
    return soles.reshape(-1, 6)


def _error_signals() -> list[Signal]:
    def error(block: Block, compute: Callable[[Getter, float], Array]) -> Array:
        radius = block.context.config.ball.radius
        return compute(_believed(block), radius) - compute(_true(block), radius)

    def angles(block: Block) -> Array:
        return np.column_stack([error(block, _ball_angle), error(block, _attitude)])

    return [
        Signal(
            "/estimate/error/angles",
            "rad",
            "estimate less truth: ball angle and attitude of the trunk",
            ("ball_forward", "ball_left", "roll", "pitch", "yaw"),
            ERROR_COLOURS,
            True,
            angles,
        ),
        Signal(
            "/estimate/error/com",
            "m",
            "estimate less truth: CoM from the ball's centre",
            FORWARD_LEFT_UP,
            ERROR_COLOURS[:3],
            True,
            lambda block: error(block, _com_to_ball),
        ),
    ]


def _joint_signals(context: RunContext) -> list[Signal]:
    ids, n = context.ids, len(context.ids.joint_names)
    colours = tuple(joint_colours(n))
    return [
        Signal(
            "/truth/joints/position",
            "rad",
            "angle of each joint",
            tuple(ids.joint_names),
            colours,
            True,
            lambda block: block.series.qpos[block.slow_rows][:, ids.qpos_joints],
        ),
        Signal(
            "/truth/joints/torque",
            "N m",
            "torque of each joint's drive",
            tuple(ids.joint_names),
            colours,
            False,
            lambda block: block.series.actuator_forces,
        ),
    ]
