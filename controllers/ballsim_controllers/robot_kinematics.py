"""Kinematics and dynamics of the robot for compiled functions.

A record holds all that the compiled functions need of the robot: constants, the
state of the soles, and the addresses of MuJoCo's functions and arrays.
`RobotModel` makes it and keeps what it points to alive.
"""

from __future__ import annotations

import functools

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import cross
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.native import call_2, call_3, call_4, view_1d, view_2d

__all__ = [
    "ARRAYS",
    "FEET",
    "FUNCTIONS",
    "angular_momentum",
    "com_velocity",
    "move_mass",
    "refresh_dynamics",
    "refresh_kinematics",
    "robot_dtype",
]

#: Pose and motion of both soles (left, right): centre in the world, sole to world,
#: velocity of the centre and angular velocity in the world.
FEET = np.dtype(
    [
        ("position", np.float64, (2, 3)),
        ("rotation", np.float64, (2, 3, 3)),
        ("linear_velocity", np.float64, (2, 3)),
        ("angular_velocity", np.float64, (2, 3)),
    ]
)
#: MuJoCo's functions whose addresses are kept.
FUNCTIONS = (
    "mj_kinematics",
    "mj_comPos",
    "mj_comVel",
    "mj_subtreeVel",
    "mj_makeM",
    "mj_fullM",
    "mj_rne",
)
#: MuJoCo's arrays whose addresses are kept.
ARRAYS = (
    "qpos",
    "qvel",
    "xpos",
    "xmat",
    "xipos",
    "site_xpos",
    "site_xmat",
    "cdof",
    "cdof_dot",
    "cvel",
    "subtree_com",
    "subtree_angmom",
)


@functools.cache
def robot_dtype(n_joints: int, n_upper: int) -> np.dtype[np.void]:
    """Return the fields of the robot's record.

    Args:
        n_joints: Actuated joints.
        n_upper: Those of them that are not in the legs.
    """
    integers = ("model", "data", *FUNCTIONS, *ARRAYS)
    return np.dtype(
        [
            *((name, np.int64) for name in integers),
            ("body_mass", np.int64),  # address of the model's array
            ("body_ipos", np.int64),  # address of the model's array
            ("trunk_ipos", np.float64, 3),  # of the model as it was made
            ("has_own_model", np.int64),  # else the trunk's mass must not be moved
            ("mass_matrix", np.int64),  # address, shape (nv, nv)
            ("bias", np.int64),  # address, shape (nv,)
            ("n_bodies", np.int64),
            ("n_sites", np.int64),
            ("nv", np.int64),
            ("trunk_body", np.int64),
            ("foot_bodies", np.int64, 2),
            ("sole_sites", np.int64, 2),
            ("wrench_sites", np.int64, 2),
            ("legs", np.int64, (2, 6)),  # degrees of freedom
            ("upper", np.int64, n_upper),  # degrees of freedom
            ("nominal_upper", np.float64, n_upper),
            ("mass", np.float64),
            ("gravity", np.float64),
            ("kp", np.float64, n_joints),
            ("kv", np.float64, n_joints),
            ("torque_limits", np.float64, n_joints),
            ("feet", FEET),
        ]
    )


@compiled
def refresh_kinematics(robots: Record) -> None:
    """Refresh places and velocities for what stands in ``qpos`` and ``qvel``.

    Args:
        robots: The robot, shape (1,), dtype of `robot_dtype`.
    """
    robot = robots[0]
    model, data = robot["model"], robot["data"]
    call_2(robot["mj_kinematics"], model, data)
    call_2(robot["mj_comPos"], model, data)
    call_2(robot["mj_comVel"], model, data)
    site_xpos = view_2d(robot["site_xpos"], robot["n_sites"], 3)
    site_xmat = view_2d(robot["site_xmat"], robot["n_sites"], 9)
    cvel = view_2d(robot["cvel"], robot["n_bodies"], 6)
    subtree_com = view_2d(robot["subtree_com"], robot["n_bodies"], 3)
    feet = robot["feet"]
    for i in range(2):
        # MuJoCo's cvel is the motion of a body (angular, linear) at the CoM of its
        # tree, the robot's.
        site, body = robot["sole_sites"][i], robot["foot_bodies"][i]
        turning = cross(cvel[body, :3], site_xpos[site] - subtree_com[1])
        for j in range(3):
            feet["position"][i, j] = site_xpos[site, j]
            feet["angular_velocity"][i, j] = cvel[body, j]
            feet["linear_velocity"][i, j] = cvel[body, 3 + j] + turning[j]
            for k in range(3):
                feet["rotation"][i, j, k] = site_xmat[site, 3 * j + k]


@compiled
def move_mass(robots: Record, com_offset: Array) -> None:
    """Move the mass of the trunk, and with it the CoM of the robot.

    Args:
        robots: The robot, shape (1,), dtype of `robot_dtype`; nothing happens if its
            model is not its own.
        com_offset: Of the robot's CoM from where the MJCF has it, forwards and to the
            left in the trunk, shape (2,), [m].
    """
    robot = robots[0]
    if robot["has_own_model"] == 0:
        return
    trunk = robot["trunk_body"]
    places = view_2d(robot["body_ipos"], robot["n_bodies"], 3)
    masses = view_1d(robot["body_mass"], robot["n_bodies"])
    for i in range(2):
        moved = robot["mass"] / masses[trunk] * com_offset[i]
        places[trunk, i] = robot["trunk_ipos"][i] + moved


@compiled
def refresh_dynamics(robots: Record) -> None:
    """Refresh mass matrix and bias forces for the last kinematics.

    Args:
        robots: The robot, shape (1,), dtype of `robot_dtype`.
    """
    robot = robots[0]
    model, data = robot["model"], robot["data"]
    call_2(robot["mj_makeM"], model, data)
    call_3(robot["mj_fullM"], model, data, robot["mass_matrix"])
    call_4(robot["mj_rne"], model, data, 0, robot["bias"])


@compiled
def com_velocity(robots: Record) -> Array:
    """Return the velocity of the CoM for the last kinematics, (3,), [m/s].

    Args:
        robots: The robot, shape (1,), dtype of `robot_dtype`.
    """
    robot = robots[0]
    n = robot["n_bodies"]
    cvel = view_2d(robot["cvel"], n, 6)
    xipos = view_2d(robot["xipos"], n, 3)
    com = view_2d(robot["subtree_com"], n, 3)[1]
    masses = view_1d(robot["body_mass"], n)
    velocity = np.zeros(3)
    for i in range(1, n):
        turning = cross(cvel[i, :3], xipos[i] - com)
        for j in range(3):
            velocity[j] += masses[i] * (cvel[i, 3 + j] + turning[j])
    for j in range(3):
        velocity[j] /= robot["mass"]
    return velocity


@compiled
def angular_momentum(robots: Record) -> Array:
    """Return the angular momentum about the CoM in the world, (3,), [N m s].

    Args:
        robots: The robot, shape (1,), dtype of `robot_dtype`, its kinematics fresh.
    """
    robot = robots[0]
    call_2(robot["mj_subtreeVel"], robot["model"], robot["data"])
    momentum: Array = view_2d(robot["subtree_angmom"], robot["n_bodies"], 3)[1].copy()
    return momentum
