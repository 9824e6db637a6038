"""Where pushes act, for the 3-D view."""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim.recording.block import Block
from ballsim_controllers.messages import Array

__all__ = ["compute_push_arrows"]


def compute_push_arrows(
    block: Block, scratch: mujoco.MjData
) -> tuple[Array, Array, npt.NDArray[np.int_]]:
    """Return the pushes at the drawn rows of a block that has wrenches.

    Args:
        block: The rows.
        scratch: Data to compute in; changed.

    Returns:
        Points above the CoM of the pushed bodies, shape (n, 3), [m]; forces,
        shape (n, 3), [N]; number of pushed bodies at each of them.
    """
    series, rows = block.series, block.slow_rows
    assert series.wrenches is not None
    wrenches = series.wrenches[rows]
    index, bodies = np.nonzero(wrenches[..., :3].any(axis=-1))
    forces, torques = np.split(wrenches[index, bodies], 2, axis=-1)
    points = np.empty((len(index), 3))
    for i, (row, body) in enumerate(zip(rows[index], bodies, strict=True)):
        scratch.qpos[:] = series.qpos[row]
        mujoco.mj_kinematics(block.context.model, scratch)
        points[i] = scratch.xipos[body]
    # The point that a horizontal force acts on, from its moment about the CoM.
    squares = (forces**2).sum(axis=-1)
    points[:, 2] += (forces[:, 0] * torques[:, 1] - forces[:, 1] * torques[:, 0]) / (
        squares
    )
    return points, forces, np.bincount(index, minlength=len(rows))
