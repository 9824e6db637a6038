"""The robot's world beside the true one.

The robot's world has its origin under the ball's centre at the start and its x
axis along the robot's heading at the start. The robot knows no other world.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ballsim.scene import SceneIds
from ballsim_controllers.messages import Array

__all__ = ["RobotWorld"]


@dataclass(frozen=True, slots=True)
class RobotWorld:
    """Where the robot's world is in the true world.

    Attributes:
        origin: Its origin, shape (3,), [m].
        yaw: Angle from the true x axis to its own, about z, [rad].
    """

    origin: Array
    yaw: float

    @classmethod
    def from_start(cls, qpos: Array, ids: SceneIds) -> RobotWorld:
        """Return the robot's world of a run that starts in a state.

        Args:
            qpos: State at the start.
            ids: Ids of the scene.
        """
        x, y = qpos[ids.qpos_ball.start : ids.qpos_ball.start + 2]
        w, i, j, k = qpos[ids.qpos_trunk.start + 3 : ids.qpos_trunk.stop]
        forward = (1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j + w * k))
        yaw = math.atan2(forward[1], forward[0])
        return cls(np.array([x, y, 0.0]), yaw)

    @property
    def rotation_robot_to_true(self) -> Array:
        """Return the matrix that maps robot-world to true-world coordinates."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    @property
    def quaternion_robot_to_true(self) -> Array:
        """Return the same rotation as a quaternion (w, x, y, z)."""
        half = self.yaw / 2.0
        return np.array([math.cos(half), 0.0, 0.0, math.sin(half)])

    def transform_points_to_robot(self, points: Array) -> Array:
        """Map points, shape (..., 3), [m], from the true to the robot's world."""
        return (points - self.origin) @ self.rotation_robot_to_true

    def transform_points_to_true(self, points: Array) -> Array:
        """Map points, shape (..., 3), [m], from the robot's to the true world."""
        return points @ self.rotation_robot_to_true.T + self.origin

    def rotate_vectors_to_robot(self, vectors: Array) -> Array:
        """Map vectors, shape (..., 3), from the true to the robot's world."""
        return vectors @ self.rotation_robot_to_true

    def rotate_quaternions_to_robot(self, quaternions: Array) -> Array:
        """Map attitudes (w, x, y, z), shape (..., 4), to the robot's world."""
        w, z = self.quaternion_robot_to_true[[0, 3]]
        a, b, c, d = np.moveaxis(quaternions, -1, 0)
        # Product of the conjugate (w, 0, 0, -z) with (a, b, c, d).
        product = [w * a + z * d, w * b + z * c, w * c - z * b, w * d - z * a]
        return np.stack(product, axis=-1)
