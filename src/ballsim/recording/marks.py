"""Points of the 3-D view: CoM, CoP and foot targets, true and as believed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import rerun as rr

from ballsim.recording.block import Block
from ballsim.recording.columns import make_vectors
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
    pale,
)
from ballsim.recording.recorder import RunContext
from ballsim.recording.tracks import time_column
from ballsim_controllers.messages import Array

__all__ = ["MARKS", "Mark", "Marks"]

_POSITIONS = rr.Points3D.descriptor_positions()


@dataclass(frozen=True, slots=True)
class Mark:
    """A few points that move.

    Attributes:
        path: Entity path.
        names: One for each point.
        colours: One for each point.
        radii: One for each point, [m].
        compute: Returns the points in the true world at the slow rows of a
            block, shape (n, n_points, 3), [m].
    """

    path: str
    names: tuple[str, ...]
    colours: tuple[Colour, ...]
    radii: tuple[float, ...]
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


def _landings(block: Block) -> Array:
    """Return the landings of the plan, as far from the ball as they will be then."""
    centre, rows = block.truth.position_ball_in_world, block.slow_rows
    feet = (_on_ball(block, centre, block.telemetry.landings[rows, i]) for i in (0, 1))
    return np.concatenate(list(feet), axis=1)


def _stack(*parts: Callable[[Block], Array]) -> Callable[[Block], Array]:
    return lambda block: np.concatenate([part(block) for part in parts], axis=1)


MARKS = (
    Mark(
        "/world/com",
        ("true", "estimate"),
        (TRUTH, ESTIMATE),
        (0.03, 0.025),
        _stack(_true_com, lambda block: _believed(block, "position_com_in_world")),
    ),
    Mark(
        "/world/cop",
        ("ideal", "commanded", "measured", "actual"),
        (IDEAL, COMMANDED, MEASURED, ACTUAL),
        (0.008, 0.007, 0.006, 0.007),
        _stack(
            lambda block: _believed_cop(block, "ideal_cop"),
            lambda block: _believed_cop(block, "commanded_cop"),
            lambda block: _believed_cop(block, "cop_in_world"),
            _actual_cop,
        ),
    ),
    Mark(
        "/world/targets",
        ("CoM", "left sole", "right sole"),
        (IDEAL, LEFT, RIGHT),
        (0.006, 0.006, 0.006),
        _stack(
            lambda block: _believed(block, "target_com"),
            lambda block: _believed(block, "target_soles"),
        ),
    ),
    Mark(
        "/world/landings",
        ("left foot lands", "right foot lands"),
        (pale(LEFT), pale(RIGHT)),
        (0.01, 0.01),
        _landings,
    ),
)


class Marks:
    """All points."""

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log how they look."""
        for mark in MARKS:
            points = rr.Points3D.from_fields(
                colors=mark.colours,
                radii=mark.radii,
                labels=mark.names,
                show_labels=False,
            )
            stream.log(mark.path, points, static=True)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log where they are at the rows that are drawn."""
        time = time_column(block.slow_time)
        for mark in MARKS:
            points = mark.compute(block)
            column = make_vectors(_POSITIONS, points)
            stream.send_columns(mark.path, time, [column])

    def finish(self, stream: rr.RecordingStream) -> None:
        """Do nothing."""
