"""The frame in which the robot balances and walks: its world turned by its heading.

Balance, planner and whole-body layer know forwards and sideways, and a robot that
faces along x. For a robot that has turned by psi all of them work in a frame that
has turned with it, about the origin of the world. The frame stands still within a
tick, so velocities are those in the world; when it moves on, whatever is kept from
tick to tick is turned with it.
"""

from __future__ import annotations

import math

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.native import view_1d
from ballsim_controllers.robot_kinematics import refresh_kinematics
from ballsim_controllers.settings import ForceSettings

__all__ = [
    "HEADING",
    "enter_frame",
    "find_leads",
    "leave_frame",
    "turn_memory",
    "turn_vectors",
]

#: Angle of the frame in the world, [rad], its sine and cosine.
HEADING = np.dtype([(name, np.float64) for name in ("angle", "sine", "cosine")])


def find_leads(forces: ForceSettings, stance_delay: float) -> tuple[float, float]:
    """Return by what times trunk and swinging sole are led ahead of the frame, [s].

    The laws that hold their attitudes brake every turn, and would let them lag behind
    a frame that turns on. Besides, a sole lands with the direction that the frame has
    in the middle of the support to come.

    Args:
        forces: Gains of these laws.
        stance_delay: Time from a landing to the middle of the foot's support, [s].
    """
    trunk = forces.yaw_damping / forces.yaw_stiffness
    sole = forces.swing_rotation_damping / forces.swing_rotation_stiffness
    return trunk, sole + stance_delay


@compiled
def turn_vectors(vectors: Array, cosine: float, sine: float) -> None:
    """Turn vectors by an angle (in place).

    Args:
        vectors: In the plane or in space, shape (n, 2 or more).
        cosine: Of the angle about the vertical.
        sine: Of the same angle.
    """
    for i in range(len(vectors)):
        _turn(vectors[i], cosine, sine)


@compiled
def _turn(vector: Array, cosine: float, sine: float) -> None:
    """Turn a vector by an angle (in place), see `turn_vectors`."""
    x, y = vector[0], vector[1]
    vector[0], vector[1] = cosine * x - sine * y, sine * x + cosine * y


@compiled
def enter_frame(
    estimates: Record, world_estimates: Record, headings: Record, robots: Record
) -> None:
    """Write the estimate in the frame, and bring the robot's kinematics there.

    Args:
        estimates: The result, shape (1,), dtype `ESTIMATE`.
        world_estimates: The estimate in the world, likewise.
        headings: The frame, shape (1,), dtype `HEADING`.
        robots: The robot, at the estimate; shape (1,), dtype of `robot_dtype`.
    """
    estimate, source, heading = estimates[0], world_estimates[0], headings[0]
    _copy(estimate, source)
    if heading["angle"] == 0.0:
        return
    cosine, sine = heading["cosine"], -heading["sine"]
    _turn(estimate["position_trunk_in_world"], cosine, sine)
    _turn(estimate["linear_velocity_trunk_in_world"], cosine, sine)
    _turn(estimate["position_com_in_world"], cosine, sine)
    _turn(estimate["linear_velocity_com_in_world"], cosine, sine)
    _turn(estimate["position_ball_in_world"], cosine, sine)
    _turn(estimate["linear_velocity_ball_in_world"], cosine, sine)
    _turn(estimate["angular_velocity_ball_in_world"], cosine, sine)
    _turn(estimate["cop_in_world"], cosine, sine)
    turn_vectors(estimate["contacts_in_world"], cosine, sine)
    half = 0.5 * heading["angle"]
    c, s = math.cos(half), math.sin(half)
    given = source["quaternion_trunk_to_world"]
    w, x, y, z = given[0], given[1], given[2], given[3]
    attitude = estimate["quaternion_trunk_to_world"]
    attitude[0], attitude[3] = c * w + s * z, c * z - s * w
    attitude[1], attitude[2] = c * x + s * y, c * y - s * x
    robot = robots[0]
    nv = robot["nv"]
    qpos, qvel = view_1d(robot["qpos"], nv + 1), view_1d(robot["qvel"], nv)
    for i in range(3):
        qpos[i] = estimate["position_trunk_in_world"][i]
        qvel[i] = estimate["linear_velocity_trunk_in_world"][i]
    qpos[3:7] = attitude
    refresh_kinematics(robots)


@compiled
def _copy(estimate: Record, source: Record) -> None:
    """Copy an estimate, field by field."""
    estimate["time"] = source["time"]
    estimate["quaternion_trunk_to_world"][:] = source["quaternion_trunk_to_world"]
    estimate["angular_velocity_trunk_in_trunk"][:] = source[
        "angular_velocity_trunk_in_trunk"
    ]
    estimate["position_trunk_in_world"][:] = source["position_trunk_in_world"]
    estimate["linear_velocity_trunk_in_world"][:] = source[
        "linear_velocity_trunk_in_world"
    ]
    estimate["position_com_in_world"][:] = source["position_com_in_world"]
    estimate["linear_velocity_com_in_world"][:] = source["linear_velocity_com_in_world"]
    estimate["position_ball_in_world"][:] = source["position_ball_in_world"]
    estimate["linear_velocity_ball_in_world"][:] = source[
        "linear_velocity_ball_in_world"
    ]
    estimate["angular_velocity_ball_in_world"][:] = source[
        "angular_velocity_ball_in_world"
    ]
    estimate["contacts_in_world"][:] = source["contacts_in_world"]
    estimate["normal_forces"][:] = source["normal_forces"]
    estimate["cop_in_world"][:] = source["cop_in_world"]


@compiled
def leave_frame(report: Record, headings: Record) -> None:
    """Bring what a report says of the frame into the world (in place).

    Args:
        report: Report of a tick, dtype of `telemetry_dtype`; its estimate is in the
            world already.
        headings: The frame, shape (1,), dtype `HEADING`.
    """
    heading = headings[0]
    if heading["angle"] == 0.0:
        return
    cosine, sine = heading["cosine"], heading["sine"]
    _turn(report["ideal_cop"], cosine, sine)
    _turn(report["commanded_cop"], cosine, sine)
    _turn(report["target_com"], cosine, sine)
    turn_vectors(report["target_soles"], cosine, sine)


@compiled
def turn_memory(
    axes: Record, paths: Record, vectors: Array, cosine: float, sine: float
) -> None:
    """Turn what is kept from tick to tick as the frame moves on (in place).

    Args:
        axes: Observers along and across the heading, shape (2,), dtype `AXIS`.
        paths: Path of the swinging foot, shape (1,).
        vectors: Places and velocities in the frame, shape (n, 2), [m] and [m/s].
        cosine: Of the angle from the new frame to the old one.
        sine: Of the same angle.
    """
    along, across = axes[0], axes[1]
    for i in range(len(along["estimate"])):
        x, y = along["estimate"][i], across["estimate"][i]
        along["estimate"][i] = cosine * x - sine * y
        across["estimate"][i] = sine * x + cosine * y
    x, y = along["lagged_cop"], across["lagged_cop"]
    along["lagged_cop"], across["lagged_cop"] = (
        cosine * x - sine * y,
        sine * x + cosine * y,
    )
    path = paths[0]
    turn_vectors(path["offset"], cosine, sine)
    _turn(path["target"], cosine, sine)
    turn_vectors(vectors, cosine, sine)
