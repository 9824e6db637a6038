"""Joint set-points from posture and torque."""

from __future__ import annotations

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.native import view_1d
from ballsim_controllers.whole_body.leg_motion import N_BASE

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
    feet: there it is what keeps the sole from rocking on the ball. A swinging leg
    gains speed by its acceleration; else it would land with the mean speed of an
    IK period. Set-points hold for a tick: they are those of its middle. The joints'
    speeds are means over the tick before, and move on by a tick.

    Args:
        result: The set-points, shape (n,), [rad].
        ik_positions: Posture of the inverse kinematics, shape (n,), [rad].
        ik_velocity: Its velocity, shape (n,), [rad/s]; that of a swinging leg is
            moved on as well.
        dt: Control period, [s].
        bodies: What `find_forces` wrote, shape (1,).
        robots: The robot, shape (1,), dtype of `robot_dtype`.
    """
    body, robot = bodies[0], robots[0]
    n = len(ik_positions)
    velocity = view_1d(robot["qvel"], robot["nv"])[N_BASE:].copy()
    for i in range(n):
        velocity[i] += body["accelerations"][N_BASE + i] * dt
    for foot in range(2):
        if body["shares"][foot] > 0.0:
            for i in range(4, 6):
                ankle = robot["legs"][foot, i] - N_BASE
                velocity[ankle] = ik_velocity[ankle]
        else:
            for i in range(6):
                joint = robot["legs"][foot, i] - N_BASE
                ik_velocity[joint] += body["accelerations"][N_BASE + joint] * dt
    for i in range(n):
        middle = ik_positions[i] + 0.5 * dt * ik_velocity[i]
        ik_positions[i] += dt * ik_velocity[i]
        limit = robot["torque_limits"][i]
        torque = clip(body["joint_torques"][i], -limit, limit)
        result[i] = middle + (torque + robot["kv"][i] * velocity[i]) / robot["kp"][i]
