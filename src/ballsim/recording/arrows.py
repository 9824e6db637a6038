"""Forces of the 3-D view: contacts and pushes."""

from __future__ import annotations

import mujoco
import numpy as np
import rerun as rr

from ballsim.recording.block import Block
from ballsim.recording.columns import make_vectors
from ballsim.recording.palette import CONTACT, PUSH
from ballsim.recording.push_arrows import compute_push_arrows
from ballsim.recording.recorder import RunContext
from ballsim.recording.tracks import time_column

__all__ = ["ContactArrows", "PushArrows"]

_FORCE_SCALE = 1.2e-3  # length of an arrow for each newton, [m/N]
_PUSH_SCALE = 5e-3  # the same for pushes, which are weaker, [m/N]

_ORIGINS = rr.Arrows3D.descriptor_origins()
_VECTORS = rr.Arrows3D.descriptor_vectors()


class ContactArrows:
    """The contact forces, as arrows."""

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log how they look."""
        arrows = rr.Arrows3D.from_fields(colors=[CONTACT], radii=[0.012])
        stream.log("/world/contacts", arrows, static=True)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log the contact forces at the rows that are drawn."""
        contacts, ids = block.series.contacts, block.context.ids
        n_ticks, drawn = block.series.n_ticks, block.slow_rows
        rows = np.repeat(np.arange(n_ticks), contacts.counts[:n_ticks])
        is_drawn = np.zeros(n_ticks, np.bool_)
        is_drawn[drawn] = True
        is_shown = is_drawn[rows]
        geoms = contacts.geoms[is_shown]
        forces = contacts.compute_forces()[is_shown]
        # Show the force on the robot; below the ball, that on the ball.
        is_flipped = np.where(
            (geoms == ids.geom_floor).any(axis=1),
            geoms[:, 0] == ids.geom_ball,
            geoms[:, 1] == ids.geom_ball,
        )
        forces[is_flipped] *= -1.0
        counts = contacts.counts[drawn]
        columns = [
            make_vectors(_ORIGINS, contacts.positions[is_shown], counts),
            make_vectors(_VECTORS, _FORCE_SCALE * forces, counts),
        ]
        stream.send_columns("/world/contacts", time_column(block.slow_time), columns)

    def finish(self, stream: rr.RecordingStream) -> None:
        """Do nothing."""


class PushArrows:
    """The pushes, as arrows that end where they act."""

    def __init__(self) -> None:
        """Prepare to start."""
        self._scratch: mujoco.MjData | None = None
        self._is_styled = False
        self._n_shown = 0  # arrows that are there after the last block

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Make room to compute in."""
        self._scratch = mujoco.MjData(context.model)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log the pushes at the rows that are drawn, and where they are over."""
        if block.series.wrenches is None:
            return
        assert self._scratch is not None
        if not self._is_styled:
            arrows = rr.Arrows3D.from_fields(colors=[PUSH], radii=[0.015])
            stream.log("/world/pushes", arrows, static=True)
            self._is_styled = True
        points, forces, counts = compute_push_arrows(block, self._scratch)
        before = np.concatenate([[self._n_shown], counts[:-1]])
        is_new = (counts > 0) | (before > 0)
        self._n_shown = int(counts[-1])
        if not is_new.any():
            return
        vectors, counts = _PUSH_SCALE * forces, counts[is_new]
        columns = [
            make_vectors(_ORIGINS, points - vectors, counts),
            make_vectors(_VECTORS, vectors, counts),
        ]
        time = time_column(block.slow_time[is_new])
        stream.send_columns("/world/pushes", time, columns)

    def finish(self, stream: rr.RecordingStream) -> None:
        """Do nothing."""
