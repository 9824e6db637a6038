"""Rotations, small matrices and the contact of a flat sole with a sphere.

Quaternions are (w, x, y, z) and map coordinates of the named frame to the
world. All functions are compiled; loops over three elements are faster there
than calls of a linear algebra library.
"""

from __future__ import annotations

import math

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Array

__all__ = [
    "apply",
    "apply_transposed",
    "clip",
    "cross",
    "integrate_rotation",
    "multiply",
    "quaternion_to_rotation",
    "rotation_from_vector",
    "rotation_to_quaternion",
    "rotation_vector_between",
    "skew",
    "sole_rotation_on_ball",
    "solve_linear",
]


@compiled
def clip(value: float, lower: float, upper: float) -> float:
    """Return a number, limited to an interval."""
    return min(max(value, lower), upper)


@compiled
def skew(vector: Array) -> Array:
    """Return the matrix S with ``S @ b == cross(vector, b)``, shape (3, 3)."""
    x, y, z = vector[0], vector[1], vector[2]
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@compiled
def cross(a: Array, b: Array) -> Array:
    """Return the cross product of two 3-vectors, faster than ``numpy.cross``."""
    result = np.empty(3)
    result[0] = a[1] * b[2] - a[2] * b[1]
    result[1] = a[2] * b[0] - a[0] * b[2]
    result[2] = a[0] * b[1] - a[1] * b[0]
    return result


@compiled
def multiply(a: Array, b: Array) -> Array:
    """Return the product of two matrices, shapes (n, k) and (k, m)."""
    n, inner, m = a.shape[0], a.shape[1], b.shape[1]
    result = np.zeros((n, m))
    for i in range(n):
        for k in range(inner):
            for j in range(m):
                result[i, j] += a[i, k] * b[k, j]
    return result


@compiled
def apply(matrix: Array, vector: Array) -> Array:
    """Return the product of a matrix, shape (n, m), and a vector, shape (m,)."""
    n, m = matrix.shape
    result = np.zeros(n)
    for i in range(n):
        total = 0.0
        for j in range(m):
            total += matrix[i, j] * vector[j]
        result[i] = total
    return result


@compiled
def apply_transposed(matrix: Array, vector: Array) -> Array:
    """Return the product of a matrix's transpose, (n, m), and a vector, (n,)."""
    n, m = matrix.shape
    result = np.zeros(m)
    for i in range(n):
        for j in range(m):
            result[j] += matrix[i, j] * vector[i]
    return result


@compiled
def solve_linear(matrix: Array, right: Array) -> Array:
    """Return the solution of a small linear system.

    Gaussian elimination with partial pivoting; a singular matrix gives numbers
    that are not finite.

    Args:
        matrix: Shape (n, n); not changed.
        right: Right-hand sides, shape (n, m); not changed.

    Returns:
        Solution, shape (n, m).
    """
    n, m = right.shape
    a, x = matrix.copy(), right.copy()
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
            for j in range(m):
                x[k, j], x[pivot, j] = x[pivot, j], x[k, j]
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= factor * a[k, j]
                for j in range(m):
                    x[i, j] -= factor * x[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(m):
            total = x[k, j]
            for i in range(k + 1, n):
                total -= a[k, i] * x[i, j]
            x[k, j] = total / a[k, k]
    return x


@compiled
def rotation_from_vector(rotation_vector: Array) -> Array:
    """Return the rotation matrix of a rotation vector (Rodrigues' formula).

    Args:
        rotation_vector: Axis times angle, shape (3,), [rad].

    Returns:
        Rotation matrix, shape (3, 3).
    """
    x, y, z = rotation_vector[0], rotation_vector[1], rotation_vector[2]
    angle_squared = x * x + y * y + z * z
    if angle_squared < 1e-12:
        a, b = 1.0 - angle_squared / 6.0, 0.5 - angle_squared / 24.0
    else:
        angle = math.sqrt(angle_squared)
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle_squared
    return np.array(
        [
            [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
        ]
    )


@compiled
def quaternion_to_rotation(quaternion: Array) -> Array:
    """Return the rotation matrix of a unit quaternion, shape (3, 3)."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@compiled
def rotation_to_quaternion(rotation: Array) -> Array:
    """Return the unit quaternion with non-negative w of a rotation matrix."""
    m00, m01, m02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    m10, m11, m12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    m20, m21, m22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    trace = m00 + m11 + m22
    # Divide by the largest of the four components (Shepperd's method).
    if trace >= max(m00, m11, m22):
        w, x, y, z = 1.0 + trace, m21 - m12, m02 - m20, m10 - m01
    elif m00 >= m11 and m00 >= m22:
        w, x, y, z = m21 - m12, 1.0 + m00 - m11 - m22, m10 + m01, m02 + m20
    elif m11 >= m22:
        w, x, y, z = m02 - m20, m10 + m01, 1.0 - m00 + m11 - m22, m21 + m12
    else:
        w, x, y, z = m10 - m01, m02 + m20, m21 + m12, 1.0 - m00 - m11 + m22
    norm = math.copysign(math.sqrt(w * w + x * x + y * y + z * z), w)
    return np.array([w / norm, x / norm, y / norm, z / norm])


@compiled
def rotation_vector_between(rotation: Array, target: Array) -> Array:
    """Return the world-frame rotation vector that turns one attitude into another.

    Args:
        rotation: Present attitude, body to world, shape (3, 3).
        target: Wanted attitude, body to world, shape (3, 3).

    Returns:
        Vector r with ``rotation_from_vector(r) @ rotation == target``,
        shape (3,), [rad]; the angle is below pi.
    """
    quaternion = rotation_to_quaternion(multiply(target, rotation.T))
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, w) / sine
    return np.array([scale * x, scale * y, scale * z])


@compiled
def integrate_rotation(
    rotation: Array, angular_velocity_body: Array, dt: float
) -> Array:
    """Advance an attitude by a constant angular velocity given in the body frame.

    Args:
        rotation: Attitude, body to world, shape (3, 3).
        angular_velocity_body: Angular velocity in the body frame, (3,), [rad/s].
        dt: Time, [s].

    Returns:
        The new attitude, orthonormal to rounding, shape (3, 3).
    """
    turn = np.empty(3)
    for i in range(3):
        turn[i] = angular_velocity_body[i] * dt
    result = multiply(rotation, rotation_from_vector(turn))
    # One Newton step to the nearest rotation keeps rounding from adding up.
    nearness = multiply(result.T, result)
    for i in range(3):
        for j in range(3):
            nearness[i, j] = (1.5 if i == j else 0.0) - 0.5 * nearness[i, j]
    return multiply(result, nearness)


@compiled
def sole_rotation_on_ball(normal: Array, heading: float = 0.0) -> Array:
    """Return the attitude of a sole that is tangent to the ball.

    Args:
        normal: Unit vector from the ball's centre to the contact, shape (3,),
            not horizontal.
        heading: Direction of the toes about the vertical, [rad].

    Returns:
        Sole to world, shape (3, 3): z along ``normal``, x in the vertical plane
        of the heading.
    """
    side = np.array([-math.sin(heading), math.cos(heading), 0.0])
    x_axis = cross(side, normal)
    length = math.sqrt(x_axis[0] ** 2 + x_axis[1] ** 2 + x_axis[2] ** 2)
    for i in range(3):
        x_axis[i] /= length
    y_axis = cross(normal, x_axis)
    result = np.empty((3, 3))
    for i in range(3):
        result[i, 0], result[i, 1], result[i, 2] = x_axis[i], y_axis[i], normal[i]
    return result
