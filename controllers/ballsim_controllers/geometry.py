"""Rotations and the contact of a flat sole with a sphere.

Quaternions are (w, x, y, z) and map coordinates of the named frame to the
world.
"""

from __future__ import annotations

import math

import numpy as np

from ballsim_controllers.messages import Array

__all__ = [
    "cross",
    "integrate_rotation",
    "quaternion_to_rotation",
    "rotation_from_vector",
    "rotation_to_quaternion",
    "rotation_vector_between",
    "skew",
    "sole_rotation_on_ball",
]


def skew(vector: Array) -> Array:
    """Return the matrix S with ``S @ b == cross(vector, b)``, shape (3, 3)."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of two 3-vectors, faster than ``numpy.cross``."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def rotation_from_vector(rotation_vector: Array) -> Array:
    """Return the rotation matrix of a rotation vector (Rodrigues' formula).

    Args:
        rotation_vector: Axis times angle, shape (3,), [rad].

    Returns:
        Rotation matrix, shape (3, 3).
    """
    x, y, z = rotation_vector.tolist()
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


def quaternion_to_rotation(quaternion: Array) -> Array:
    """Return the rotation matrix of a unit quaternion, shape (3, 3)."""
    w, x, y, z = quaternion.tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_to_quaternion(rotation: Array) -> Array:
    """Return the unit quaternion with non-negative w of a rotation matrix."""
    (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = rotation.tolist()
    trace = m00 + m11 + m22
    # Divide by the largest of the four components (Shepperd's method).
    if trace >= max(m00, m11, m22):
        q = (1.0 + trace, m21 - m12, m02 - m20, m10 - m01)
    elif m00 >= m11 and m00 >= m22:
        q = (m21 - m12, 1.0 + m00 - m11 - m22, m10 + m01, m02 + m20)
    elif m11 >= m22:
        q = (m02 - m20, m10 + m01, 1.0 - m00 + m11 - m22, m21 + m12)
    else:
        q = (m10 - m01, m02 + m20, m21 + m12, 1.0 - m00 - m11 + m22)
    norm = math.copysign(math.sqrt(sum(c * c for c in q)), q[0])
    return np.array([c / norm for c in q])


def rotation_vector_between(rotation: Array, target: Array) -> Array:
    """Return the world-frame rotation vector that turns one attitude into another.

    Args:
        rotation: Present attitude, body to world, shape (3, 3).
        target: Wanted attitude, body to world, shape (3, 3).

    Returns:
        Vector r with ``rotation_from_vector(r) @ rotation == target``,
        shape (3,), [rad]; the angle is below pi.
    """
    w, x, y, z = rotation_to_quaternion(target @ rotation.T).tolist()
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < 1e-9:
        return np.array([2.0 * x, 2.0 * y, 2.0 * z])
    scale = 2.0 * math.atan2(sine, w) / sine
    return np.array([scale * x, scale * y, scale * z])


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
    result = rotation @ rotation_from_vector(angular_velocity_body * dt)
    # One Newton step to the nearest rotation keeps rounding from adding up.
    corrected: Array = result @ (1.5 * np.eye(3) - 0.5 * result.T @ result)
    return corrected


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
    x_axis /= math.sqrt(float(x_axis @ x_axis))
    return np.column_stack((x_axis, cross(normal, x_axis), normal))
