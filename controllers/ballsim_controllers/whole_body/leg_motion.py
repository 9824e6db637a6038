"""Accelerations of the joints as an affine function of the base's."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import cross, solve_linear
from ballsim_controllers.messages import Array, IntArray, Record
from ballsim_controllers.native import view_1d, view_2d

__all__ = ["N_BASE", "foot_bias_acceleration", "foot_jacobian", "solve_legs"]

#: Degrees of freedom of the base, the first of the generalised velocity.
N_BASE = 6


@compiled
def foot_jacobian(
    jacobian: Array, point: Array, leg: IntArray, cdof: Array, com: Array
) -> None:
    """Write the Jacobian of a point that is fixed in a foot.

    Args:
        jacobian: Linear over angular velocity in the world, by the base's and then
            the leg's degrees of freedom, shape (6, 12).
        point: The point in the world, shape (3,), [m].
        leg: Degrees of freedom of the leg, shape (6,).
        cdof: MuJoCo's axes of motion (angular, linear) at the CoM, (nv, 6).
        com: CoM of the robot, shape (3,), [m].
    """
    lever = point - com
    for column in range(2 * N_BASE):
        dof = column if column < N_BASE else leg[column - N_BASE]
        turning = cross(cdof[dof, :3], lever)
        for i in range(3):
            jacobian[i, column] = cdof[dof, 3 + i] + turning[i]
            jacobian[3 + i, column] = cdof[dof, i]


@compiled
def foot_bias_acceleration(
    point: Array,
    leg: IntArray,
    motion: Array,
    qvel: Array,
    cdof_dot: Array,
    com: Array,
) -> Array:
    r"""Return the acceleration of a foot's point at zero joint acceleration.

    With the sum :math:`s = \sum \dot c_i \dot q_i` over MuJoCo's axes of motion at
    the CoM, the point at r from it has :math:`s_{lin} + s_{ang} \times r + \omega
    \times v`, v its velocity.

    Args:
        point: The point in the world, shape (3,), [m].
        leg: Degrees of freedom of the leg, shape (6,).
        motion: Of the foot's body at the CoM (angular, linear), shape (6,).
        qvel: Generalised velocity, shape (nv,).
        cdof_dot: Rates of the axes of motion (angular, linear), (nv, 6).
        com: CoM of the robot, shape (3,), [m].

    Returns:
        Linear over angular acceleration in the world, shape (6,).
    """
    lever = point - com
    total = np.zeros(6)
    for index in range(2 * N_BASE):
        dof = index if index < N_BASE else leg[index - N_BASE]
        for i in range(6):
            total[i] += cdof_dot[dof, i] * qvel[dof]
    omega = motion[:3]
    velocity = motion[3:] + cross(omega, lever)
    linear = total[3:] + cross(total[:3], lever) + cross(omega, velocity)
    result = np.empty(6)
    result[:3], result[3:] = linear, total[:3]
    return result


@compiled
def solve_legs(
    points: Array, accelerations: Array, robot: Record, biases: Array
) -> tuple[Array, Array]:
    """Return the legs' accelerations that give the feet theirs.

    Args:
        points: A point of each foot in the world, shape (2, 3), [m].
        accelerations: Linear and angular acceleration of each foot at that point,
            in the world, shape (2, 6).
        robot: The robot, dtype of `robot_dtype`.
        biases: Gets the feet's accelerations at zero joint acceleration, shape (2, 6).

    Returns:
        Per leg the matrix of the base's acceleration and, as its last column, the
        constant part, shape (2, 6, 7); and the feet's Jacobians by the base's and
        the leg's degrees of freedom, shape (2, 6, 12).
    """
    nv, n_bodies = robot["nv"], robot["n_bodies"]
    qvel = view_1d(robot["qvel"], nv)
    cdof, cdof_dot = view_2d(robot["cdof"], nv, 6), view_2d(robot["cdof_dot"], nv, 6)
    cvel = view_2d(robot["cvel"], n_bodies, 6)
    com = view_2d(robot["subtree_com"], n_bodies, 3)[1]
    solutions, jacobians = np.empty((2, 6, 7)), np.empty((2, 6, 12))
    right = np.empty((6, 7))
    for i in range(2):
        leg = robot["legs"][i]
        foot_jacobian(jacobians[i], points[i], leg, cdof, com)
        motion = cvel[robot["foot_bodies"][i]]
        bias = biases[i]
        bias[:] = foot_bias_acceleration(points[i], leg, motion, qvel, cdof_dot, com)
        for row in range(6):
            for column in range(N_BASE):
                right[row, column] = -jacobians[i, row, column]
            right[row, N_BASE] = accelerations[i, row] - bias[row]
        solutions[i] = solve_linear(jacobians[i][:, N_BASE:], right)
    return solutions, jacobians
