"""The true course of a run, computed after it, for metrics and logs only.

Nothing here is ever shown to a controller.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import mujoco
import numpy as np

from ballsim.scene import SceneIds
from ballsim.series import RunSeries
from ballsim.world_frame import RobotWorld
from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Array, IntArray
from ballsim_controllers.native import call_2, find_function

__all__ = ["ContactTruth", "StateTruth", "compute_contact_truth", "compute_state_truth"]


@dataclass(frozen=True, slots=True)
class StateTruth:
    """True states in the robot's world, one row per instant.

    Attributes:
        quaternion_trunk_to_world: Attitude (w, x, y, z), shape (n, 4).
        angular_velocity_trunk_in_trunk: Shape (n, 3), [rad/s].
        position_com_in_world: Robot's centre of mass, shape (n, 3), [m].
        linear_velocity_com_in_world: Shape (n, 3), [m/s].
        position_ball_in_world: Ball's centre, shape (n, 3), [m].
        linear_velocity_ball_in_world: Shape (n, 3), [m/s].
        angular_velocity_ball_in_world: Shape (n, 3), [rad/s].
        position_soles_in_world: Sole centres, left first, shape (n, 2, 3), [m].
    """

    quaternion_trunk_to_world: Array
    angular_velocity_trunk_in_trunk: Array
    position_com_in_world: Array
    linear_velocity_com_in_world: Array
    position_ball_in_world: Array
    linear_velocity_ball_in_world: Array
    angular_velocity_ball_in_world: Array
    position_soles_in_world: Array


@dataclass(frozen=True, slots=True)
class ContactTruth:
    """True contact of the feet with the ball in the robot's world, per tick.

    Attributes:
        normal_forces: On each foot, left first, shape (n, 2), [N].
        cop_to_ball_in_world: CoP relative to the ball's centre: mean of the
            contact points weighted by their normal forces, shape (n, 2), [m];
            NaN without contact.
    """

    normal_forces: Array
    cop_to_ball_in_world: Array


def compute_state_truth(
    model: mujoco.MjModel,
    ids: SceneIds,
    world: RobotWorld,
    qpos: Array,
    qvel: Array,
    scratch: mujoco.MjData | None = None,
) -> StateTruth:
    """Compute the true states of a robot and its ball.

    Args:
        model: The compiled scene.
        ids: Its ids.
        world: The robot's world.
        qpos: States in the true world, shape (n, nq).
        qvel: Velocities, shape (n, nv).
        scratch: Data to compute in, if there are some; changed.
    """
    data = mujoco.MjData(model) if scratch is None else scratch
    com, com_velocity = np.empty((len(qpos), 3)), np.empty((len(qpos), 3))
    soles = np.empty((len(qpos), 2, 3))
    _compute_motion(
        np.array([model._address, data._address, *_find_functions()]),
        (data.qpos, data.qvel),
        (data.subtree_com[ids.body_trunk], data.subtree_linvel[ids.body_trunk]),
        tuple(data.site_xpos[site] for site in ids.site_soles),
        (np.ascontiguousarray(qpos), np.ascontiguousarray(qvel)),
        (com, com_velocity, soles),
    )
    trunk_attitude = qpos[:, ids.qpos_trunk][:, 3:]
    ball, ball_velocity = qpos[:, ids.qpos_ball], qvel[:, ids.qvel_ball]
    ball_rotations = _rotation_matrices(ball[:, 3:])
    ball_spin = np.einsum("nij,nj->ni", ball_rotations, ball_velocity[:, 3:])
    return StateTruth(
        quaternion_trunk_to_world=world.rotate_quaternions_to_robot(trunk_attitude),
        angular_velocity_trunk_in_trunk=np.array(qvel[:, ids.qvel_trunk][:, 3:]),
        position_com_in_world=world.transform_points_to_robot(com),
        linear_velocity_com_in_world=world.rotate_vectors_to_robot(com_velocity),
        position_ball_in_world=world.transform_points_to_robot(ball[:, :3]),
        linear_velocity_ball_in_world=world.rotate_vectors_to_robot(
            ball_velocity[:, :3]
        ),
        angular_velocity_ball_in_world=world.rotate_vectors_to_robot(ball_spin),
        position_soles_in_world=world.transform_points_to_robot(soles),
    )


@functools.cache
def _find_functions() -> tuple[int, ...]:
    names = ("mj_kinematics", "mj_comPos", "mj_comVel", "mj_subtreeVel")
    return tuple(map(find_function, names))


@compiled
def _compute_motion(
    addresses: IntArray,
    state: tuple[Array, Array],
    centre: tuple[Array, Array],
    sites: tuple[Array, Array],
    given: tuple[Array, Array],
    found: tuple[Array, Array, Array],
) -> None:
    """Compute the motion of the robot's CoM and the places of its soles.

    Args:
        addresses: Of model, data, and the functions that are called, in order.
        state: ``qpos`` and ``qvel`` of the data.
        centre: Place and velocity of the robot's CoM in the data.
        sites: Places of both soles in the data.
        given: States, shape (n, nq), and velocities, shape (n, nv).
        found: What is written: places of the CoM, shape (n, 3), its velocities, and
            places of the soles, shape (n, 2, 3).
    """
    for row in range(given[0].shape[0]):
        state[0][:] = given[0][row]
        state[1][:] = given[1][row]
        for function in addresses[2:]:
            call_2(function, addresses[0], addresses[1])
        found[0][row] = centre[0]
        found[1][row] = centre[1]
        found[2][row, 0] = sites[0]
        found[2][row, 1] = sites[1]


def compute_contact_truth(
    ids: SceneIds, world: RobotWorld, series: RunSeries
) -> ContactTruth:
    """Compute the true contact of the feet from the contacts of a run.

    Args:
        ids: Ids of the scene.
        world: The robot's world.
        series: Time series of the run, or a block of them.
    """
    n, contacts = series.n_ticks, series.contacts
    tick = np.repeat(np.arange(n), contacts.counts[:n])
    geoms, forces = contacts.geoms, contacts.normal_forces
    is_on_ball = (geoms == ids.geom_ball).any(axis=1)
    by_foot = [(geoms == sole).any(axis=1) & is_on_ball for sole in ids.geom_soles]
    normal_forces = np.stack(
        [np.bincount(tick, np.where(is_foot, forces, 0.0), n) for is_foot in by_foot],
        axis=1,
    ).astype(np.float64)
    weights = np.where(by_foot[0] | by_foot[1], forces, 0.0)
    points = contacts.positions - series.ball_positions[tick]
    points = world.rotate_vectors_to_robot(points)
    total = normal_forces.sum(axis=1)
    moments = [np.bincount(tick, weights * points[:, axis], n) for axis in (0, 1)]
    with np.errstate(invalid="ignore", divide="ignore"):
        cop = np.stack(moments, axis=1) / total[:, None]
    cop[total <= 0.0] = np.nan
    return ContactTruth(normal_forces, cop)


def _rotation_matrices(quaternions: Array) -> Array:
    """Return the matrices of quaternions (w, x, y, z), shape (n, 3, 3)."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
