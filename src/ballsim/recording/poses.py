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
        is_fixed: True if its attitude does not change either.
    """

    body: int
    parent: int
    path: str
    is_turning_only: bool
    is_fixed: bool


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
            if part.is_fixed:
                stream.log(part.path, _find_place(model, part.body), static=True)
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
        bodies = [part.body for part in self._parts]
        parents = [part.parent for part in self._parts]
        turns = _turn_between(quaternions[parents], quaternions[bodies])
        places = _rotate_back(
            quaternions[parents], positions[bodies] - positions[parents]
        )
        for part, turn, place in zip(self._parts, turns, places, strict=True):
            if part.is_fixed:
                continue
            if part.is_turning_only:  # the same bits each time: they compress
                place[:] = model.body_pos[part.body]
            columns = [
                make_vectors(_TRANSLATION, place[:, None]),
                make_vectors(_QUATERNION, turn[:, None]),
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
        is_fixed = joints.start == joints.stop
        parts.append(_Part(body, parent, paths[body], is_turning_only, is_fixed))
    return parts


def _find_place(model: mujoco.MjModel, body: int) -> rr.Transform3D:
    """Return where a body is on its parent while no joint is between them."""
    w, x, y, z = model.body_quat[body].tolist()
    turn = rr.Quaternion(xyzw=[x, y, z, w])
    return rr.Transform3D(translation=model.body_pos[body], quaternion=turn)


def _turn_between(first: Floats, second: Floats) -> Floats:
    """Return the attitude of frames in other ones, (x, y, z, w), shape (..., 4).

    Args:
        first: Attitudes of the other frames, (w, x, y, z), shape (..., 4).
        second: Attitudes of the frames, likewise.
    """
    w0, x0, y0, z0 = np.moveaxis(first, -1, 0)
    w, x, y, z = np.moveaxis(second, -1, 0)
    turn: Floats = np.empty(second.shape)
    turn[..., 0] = w0 * x - x0 * w - y0 * z + z0 * y
    turn[..., 1] = w0 * y - y0 * w - z0 * x + x0 * z
    turn[..., 2] = w0 * z - z0 * w - x0 * y + y0 * x
    turn[..., 3] = w0 * w + x0 * x + y0 * y + z0 * z
    turn[np.abs(turn) < _NOTHING] = 0.0
    return turn


def _rotate_back(attitudes: Floats, vectors: Floats) -> Floats:
    """Return vectors of the world in frames with some attitudes, shape (..., 3).

    Args:
        attitudes: (w, x, y, z), shape (..., 4).
        vectors: Shape (..., 3).
    """
    w, x, y, z = np.moveaxis(attitudes, -1, 0)
    a, b, c = np.moveaxis(vectors, -1, 0)
    # v + 2 w (v x q) + 2 (v x q) x q, with q the vector part.
    p, q, r = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    rotated: Floats = np.empty(vectors.shape)
    rotated[..., 0] = a + w * p + q * z - r * y
    rotated[..., 1] = b + w * q + r * x - p * z
    rotated[..., 2] = c + w * r + p * y - q * x
    return rotated


def _to_rerun(mesh: Mesh) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        triangle_indices=mesh.triangles,
        vertex_colors=mesh.colours,
    )
