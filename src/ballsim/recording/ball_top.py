"""The top of the ball, unrolled: support and CoP from above, as in the paper's Fig. 5.

A point of the ball is shown at its arc lengths from the top: forwards is up, left is
left, lengths in [mm].
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import rerun as rr

from ballsim.recording.block import SLOW_PERIOD, Block
from ballsim.recording.columns import make_outlines, make_strips, make_vectors
from ballsim.recording.hull import find_hull
from ballsim.recording.palette import (
    ACTUAL,
    COMMANDED,
    IDEAL,
    LEFT,
    MEASURED,
    RIGHT,
    SUPPORT,
)
from ballsim.recording.paths import TOP_PATH
from ballsim.recording.poses import Poses
from ballsim.recording.recorder import RunContext
from ballsim.recording.tracks import time_column
from ballsim_controllers.messages import Array

__all__ = ["BallTop", "unroll"]

_MIN_LOAD = 20.0  # of a foot that counts as support, [N]
_PERIOD = 2.0 * SLOW_PERIOD  # between two rows, [s]
_GRID, _SPACING = 200.0, 50.0  # half its size, distance of its lines, [mm]
_SIDES = ("left", "right")
_COPS = (
    ("ideal", IDEAL, 5.0),
    ("commanded", COMMANDED, 4.5),
    ("measured", MEASURED, 4.0),
    ("actual", ACTUAL, 3.5),
)
_POSITIONS = rr.Points2D.descriptor_positions()
_STRIPS = rr.LineStrips2D.descriptor_strips()


def unroll(offsets: Array, radius: float) -> Array:
    """Return where points of a ball are on its unrolled top, as it is shown.

    Args:
        offsets: Forwards and to the left of the ball's centre, shape (..., 2), [m].
        radius: Radius of the ball, [m].

    Returns:
        To the right and downwards in the picture, shape (..., 2), [mm].
    """
    distance = np.linalg.norm(offsets, axis=-1, keepdims=True)
    ratio = np.clip(distance / radius, 0.0, 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        stretch = np.where(ratio > 0.0, np.arcsin(ratio) / ratio, 1.0)
    points: Array = -1e3 * (stretch * offsets)[..., ::-1]
    return points


class BallTop:
    """Soles, landings, support polygon and CoP on the unrolled top of the ball.

    A foot that is to land is shown as far from the ball's centre as it will be then.

    Args:
        poses: Where the soles are; it comes before this in the recorder.
    """

    def __init__(self, poses: Poses) -> None:
        """Remember who knows the soles."""
        self._poses = poses

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log the grid, and how all looks."""
        ticks = np.arange(-_GRID, _GRID + 1.0, _SPACING)
        lines = [[(x, -_GRID), (x, _GRID)] for x in ticks]
        lines += [[(-_GRID, y), (_GRID, y)] for y in ticks]
        grid = rr.LineStrips2D(lines, colors=[(70, 76, 84)], radii=[-0.5])
        stream.log(f"{TOP_PATH}/grid", grid, static=True)
        strips = rr.LineStrips2D.from_fields(
            colors=[SUPPORT, LEFT, RIGHT],
            radii=[-2.0, -1.0, -1.0],
            labels=["support", "left sole", "right sole"],
            show_labels=False,
        )
        stream.log(f"{TOP_PATH}/soles", strips, static=True)
        for side, colour in zip(_SIDES, (LEFT, RIGHT), strict=True):
            strip = rr.LineStrips2D.from_fields(
                colors=[colour],
                radii=[-0.5],
                labels=[f"{side} foot lands"],
                show_labels=False,
            )
            stream.log(f"{TOP_PATH}/landings/{side}", strip, static=True)
        points = rr.Points2D.from_fields(
            colors=[colour for _, colour, _ in _COPS],
            radii=[-radius for _, _, radius in _COPS],
            labels=[name for name, _, _ in _COPS],
            show_labels=False,
        )
        stream.log(f"{TOP_PATH}/cop", points, static=True)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log every other one of the rows that are drawn."""
        context, first = block.context, block.series.first_tick
        period = context.config.simulation.control_period
        stride = max(1, round(_PERIOD / period))
        is_shown = (block.slow_rows + first) % stride == 0
        rows = block.slow_rows[is_shown]
        radius = context.config.ball.radius
        index = time_column(block.slow_time[is_shown])
        ball = block.truth.position_ball_in_world[is_shown]
        soles = self._poses.sole_corners[is_shown]
        corners = context.world.transform_points_to_robot(soles)
        offsets = corners[..., :2] - ball[:, None, None, :2]
        outlines = unroll(offsets, radius)  # (n, 2, 4, 2)
        is_loaded = block.contact.normal_forces[rows] > _MIN_LOAD
        strips: list[Array] = []
        for left_and_right, loaded in zip(outlines, is_loaded, strict=True):
            strips.append(find_hull(left_and_right[loaded].reshape(-1, 2)))
            strips.extend(np.vstack([sole, sole[:1]]) for sole in left_and_right)
        column = make_strips(_STRIPS, strips, np.full(len(rows), 3))
        stream.send_columns(f"{TOP_PATH}/soles", index, [column])
        column = make_vectors(_POSITIONS, unroll(_find_cops(block, rows), radius))
        stream.send_columns(f"{TOP_PATH}/cop", index, [column])

        middles = offsets.mean(axis=2, keepdims=True)
        planned = offsets - middles + block.telemetry.landings[rows][:, :, None]
        for foot, side in enumerate(_SIDES):
            is_planned = np.isfinite(planned[:, foot]).all(axis=(1, 2))
            outline = unroll(planned[is_planned, foot], radius)
            outline = np.concatenate([outline, outline[:, :1]], axis=1)
            column = make_outlines(_STRIPS, outline, is_planned)
            stream.send_columns(f"{TOP_PATH}/landings/{side}", index, [column])

    def finish(self, stream: rr.RecordingStream) -> None:
        """Do nothing."""


def _find_cops(block: Block, rows: npt.NDArray[np.int_]) -> Array:
    """Return each CoP from the ball's centre, shape (n, 4, 2), [m]."""
    telemetry = block.telemetry
    ball = telemetry.position_ball_in_world[rows, :2]
    wanted = (telemetry.ideal_cop, telemetry.commanded_cop, telemetry.cop_in_world)
    believed = [place[rows] - ball for place in wanted]
    return np.stack([*believed, block.contact.cop_to_ball_in_world[rows]], axis=1)
