"""Shapes of the log: closed, facing outwards, of the right size."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ballsim.recording.meshes import (
    Mesh,
    make_ball_mesh,
    make_body_mesh,
    make_floor_mesh,
)


def _check(mesh: Mesh) -> None:
    """Check that normals are unit vectors on the outer side of each triangle."""
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)
    assert mesh.triangles.max() < len(mesh.vertices)
    assert len(mesh.colours) == len(mesh.vertices) == len(mesh.normals)
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    face = np.cross(b - a, c - a)
    inside = (face * mesh.normals[mesh.triangles].mean(axis=1)).sum(axis=1)
    assert (inside >= -1e-12).all()


def _volume(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return float((a * np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize(
    ("geom", "volume"),
    [
        ('type="box" size="0.1 0.2 0.3"', 8 * 0.1 * 0.2 * 0.3),
        ('type="sphere" size="0.2"', 4 / 3 * np.pi * 0.008),
        ('type="ellipsoid" size="0.1 0.2 0.3"', 4 / 3 * np.pi * 0.006),
        ('type="cylinder" size="0.1 0.3"', np.pi * 0.01 * 0.6),
        (
            'type="capsule" size="0.1 0.3"',
            np.pi * 0.01 * 0.6 + 4 / 3 * np.pi * 0.001,
        ),
        ('type="mesh" mesh="cube"', 0.001),
    ],
)
def test_mesh_of_a_geom(geom: str, volume: float) -> None:
    """The mesh is closed, faces outwards and has the geom's volume and place."""
    corners = " ".join(
        f"{x} {y} {z}" for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1)
    )
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><asset><mesh name="cube" vertex="{corners}"/></asset><worldbody>
        <body><geom {geom} group="2" pos="1 0 0" euler="30 40 50" rgba="1 0 0 1"/>
        <geom size="1" group="3"/></body></worldbody></mujoco>"""
    )
    mesh = make_body_mesh(model, 1, group=2)
    assert mesh is not None
    _check(mesh)
    assert _volume(mesh) == pytest.approx(volume, rel=0.04)
    assert mesh.vertices.mean(axis=0) == pytest.approx(model.geom_pos[0], abs=0.02)
    assert (mesh.colours == [255, 0, 0, 255]).all()
    assert make_body_mesh(model, 1, group=1) is None


def test_ball_and_floor_meshes() -> None:
    """The ball has two tones in eight equal octants; the floor faces upwards."""
    ball = make_ball_mesh(0.5)
    _check(ball)
    assert _volume(ball) == pytest.approx(4 / 3 * np.pi * 0.125, rel=0.02)
    tones, counts = np.unique(ball.colours, axis=0, return_counts=True)
    assert len(tones) == 2
    assert counts[0] == counts[1]
    floor = make_floor_mesh()
    _check(floor)
    assert len(np.unique(floor.colours, axis=0)) == 2
