"""Footsteps on the ball: where a foot was to land, and where it did."""

from __future__ import annotations

import math
from collections import deque

import mujoco
import numpy as np
import rerun as rr

from ballsim.recording.block import Block
from ballsim.recording.columns import make_strips, make_vectors
from ballsim.recording.palette import LEFT, RIGHT, Colour, pale
from ballsim.recording.recorder import RunContext
from ballsim.recording.soles import find_sole_corners
from ballsim.recording.tracks import time_column
from ballsim_controllers.messages import Array, GaitPhase

__all__ = ["Footprints"]

_SIDES = ("left", "right")
_COLOURS: tuple[Colour, Colour] = (LEFT, RIGHT)
_N_SHOWN = 5  # of each foot
_LANDING = {int(GaitPhase.LEFT_SUPPORT): 1, int(GaitPhase.RIGHT_SUPPORT): 0}
_STRIPS = rr.LineStrips3D.descriptor_strips()
_POSITIONS = rr.Points3D.descriptor_positions()


class Footprints:
    """The last footprints of each foot; they roll with the ball."""

    def __init__(self) -> None:
        """Begin with a clean ball."""
        self._phase = -1
        self._actual = [deque[Array](maxlen=_N_SHOWN) for _ in _SIDES]
        self._planned = [deque[Array](maxlen=_N_SHOWN) for _ in _SIDES]
        self._landings = np.full((2, 2), np.nan)  # of the tick before the block
        self._corners: list[Array] = []
        self._scratch: mujoco.MjData | None = None

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log how they look."""
        model, ids = context.model, context.ids
        self._scratch = mujoco.MjData(model)
        self._corners = [find_sole_corners(model, int(g)) for g in ids.geom_soles]
        for side, colour in zip(_SIDES, _COLOURS, strict=True):
            outline = rr.LineStrips3D.from_fields(colors=[colour], radii=[0.002])
            stream.log(_path(side, "actual"), outline, static=True)
            point = rr.Points3D.from_fields(colors=[pale(colour)], radii=[0.006])
            stream.log(_path(side, "planned"), point, static=True)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log the touchdowns of a block."""
        phases = block.telemetry.phase
        before = np.concatenate([[self._phase], phases[:-1]])
        self._phase = int(phases[-1])
        plans = np.concatenate([self._landings[None], block.telemetry.landings])
        self._landings = plans[-1]
        rows = np.flatnonzero(phases != before).tolist()
        for foot, side in enumerate(_SIDES):
            landings = [row for row in rows if _LANDING.get(int(before[row])) == foot]
            if not landings:
                continue
            actual: list[list[Array]] = []
            planned: list[list[Array]] = []
            for row in landings:
                self._step(block, row, foot, plans[row, foot])
                actual.append(list(self._actual[foot]))
                planned.append(list(self._planned[foot]))
            time = time_column(block.time[landings])
            counts = np.array([len(strips) for strips in actual])
            flat = [strip for strips in actual for strip in strips]
            column = make_strips(_STRIPS, flat, counts)
            stream.send_columns(_path(side, "actual"), time, [column])
            counts = np.array([len(points) for points in planned])
            flat = [point for points in planned for point in points]
            points = np.array(flat).reshape(-1, 3)
            column = make_vectors(_POSITIONS, points, counts)
            stream.send_columns(_path(side, "planned"), time, [column])

    def finish(self, stream: rr.RecordingStream) -> None:
        """Do nothing."""

    def _step(self, block: Block, row: int, foot: int, plan: Array) -> None:
        """Take down the footprint of a foot that lands, in the frame of the ball.

        Args:
            block: The rows.
            row: Where it lands.
            foot: Which foot.
            plan: Where it was to land, from the ball's centre, shape (2,), [m]; NaN
                where the controller does not tell.
        """
        data, context = self._scratch, block.context
        assert data is not None
        data.qpos[:] = block.series.qpos[row]
        mujoco.mj_kinematics(context.model, data)
        ball, body = context.ids.body_ball, int(context.ids.body_feet[foot])
        turn, place = data.xmat[ball].reshape(3, 3), data.xpos[ball]
        corners = self._corners[foot] @ data.xmat[body].reshape(3, 3).T
        outline = (corners + data.xpos[body] - place) @ turn
        self._actual[foot].append(np.vstack([outline, outline[:1]]))
        if not np.isfinite(plan).all():
            return
        height = math.sqrt(max(context.config.ball.radius**2 - float(plan @ plan), 0.0))
        vector = context.world.rotation_robot_to_true @ [*plan, height]
        self._planned[foot].append(vector @ turn)


def _path(side: str, kind: str) -> str:
    return f"/world/ball/footsteps/{side}/{kind}"
