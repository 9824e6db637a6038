"""The soles: where their corners are."""

from __future__ import annotations

import mujoco
import numpy as np

from ballsim_controllers.messages import Array

__all__ = ["find_sole_corners"]


def find_sole_corners(model: mujoco.MjModel, geom: int) -> Array:
    """Return the corners of a sole's underside in the frame of its foot.

    Args:
        model: The compiled scene.
        geom: The sole's box.

    Returns:
        Shape (4, 3), one after the other around the sole, [m].
    """
    x, y, z = model.geom_size[geom]
    corners = np.array([[x, y, -z], [-x, y, -z], [-x, -y, -z], [x, -y, -z]])
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, model.geom_quat[geom])
    points: Array = corners @ matrix.reshape(3, 3).T + model.geom_pos[geom]
    return points
