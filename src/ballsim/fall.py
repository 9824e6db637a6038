"""When the robot has fallen."""

from __future__ import annotations

import math
from typing import Self

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim.config import SimulationConfig
from ballsim.scene import SceneIds
from ballsim_controllers.messages import Array

__all__ = ["FallDetector"]


class FallDetector:
    """Finds out from the true state whether the robot has fallen.

    It has fallen when its CoM is too low above the ball's top, its trunk leans
    too far, a part other than a sole touches ball or floor, or a sole touches
    the floor. Parts of the robot may touch one another.

    Args:
        model: The compiled scene.
        data: Its live data.
        ids: Its ids.
        config: Thresholds.
        com_height: Height of the CoM above the ball's top at the start, [m].
        ball_radius: Radius of the ball, [m].
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        ids: SceneIds,
        config: SimulationConfig,
        com_height: float,
        ball_radius: float,
    ) -> None:
        """Tabulate which pairs of geoms may not touch."""
        self._model = model
        # Views: MuJoCo writes into them.
        self._quaternion = data.qpos[ids.qpos_trunk][3:]
        self._ball = data.xpos[ids.body_ball]
        self._com = data.subtree_com[ids.body_trunk]
        self._radius = ball_radius
        self._min_height = config.fall_height_ratio * com_height
        self._max_tilt = config.fall_tilt
        self._min_cosine = math.cos(config.fall_tilt)
        others = np.setdiff1d(ids.geoms_robot, ids.geom_soles)
        forbidden = np.zeros((model.ngeom, model.ngeom), dtype=np.bool_)
        forbidden[others, ids.geom_ball] = True
        forbidden[ids.geoms_robot, ids.geom_floor] = True
        self._is_forbidden: list[list[bool]] = (forbidden | forbidden.T).tolist()

    @classmethod
    def of_start(
        cls,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        ids: SceneIds,
        config: SimulationConfig,
        qpos: Array,
    ) -> Self:
        """Return the detector of a run that starts in a state.

        Args:
            model: The compiled scene.
            data: Data whose state is judged.
            ids: Its ids.
            config: Thresholds.
            qpos: State at the start, shape (nq,).
        """
        scratch = mujoco.MjData(model)
        scratch.qpos[:] = qpos
        mujoco.mj_kinematics(model, scratch)
        mujoco.mj_comPos(model, scratch)
        radius = float(model.geom_size[ids.geom_ball, 0])
        top = float(scratch.xpos[ids.body_ball, 2]) + radius
        height = float(scratch.subtree_com[ids.body_trunk, 2]) - top
        return cls(model, data, ids, config, height, radius)

    def find_reason(self, geoms: npt.NDArray[np.int32]) -> str | None:
        """Return why the robot has fallen, or None if it is up, after a step.

        Args:
            geoms: Both geoms of each contact, shape (n, 2).
        """
        for first, second in geoms.tolist():
            if self._is_forbidden[first][second]:
                return f"{self._name(first)} touches {self._name(second)}"
        x, y = self._quaternion.item(1), self._quaternion.item(2)
        if 1.0 - 2.0 * (x * x + y * y) < self._min_cosine:
            return f"the trunk leans more than {self._max_tilt:g} rad"
        height = self._com.item(2) - (self._ball.item(2) + self._radius)
        if height < self._min_height:
            return f"the CoM is less than {self._min_height:.2f} m above the ball"
        return None

    def _name(self, geom: int) -> str:
        name: str = self._model.geom(geom).name
        body: str = self._model.body(int(self._model.geom_bodyid[geom])).name
        return name or body
