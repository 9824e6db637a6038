"""Points of the 3-D view: CoM, CoP and foot targets, true and as believed."""

from __future__ import annotations

from collections.abc import Callable
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
    RIGHT,
    TRUTH,
    Colour,
)
from ballsim_controllers.messages import Array

__all__ = ["MARKS", "Mark"]


@dataclass(frozen=True, slots=True)
class Mark:
    """A few points that move.

    Attributes:
        path: Entity path.
        colours: One for each point.
        radius: Radius of the points, [m].
        compute: Returns the points in the true world at the slow rows of a
            block, shape (n, n_points, 3), [m].
    """

    path: str
    colours: tuple[Colour, ...]
    radius: float
    compute: Callable[[Block], Array]

    @property
    def n_points(self) -> int:
        """Return the number of points."""
        return len(self.colours)


def _believed(block: Block, name: str) -> Array:
    """Return points of the telemetry in the true world."""
    points: Array = getattr(block.telemetry, name)[block.slow_rows]
    if points.ndim == 2:
        points = points[:, None]
    return block.context.world.transform_points_to_true(points)


def _believed_cop(block: Block, name: str) -> Array:
    """Return a CoP of the telemetry, raised to the surface of the ball."""
    telemetry, rows = block.telemetry, block.slow_rows
    centre = telemetry.position_ball_in_world[rows]
    offset = getattr(telemetry, name)[rows] - centre[:, :2]
    return _on_ball(block, centre, offset)


def _actual_cop(block: Block) -> Array:
    rows = block.slow_rows
    centre = block.truth.position_ball_in_world
    return _on_ball(block, centre, block.contact.cop_to_ball_in_world[rows])


def _on_ball(block: Block, centre: Array, offset: Array) -> Array:
    radius = block.context.config.ball.radius
    height = np.sqrt(np.maximum(radius**2 - (offset**2).sum(axis=1), 0.0))
    points = centre + np.column_stack([offset, height])
    return block.context.world.transform_points_to_true(points[:, None])


def _true_com(block: Block) -> Array:
    points = block.truth.position_com_in_world[:, None]
    return block.context.world.transform_points_to_true(points)


MARKS = (
    Mark("/world/com/true", (TRUTH,), 0.03, _true_com),
    Mark(
        "/world/com/estimate",
        (ESTIMATE,),
        0.025,
        lambda block: _believed(block, "position_com_in_world"),
    ),
    Mark(
        "/world/cop/ideal",
        (IDEAL,),
        0.008,
        lambda block: _believed_cop(block, "ideal_cop"),
    ),
    Mark(
        "/world/cop/commanded",
        (COMMANDED,),
        0.007,
        lambda block: _believed_cop(block, "commanded_cop"),
    ),
    Mark(
        "/world/cop/measured",
        (MEASURED,),
        0.006,
        lambda block: _believed_cop(block, "cop_in_world"),
    ),
    Mark("/world/cop/actual", (ACTUAL,), 0.007, _actual_cop),
    Mark(
        "/world/targets/com",
        (IDEAL,),
        0.006,
        lambda block: _believed(block, "target_com"),
    ),
    Mark(
        "/world/targets/soles",
        (LEFT, RIGHT),
        0.006,
        lambda block: _believed(block, "target_soles"),
    ),
)
