"""Triangle meshes of MuJoCo's geoms, for the log's 3-D view."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim_controllers.messages import Array

__all__ = ["Mesh", "make_ball_mesh", "make_body_mesh", "make_floor_mesh"]

_N_AROUND = 28  # segments around the axis of a round geom
_N_ARC = 7  # segments of a quarter circle
_CREASE_COSINE = 0.6  # edges steeper than 53 degrees stay sharp
_MAX_SMOOTH_FACES = 1000  # larger meshes are drawn faceted, to save memory
_N_BALL = 48  # segments around the ball
_BALL_COLOURS = ((219, 69, 41), (247, 214, 140))  # the tones of models/ball.xml
_FLOOR_COLOURS = ((92, 107, 122), (110, 125, 140))
_SQUARE = 0.5  # width of the floor's squares, [m]
_N_SQUARES = 40  # squares along each side of the floor

Colours = npt.NDArray[np.uint8]
Triangles = npt.NDArray[np.uint32]
Surface = tuple[Array, Array, Triangles]  # vertices, normals, triangles


@dataclass(frozen=True, slots=True)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: Shape (n, 3), [m].
        normals: Unit normals, outwards, shape (n, 3).
        triangles: Indices of the corners, counter-clockwise, shape (m, 3).
        colours: RGBA of each vertex, shape (n, 4).
    """

    vertices: Array
    normals: Array
    triangles: Triangles
    colours: Colours


def make_body_mesh(model: mujoco.MjModel, body: int, group: int) -> Mesh | None:
    """Merge the geoms of a body into one mesh in the body's frame.

    Args:
        model: The compiled scene.
        body: Id of the body.
        group: Group of the geoms that are shown.

    Returns:
        The mesh, or None if the body has no such geom.
    """
    parts = []
    for geom in range(model.ngeom):
        if model.geom_bodyid[geom] != body or model.geom_group[geom] != group:
            continue
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            surface = _copy_mesh(model, int(model.geom_dataid[geom]))
        else:
            kind = int(model.geom_type[geom])
            surface = _make_surface(kind, model.geom_size[geom])
        vertices, normals, triangles = surface
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, model.geom_quat[geom])
        rotation = matrix.reshape(3, 3)
        colours = np.tile(_geom_colour(model, geom), (len(vertices), 1))
        points = vertices @ rotation.T + model.geom_pos[geom]
        parts.append(Mesh(points, normals @ rotation.T, triangles, colours))
    return _merge(parts) if parts else None


def make_ball_mesh(radius: float) -> Mesh:
    """Return a sphere whose eight octants have two tones in turn.

    Args:
        radius: Radius, [m].
    """
    profile = _arc(0.0, np.pi / 2, _N_BALL // 4), _arc(np.pi / 2, np.pi, _N_BALL // 4)
    outline = np.concatenate([profile[0], profile[1][1:]])
    vertices, normals, triangles = _revolve(outline, outline, _N_BALL)
    # Each triangle gets its own corners, so that the tones do not blend.
    corners = vertices[triangles.ravel()]
    centroids = vertices[triangles].mean(axis=1)
    is_first = (centroids > 0.0).sum(axis=1) % 2 == 0
    tones = np.where(is_first[:, None], *(np.array(c) for c in _BALL_COLOURS))
    return Mesh(
        vertices=radius * corners,
        normals=normals[triangles.ravel()],
        triangles=np.arange(len(corners), dtype=np.uint32).reshape(-1, 3),
        colours=_opaque(np.repeat(tones, 3, axis=0)),
    )


def make_floor_mesh() -> Mesh:
    """Return a checkered square of floor about the origin."""
    n = _N_SQUARES
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n)))
    corner = _SQUARE * (np.stack([i, j], axis=1) - n / 2)
    steps = _SQUARE * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    flat = (corner[:, None] + steps).reshape(-1, 2)
    first = 4 * np.arange(n * n, dtype=np.uint32)[:, None]
    halves = [first + np.array(corners) for corners in ((0, 1, 2), (0, 2, 3))]
    triangles = np.concatenate(halves)
    is_first = ((i + j) % 2 == 0)[:, None]
    tones = np.where(is_first, *(np.array(c) for c in _FLOOR_COLOURS))
    return Mesh(
        vertices=np.column_stack([flat, np.zeros(len(flat))]),
        normals=np.tile([0.0, 0.0, 1.0], (len(flat), 1)),
        triangles=triangles.astype(np.uint32),
        colours=_opaque(np.repeat(tones, 4, axis=0)),
    )


def _copy_mesh(model: mujoco.MjModel, mesh: int) -> Surface:
    """Return a mesh of the model, smooth but for its sharp edges.

    Each triangle has its own corners. The normal of a corner is the mean, by
    area, over the triangles that share the corner and are not too steep to its own.
    """
    first, n = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    faces = model.mesh_face[first : first + n] + model.mesh_vertadr[mesh]
    vertices = model.mesh_vert[faces].astype(np.float64)  # (n, 3 corners, 3)
    a, b, c = np.moveaxis(vertices, 1, 0)
    area_normals = np.cross(b - a, c - a)
    normals = _unit(area_normals)
    corner_normals = np.repeat(normals, 3, axis=0)
    if n <= _MAX_SMOOTH_FACES:
        shares = (faces[:, :, None, None] == faces[None, None]).any(axis=3)
        is_gentle = normals @ normals.T > _CREASE_COSINE
        weights = (shares & is_gentle[:, None]).reshape(3 * n, n)
        corner_normals = _unit(weights @ area_normals)
    triangles = np.arange(3 * n, dtype=np.uint32).reshape(-1, 3)
    return vertices.reshape(-1, 3), corner_normals, triangles


def _unit(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: Array = vectors / np.maximum(lengths, 1e-12)
    return unit


def _make_surface(kind: int, size: Array) -> Surface:
    """Return a primitive geom in its own frame; nothing for a plane."""
    types = mujoco.mjtGeom
    if kind == types.mjGEOM_BOX:
        return _make_box(size)
    if kind in (types.mjGEOM_SPHERE, types.mjGEOM_ELLIPSOID):
        radii = np.full(3, size[0]) if kind == types.mjGEOM_SPHERE else size
        outline = _arc(0.0, np.pi, 2 * _N_ARC)
        vertices, normals, triangles = _revolve(outline, outline, _N_AROUND)
        normals = normals / radii
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return vertices * radii, normals, triangles
    radius, half = float(size[0]), float(size[1])
    if kind == types.mjGEOM_CAPSULE:
        top, bottom = _arc(0.0, np.pi / 2, _N_ARC), _arc(np.pi / 2, np.pi, _N_ARC)
        outline = np.concatenate(
            [radius * top + [0.0, half], radius * bottom - [0.0, half]]
        )
        return _revolve(outline, np.concatenate([top, bottom]), _N_AROUND)
    if kind == types.mjGEOM_CYLINDER:
        up, out, down = [0.0, 1.0], [1.0, 0.0], [0.0, -1.0]
        corners = [[0.0, half], [radius, half], [radius, -half], [0.0, -half]]
        outline = np.repeat(np.array(corners), [1, 2, 2, 1], axis=0)
        directions = np.array([up, up, out, out, down, down])
        return _revolve(outline, directions, _N_AROUND)
    return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint32)


def _arc(start: float, stop: float, n: int) -> Array:
    """Return points (distance from axis, height) of a unit arc from the pole."""
    angles = np.linspace(start, stop, n + 1)
    return np.column_stack([np.sin(angles), np.cos(angles)])


def _revolve(outline: Array, directions: Array, n_around: int) -> Surface:
    """Turn an outline about z, from its top to its bottom."""
    angles = np.linspace(0.0, 2.0 * np.pi, n_around + 1)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])

    def sweep(profile: Array) -> Array:
        flat = profile[:, None, :1] * circle
        height = np.broadcast_to(profile[:, None, 1:], (*flat.shape[:2], 1))
        return np.concatenate([flat, height], axis=2).reshape(-1, 3)

    row, column = (
        index.ravel()
        for index in np.meshgrid(
            np.arange(len(outline) - 1), np.arange(n_around), indexing="ij"
        )
    )
    a = row * (n_around + 1) + column
    b = a + n_around + 1
    triangles = np.concatenate(
        [np.column_stack([a, b, b + 1]), np.column_stack([a, b + 1, a + 1])]
    )
    return sweep(outline), sweep(directions), triangles.astype(np.uint32)


def _make_box(half: Array) -> Surface:
    vertices: list[Array] = []
    normals: list[Array] = []
    triangles: list[list[int]] = []
    for axis in range(3):
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        for sign in (1.0, -1.0):
            normal = sign * np.eye(3)[axis]
            first = len(vertices)
            turn = sign * v  # keeps the corners counter-clockwise from outside
            for a, b in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)):
                vertices.append((normal + a * u + b * turn) * half)
                normals.append(normal)
            triangles += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    return np.array(vertices), np.array(normals), np.array(triangles, dtype=np.uint32)


def _merge(parts: list[Mesh]) -> Mesh:
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    triangles = [p.triangles + np.uint32(s) for p, s in zip(parts, starts, strict=True)]
    return Mesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        triangles=np.concatenate(triangles),
        colours=np.concatenate([part.colours for part in parts]),
    )


def _geom_colour(model: mujoco.MjModel, geom: int) -> Colours:
    material = int(model.geom_matid[geom])
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    return np.asarray(np.round(255.0 * np.asarray(rgba)), dtype=np.uint8)


def _opaque(rgb: npt.NDArray[np.int_]) -> Colours:
    alpha = np.full((len(rgb), 1), 255)
    return np.concatenate([rgb, alpha], axis=1).astype(np.uint8)
