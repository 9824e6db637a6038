"""Where everything is that moves in the 3-D view."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt
import rerun as rr

from ballsim.recording.block import Block
from ballsim.recording.columns import make_vectors
from ballsim.recording.meshes import (
    Mesh,
    make_ball_mesh,
    make_body_mesh,
    make_floor_mesh,
)
from ballsim.recording.palette import LEFT, RIGHT
from ballsim.recording.paths import BALL_TOP_PATH, FOCUS_PATH, FOLLOW_PATH
from ballsim.recording.recorder import RunContext
from ballsim.recording.soles import find_sole_corners
from ballsim.recording.tracks import time_column
from ballsim_controllers.messages import Array

__all__ = ["Poses"]

_VISUAL_GROUP = 2
_FOCUS_HEIGHT = 0.7  # of the middle of ball and robot above the ball's centre, [m]
_NOTHING = 1e-12  # below this a component is rounding, which would not compress
_TRANSLATION = rr.Transform3D.descriptor_translation()
_QUATERNION = rr.Transform3D.descriptor_quaternion()

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Part:
    """A body in the tree of the robot, or the ball.

    Attributes:
        body: The body.
        parent: The one that it hangs on, 0 for the world.
        path: Entity path.
        is_turning_only: True if its place on the parent never changes.
    """

    body: int
    parent: int
    path: str
    is_turning_only: bool


class Poses:
    """Floor, ball and robot; a link is below the link that it hangs on.

    Attributes:
        sole_corners: Corners of both soles at the drawn rows of the last block, in
            the true world, shape (n, 2, 4, 3), [m].
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.sole_corners: Array = np.empty((0, 2, 4, 3))
        self._corners: list[Array] = []
        self._parts: list[_Part] = []
        self._scratch: mujoco.MjData | None = None

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log the shapes."""
        model, ids = context.model, context.ids
        self._scratch = mujoco.MjData(model)
        radius = context.config.ball.radius
        stream.log("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log("/world/floor", _to_rerun(make_floor_mesh()), static=True)
        above = rr.Transform3D(translation=[0.0, 0.0, radius])
        stream.log(BALL_TOP_PATH, above, static=True)
        above = rr.Transform3D(translation=[0.0, 0.0, _FOCUS_HEIGHT])
        stream.log(FOCUS_PATH, above, static=True)
        self._parts = _find_parts(model, ids.body_ball)
        for part in self._parts:
            mesh = make_body_mesh(model, part.body, _VISUAL_GROUP)
            if part.body == ids.body_ball:
                mesh = make_ball_mesh(radius)
            if mesh is not None:
                stream.log(part.path, _to_rerun(mesh), static=True)
        paths = {part.body: part.path for part in self._parts}
        for foot, colour in enumerate((LEFT, RIGHT)):
            corners = find_sole_corners(model, int(ids.geom_soles[foot]))
            self._corners.append(corners)
            outline = rr.LineStrips3D(
                [np.vstack([corners, corners[:1]])], colors=[colour], radii=[0.0025]
            )
            body = int(ids.body_feet[foot])
            stream.log(f"{paths[body]}/sole", outline, static=True)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log the pose of everything, and the frame that follows the ball."""
        context, scratch, rows = block.context, self._scratch, block.slow_rows
        assert scratch is not None
        model, n = context.model, len(rows)
        # Rows of one body are contiguous: they are sent without a copy.
        positions = np.empty((model.nbody, n, 3))
        quaternions = np.empty((model.nbody, n, 4))
        feet = context.ids.body_feet.tolist()
        self.sole_corners = np.empty((n, 2, 4, 3))
        for i, row in enumerate(rows.tolist()):
            scratch.qpos[:] = block.series.qpos[row]
            mujoco.mj_kinematics(model, scratch)
            positions[:, i], quaternions[:, i] = scratch.xpos, scratch.xquat
            for foot, body in enumerate(feet):
                turned = self._corners[foot] @ scratch.xmat[body].reshape(3, 3).T
                self.sole_corners[i, foot] = turned + scratch.xpos[body]
        time = time_column(block.slow_time)
        for part in self._parts:
            turn = _turn_between(quaternions[part.parent], quaternions[part.body])
            if part.is_turning_only:  # the same bits each time: they compress
                places = np.tile(model.body_pos[part.body], (n, 1))
            else:
                places = positions[part.body] - positions[part.parent]
                if part.parent != 0:
                    places = _rotate_back(quaternions[part.parent], places)
            columns = [
                make_vectors(_TRANSLATION, places[:, None]),
                make_vectors(_QUATERNION, np.roll(turn, -1, axis=-1)[:, None]),
            ]
            stream.send_columns(part.path, time, columns)
        focus = make_vectors(_TRANSLATION, positions[context.ids.body_ball, :, None])
        stream.send_columns(FOLLOW_PATH, time, [focus])

    def finish(self, stream: rr.RecordingStream) -> None:
        """Do nothing."""


def _find_parts(model: mujoco.MjModel, ball: int) -> list[_Part]:
    """Return all bodies, a parent before its children."""
    paths, parts = {0: "/world/robot"}, []
    for body in range(1, model.nbody):
        parent, name = int(model.body_parentid[body]), model.body(body).name
        paths[body] = "/world/ball" if body == ball else f"{paths[parent]}/{name}"
        first = int(model.body_jntadr[body])
        joints = slice(first, first + int(model.body_jntnum[body]))
        is_hinged = bool((model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE).all())
        is_turning_only = is_hinged and not model.jnt_pos[joints].any()
        parts.append(_Part(body, parent, paths[body], is_turning_only))
    return parts


def _turn_between(first: Floats, second: Floats) -> Floats:
    """Return the attitude of a frame in another one, (w, x, y, z), shape (n, 4)."""
    w, v = first[:, :1], -first[:, 1:]  # the inverse of the first
    real = w[:, 0] * second[:, 0] - (v * second[:, 1:]).sum(axis=1)
    vector = w * second[:, 1:] + second[:, :1] * v + np.cross(v, second[:, 1:])
    turn: Floats = np.column_stack([real, vector])
    turn[np.abs(turn) < _NOTHING] = 0.0
    return turn


def _rotate_back(attitudes: Floats, vectors: Floats) -> Floats:
    """Return vectors of the world in frames with some attitudes, shape (n, 3)."""
    w, v = attitudes[:, :1], -attitudes[:, 1:]
    twice = 2.0 * np.cross(v, vectors)
    rotated: Floats = vectors + w * twice + np.cross(v, twice)
    return rotated


def _to_rerun(mesh: Mesh) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        triangle_indices=mesh.triangles,
        vertex_colors=mesh.colours,
    )
