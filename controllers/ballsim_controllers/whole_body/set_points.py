"""Joint set-points from posture and torque."""

from __future__ import annotations

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.native import view_1d

__all__ = ["write_set_points"]


@compiled
def write_set_points(
    result: Array,
    ik_positions: Array,
    ik_velocity: Array,
    dt: float,
    bodies: Record,
    robots: Record,
) -> None:
    """Move the IK's posture on by one tick (in place); write the set-points.

    The drives' damping is made up for, except at the ankles of standing
    feet: there it is what keeps the sole from rocking on the ball.

    Args:
        result: The set-points, shape (n,), [rad].
        ik_positions: Posture of the inverse kinematics, shape (n,), [rad].
        ik_velocity: Its velocity, shape (n,), [rad/s].
        dt: Control period, [s].
        bodies: What `find_forces` wrote, shape (1,).
        robots: The robot, shape (1,), dtype of `robot_dtype`.
    """
    body, robot = bodies[0], robots[0]
    n = len(ik_positions)
    velocity = view_1d(robot["qvel"], robot["nv"])[6:].copy()
    for foot in range(2):
        if body["shares"][foot] > 0.0:
            for i in range(4, 6):
                ankle = robot["legs"][foot, i] - 6
                velocity[ankle] = ik_velocity[ankle]
    for i in range(n):
        ik_positions[i] += ik_velocity[i] * dt
        limit = robot["torque_limits"][i]
        torque = clip(body["joint_torques"][i], -limit, limit)
        result[i] = (
            ik_positions[i] + (torque + robot["kv"][i] * velocity[i]) / robot["kp"][i]
        )
