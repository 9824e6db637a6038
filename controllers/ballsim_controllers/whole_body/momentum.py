"""Acceleration of the base that gives the contact forces their CoP."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import clip, multiply, solve_linear
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.whole_body.leg_motion import N_BASE

__all__ = ["base_acceleration", "net_wrench"]


@compiled
def base_acceleration(
    wrench: Array,
    force_vertical: float,
    trunk_angular: Array,
    horizontal_force: Array,
    rotation_trunk: Array,
    yaw_limit: float,
    mass: float,
    limits: Record,
) -> tuple[Array, float]:
    """Return the base's acceleration, (6,), and the yaw moment that it needs, [N m].

    Vertical force and horizontal moment about the CoP are met exactly; the trunk's
    yaw acceleration gives way where the feet cannot twist.

    Args:
        wrench: Net wrench about the CoP, world axes, per base acceleration; the last
            column is the constant part, shape (6, 7).
        force_vertical: Wanted vertical force, [N].
        trunk_angular: Wanted, in the trunk, shape (3,), [rad/s^2].
        horizontal_force: Contact force of the inverted pendulum, (2,), [N].
        rotation_trunk: Trunk to world, shape (3, 3).
        yaw_limit: Largest yaw moment that the feet can give, [N m].
        mass: Of the robot, [kg].
        limits: Prices of deviations.
    """
    rows, target = np.empty((3, N_BASE)), np.empty(3)
    for i in range(3):
        for column in range(N_BASE):
            rows[i, column] = wrench[2 + i, column]
        target[i] = (force_vertical if i == 0 else 0.0) - wrench[2 + i, N_BASE]
    base = _share_momentum(
        rows,
        target,
        wrench,
        trunk_angular,
        horizontal_force,
        rotation_trunk,
        mass,
        limits,
    )
    direction = np.zeros((N_BASE, 1))
    for i in range(3):
        direction[3 + i, 0] = rotation_trunk[2, i]
    direction[:3] = solve_linear(rows[:, :3], -multiply(rows, direction))
    yaw, change = wrench[5, N_BASE], 0.0
    for column in range(N_BASE):
        yaw += wrench[5, column] * base[column]
        change += wrench[5, column] * direction[column, 0]
    held_yaw = clip(yaw, -yaw_limit, yaw_limit)
    for column in range(N_BASE):
        base[column] -= (yaw - held_yaw) / change * direction[column, 0]
    return base, held_yaw


@compiled
def net_wrench(
    solutions: Array,
    robot: Record,
    upper_joints: Array,
    mass_matrix: Array,
    bias: Array,
    rotation_trunk: Array,
) -> Array:
    """Return the net wrench about the base, world axes, per base acceleration.

    Returns:
        Force over moment; the last column is the constant part, shape (6, 7).
    """
    wrench, legs, upper = np.empty((6, 7)), robot["legs"], robot["upper"]
    for row in range(6):
        for column in range(7):
            total = mass_matrix[row, column] if column < N_BASE else bias[row]
            for foot in range(2):
                for i in range(6):
                    total += (
                        mass_matrix[row, legs[foot, i]] * solutions[foot, i, column]
                    )
            wrench[row, column] = total
        for i in range(len(upper_joints)):
            wrench[row, N_BASE] += mass_matrix[row, upper[i]] * upper_joints[i]
    # The base's rotations are about the trunk's own axes.
    wrench[3:] = multiply(rotation_trunk, wrench[3:])
    return wrench


@compiled
def _share_momentum(
    rows: Array,
    target: Array,
    wrench: Array,
    trunk_angular: Array,
    horizontal_force: Array,
    rotation_trunk: Array,
    mass: float,
    limits: Record,
) -> Array:
    """Return the base's acceleration that meets the CoP exactly.

    What the swinging leg does to the angular momentum must be answered by
    the trunk (it leans) or by the horizontal force (the ball is kicked):
    least squares over both, about the wanted trunk acceleration and the
    force of the pendulum.

    Args:
        rows: Vertical force and horizontal moment about the CoP per base
            acceleration, shape (3, 6).
        target: What they shall be, less their constant part, shape (3,).
        wrench: Net wrench, shape (6, 7).
        trunk_angular: Wanted, in the trunk, shape (3,), [rad/s^2].
        horizontal_force: Contact force of the inverted pendulum, (2,), [N].
        rotation_trunk: Trunk to world, shape (3, 3).
        mass: Of the robot, [kg].
        limits: Prices of both deviations.

    Returns:
        Linear acceleration in the world, angular in the trunk, shape (6,).
    """
    # Columns: wanted motion, deviation of the trunk about the world's x and y.
    solution = np.zeros((6, 3))
    for i in range(3):
        solution[3 + i, 0] = trunk_angular[i]
        solution[3 + i, 1] = rotation_trunk[0, i]
        solution[3 + i, 2] = rotation_trunk[1, i]
    right = -multiply(rows, solution)
    for i in range(3):
        right[i, 0] += target[i]
    solution[:3] = solve_linear(rows[:, :3], right)
    forces = multiply(wrench[:2, :N_BASE], solution)
    system, gap = np.eye(2), np.zeros((2, 1))
    for axis in range(2):
        price = limits["pitch_compliance"] if axis == 0 else limits["roll_compliance"]
        rest = horizontal_force[axis] - wrench[axis, N_BASE] - forces[axis, 0]
        for i in range(2):
            pull = forces[axis, 1 + i] / mass * price
            gap[i, 0] += pull * rest / mass
            for j in range(2):
                system[i, j] += pull * forces[axis, 1 + j] / mass
    lean = solve_linear(system, gap)
    base = np.empty(6)
    for i in range(6):
        base[i] = solution[i, 0] + solution[i, 1] * lean[0, 0]
        base[i] += solution[i, 2] * lean[1, 0]
    return base
