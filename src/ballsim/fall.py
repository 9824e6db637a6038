"""When the robot has fallen."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim.config import SimulationConfig
from ballsim.scene import SceneIds

__all__ = ["FallDetector"]


class FallDetector:
    """Finds out from the true state whether the robot has fallen.

    It has fallen when its CoM is too low above the ball's top, its trunk leans
    too far, a part other than a sole touches ball or floor, or a sole touches
    the floor. Parts of the robot may touch one another.

    Args:
        model: The compiled scene.
        ids: Its ids.
        config: Thresholds.
        com_height: Height of the CoM above the ball's top at the start, [m].
        ball_radius: Radius of the ball, [m].
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        ids: SceneIds,
        config: SimulationConfig,
        com_height: float,
        ball_radius: float,
    ) -> None:
        """Tabulate which pairs of geoms may not touch."""
        self._model = model
        self._body_trunk, self._body_ball = ids.body_trunk, ids.body_ball
        self._quaternion = ids.qpos_trunk.start + 3
        self._ball_radius = ball_radius
        self._min_height = config.fall_height_ratio * com_height
        self._max_tilt = config.fall_tilt
        self._min_cosine = math.cos(config.fall_tilt)
        others = np.setdiff1d(ids.geoms_robot, ids.geom_soles)
        forbidden = np.zeros((model.ngeom, model.ngeom), dtype=np.bool_)
        forbidden[others, ids.geom_ball] = True
        forbidden[ids.geoms_robot, ids.geom_floor] = True
        self._is_forbidden: npt.NDArray[np.bool_] = forbidden | forbidden.T

    def find_reason(self, data: Any, geoms: npt.NDArray[np.int32]) -> str | None:
        """Return why the robot has fallen, or None if it is up.

        Args:
            data: Live data after a step.
            geoms: Both geoms of each contact, shape (n, 2).
        """
        touching = self._is_forbidden[geoms[:, 0], geoms[:, 1]]
        if touching.any():
            first, second = geoms[int(np.argmax(touching))]
            return f"{self._name(first)} touches {self._name(second)}"
        x, y = data.qpos[self._quaternion + 1 : self._quaternion + 3].tolist()
        cosine = 1.0 - 2.0 * (x * x + y * y)
        if cosine < self._min_cosine:
            return f"the trunk leans more than {self._max_tilt:g} rad"
        top = data.xpos[self._body_ball, 2] + self._ball_radius
        height = float(data.subtree_com[self._body_trunk, 2] - top)
        if height < self._min_height:
            return f"the CoM is less than {self._min_height:.2f} m above the ball"
        return None

    def _name(self, geom: int) -> str:
        name: str = self._model.geom(int(geom)).name
        body: str = self._model.body(int(self._model.geom_bodyid[geom])).name
        return name or body
