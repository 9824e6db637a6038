"""The start of a run: the nominal stance on the ball, then a perturbation of it.

The stance is the controllers' own (`ballsim_controllers.whole_body`): soles tangent
to the ball, trunk upright, CoM above the ball's centre. Contacts start with their
static penetration, so that sensors and estimators see loaded feet from the first
sample on, if the drives are given the torques that hold the posture.
"""

from __future__ import annotations

import contextlib
import math

import mujoco
import numpy as np

from ballsim.errors import ConfigError
from ballsim.scene import SceneIds
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.geometry import (
    quaternion_to_rotation,
    rotation_from_vector,
    rotation_to_quaternion,
    rotation_vector_between,
)
from ballsim_controllers.messages import Array, BallParameters
from ballsim_controllers.robot import RobotDescription
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

__all__ = ["compute_initial_state"]

_EDGE = 0.005  # closest start of a contact to the edge of the sole, [m]
_TOLERANCE = 1e-9  # of the soles, [m] and [rad], and of the depths, relative
_MAX_ITERATIONS = 60
_MAX_STEP = 0.2  # longest step of a joint, [rad]
_FIRST_DEPTH = 1e-5  # first guess of the static penetration, [m]
_BASE = 7  # position and quaternion of the trunk, ahead of the joints


def compute_initial_state(
    model: mujoco.MjModel,
    ids: SceneIds,
    robot: RobotDescription,
    ball: BallParameters,
    lean: tuple[float, float] = (0.0, 0.0),
    ball_offset: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
) -> tuple[Array, Array]:
    """Return the state of a robot that stands on the ball, perturbed on request.

    Order of the perturbations, all in the frame of the robot's heading:

    1. The robot is turned as a whole by `lean` about the ball's top point.
    2. The ball is moved under the robot by `ball_offset`.
    3. Each sole, its attitude kept, is lifted or lowered until it is at its
       static penetration again; the trunk takes the mean of the two lifts, the
       legs the rest. The contact moves inside the sole.
    4. All is turned by `yaw` about the world's z axis.

    Args:
        model: The compiled scene.
        ids: Its ids.
        robot: Description of the robot.
        ball: Parameters of the ball.
        lean: Pitch (positive: forwards) and roll (positive: to the right), [rad].
        ball_offset: Displacement of the ball, forwards and to the left, [m].
        yaw: Heading of the robot in the world, [rad].

    Returns:
        ``qpos`` and ``qvel`` (zero) of the scene. The ball's attitude is the
        identity; without an offset its centre is above the world's origin.

    Raises:
        ConfigError: The ball is too small to stand on, or the perturbation is
            too large for the soles or the joints.
    """
    kinematics = RobotModel(robot)
    try:
        stance = solve_nominal_stance(kinematics, ball.radius).qpos
    except InvalidSettingError as error:
        valid = f"at least {_smallest_radius(kinematics):g} m for {robot.name} to stand"
        raise ConfigError(error.key, error.value, valid) from None
    centre = np.array([0.0, 0.0, ball.radius])
    qpos = _assemble(model, ids, stance, centre)
    sole_depth, floor_depth = _static_depths(model, ids, qpos)

    centre += [ball_offset[0], ball_offset[1], -floor_depth]
    pitch = rotation_from_vector(np.array([0.0, lean[0], 0.0]))
    roll = rotation_from_vector(np.array([lean[1], 0.0, 0.0]))
    robot_qpos = _turn(stance, pitch @ roll, np.array([0.0, 0.0, 2.0 * ball.radius]))
    robot_qpos[2] -= floor_depth
    perturbation = {"lean": lean, "ball_offset": ball_offset}
    robot_qpos = _settle(
        kinematics, robot_qpos, ball.radius - sole_depth, centre, perturbation
    )
    turn = rotation_from_vector(np.array([0.0, 0.0, yaw]))
    robot_qpos = _turn(robot_qpos, turn, np.zeros(3))
    return _assemble(model, ids, robot_qpos, turn @ centre), np.zeros(model.nv)


def _smallest_radius(kinematics: RobotModel) -> float:
    """Return the radius of the smallest ball that can be stood on, in full [cm]."""
    for radius in np.arange(1, 500) / 100.0:
        with contextlib.suppress(InvalidSettingError):
            solve_nominal_stance(kinematics, float(radius))
            return float(radius)
    return math.inf


def _assemble(
    model: mujoco.MjModel, ids: SceneIds, robot_qpos: Array, centre: Array
) -> Array:
    """Return ``qpos`` of the scene from that of the robot and the ball's centre."""
    qpos: Array = np.array(model.qpos0)
    qpos[ids.qpos_trunk] = robot_qpos[:_BASE]
    qpos[ids.qpos_joints] = robot_qpos[_BASE:]
    qpos[ids.qpos_ball] = [*centre, 1.0, 0.0, 0.0, 0.0]
    return qpos


def _turn(robot_qpos: Array, rotation: Array, pivot: Array) -> Array:
    """Turn the robot as a whole about a point, shape (3,), [m]."""
    turned = robot_qpos.copy()
    turned[:3] = pivot + rotation @ (robot_qpos[:3] - pivot)
    attitude = rotation @ quaternion_to_rotation(robot_qpos[3:_BASE])
    turned[3:_BASE] = rotation_to_quaternion(attitude)
    return turned


def _settle(
    kinematics: RobotModel,
    robot_qpos: Array,
    distance: float,
    centre: Array,
    perturbation: object,
) -> Array:
    """Return the posture with both sole planes at a distance from the ball's centre.

    Args:
        kinematics: The robot; its data are overwritten.
        robot_qpos: Base and joints, shape (nq,).
        distance: Distance of the planes from the centre, [m].
        centre: Ball's centre, shape (3,), [m].
        perturbation: What was asked for, for the message.

    Raises:
        ConfigError: A contact would lie outside its sole, or no posture within
            the joint ranges puts the soles there.
    """
    robot, rest = kinematics.robot, np.zeros(kinematics.model.nv)
    limits = np.array([robot.sole_half_length, robot.sole_half_width]) - _EDGE
    kinematics.update(robot_qpos, rest)
    rotations = [foot.rotation for foot in kinematics.feet]
    soles = np.array([foot.position for foot in kinematics.feet])
    lifts = np.empty(2)
    for i, rotation in enumerate(rotations):
        normal = rotation[:, 2]
        lifts[i] = (distance - normal @ (soles[i] - centre)) / normal[2]
        soles[i, 2] += lifts[i]
        x, y, _ = rotation.T @ (centre - soles[i])
        if abs(x) > limits[0] or abs(y) > limits[1]:
            valid = (
                "small enough for each sole to touch the ball within "
                f"{limits[0]:.3g} x {limits[1]:.3g} m of its centre, not at "
                f"({x:.3f}, {y:.3f}) m"
            )
            raise ConfigError("initial", perturbation, valid)

    settled = robot_qpos.copy()
    settled[2] += float(np.mean(lifts))
    for _ in range(_MAX_ITERATIONS):
        kinematics.update(settled, rest)
        pairs = zip(kinematics.feet, soles, rotations, strict=True)
        errors = np.array(
            [
                [*(sole - foot.position), *rotation_vector_between(foot.rotation, goal)]
                for foot, sole, goal in pairs
            ]
        )
        if np.abs(errors).max() < _TOLERANCE:
            break
        for i, foot in enumerate(kinematics.feet):
            dofs = kinematics.leg_dofs[i]
            jacobian = kinematics.point_jacobian(i, foot.position)[:, dofs]
            step = np.linalg.lstsq(jacobian, errors[i], rcond=None)[0]
            settled[dofs + 1] += np.clip(step, -_MAX_STEP, _MAX_STEP)
    low, high = kinematics.joint_ranges.T
    joints = settled[_BASE:]
    if np.abs(errors).max() >= _TOLERANCE or np.any((joints < low) | (joints > high)):
        valid = "small enough for the legs to keep both soles on the ball"
        raise ConfigError("initial", perturbation, valid)
    return settled


def _static_depths(
    model: mujoco.MjModel, ids: SceneIds, qpos: Array
) -> tuple[float, float]:
    """Return the penetrations of sole and floor contacts that carry the weights.

    Inverse dynamics at rest gives the force of a contact from its depth: a normal
    force, without friction. What it lacks for the weights is the force that the
    free joints of trunk and ball would have to bear. The depths are scaled until
    those vanish, which makes the start a true equilibrium of the scene.

    Args:
        model: The compiled scene.
        ids: Ids of the scene.
        qpos: Stance whose contacts are at zero distance.

    Returns:
        Depth at the soles, along their normals, and at the floor, [m].
    """
    data = mujoco.MjData(model)
    gravity = float(np.linalg.norm(model.opt.gravity))
    weight_robot = gravity * float(model.body_subtreemass[ids.body_trunk])
    weight_all = weight_robot + gravity * float(model.body_mass[ids.body_ball])
    vertical = [ids.qvel_trunk.start + 2, ids.qvel_ball.start + 2]
    drop_sole, drop_floor = _FIRST_DEPTH, _FIRST_DEPTH
    for _ in range(_MAX_ITERATIONS):
        data.qpos[:] = qpos
        data.qpos[ids.qpos_ball.start + 2] -= drop_floor
        data.qpos[ids.qpos_trunk.start + 2] -= drop_floor + drop_sole
        data.qvel[:], data.qacc[:] = 0.0, 0.0
        mujoco.mj_inverse(model, data)
        lacking_robot, lacking_ball = data.qfrc_inverse[vertical].tolist()
        on_feet = weight_robot - lacking_robot
        on_floor = weight_all - lacking_robot - lacking_ball
        ratio_sole = weight_robot / on_feet if on_feet > 0.0 else 2.0
        ratio_floor = weight_all / on_floor if on_floor > 0.0 else 2.0
        drop_sole, drop_floor = drop_sole * ratio_sole, drop_floor * ratio_floor
        if max(abs(ratio_sole - 1.0), abs(ratio_floor - 1.0)) < _TOLERANCE:
            break
    return drop_sole * float(data.site_xmat[ids.site_soles[0]][8]), drop_floor
