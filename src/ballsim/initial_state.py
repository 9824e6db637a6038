"""The start of a run: a stance on the ball, then a perturbation of it.

The stance is symmetric: soles tangent to the ball at ``y = +-w``, trunk upright
and as high above the soles as in the nominal posture, CoM above the ball's
centre. Contacts start with their static penetration, so that sensors and
estimators see loaded feet from the first sample on, if the drives are given the
torques that hold the posture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ballsim.errors import ConfigError
from ballsim.scene import SceneIds
from ballsim_controllers.messages import Array, BallParameters
from ballsim_controllers.robot import RobotDescription

__all__ = ["compute_initial_state"]

_MAX_WIDTH_RATIO = 0.8  # steepest place of a sole on the ball: asin(0.8) = 53 deg
_MAX_ITERATIONS = 60
_TOLERANCE = 1e-9  # of the stance, [m] and [rad], and of the depths, relative
_DAMPING = 1e-8  # of the Gauss-Newton step, relative to unit Jacobian columns
_MAX_STEP = 0.2  # longest step of a coordinate, [m] or [rad]
_EDGE = 0.005  # closest start of a contact to the edge of the sole, [m]
_DEPTH_ITERATIONS = 30
_FIRST_DEPTH = 1e-5  # first guess of the static penetration, [m]
_X, _Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


@dataclass(frozen=True, slots=True)
class _Stance:
    """What the posture has to meet, in the world.

    Attributes:
        rotation_trunk: Attitude of the trunk, shape (3, 3).
        height_trunk: z of the trunk's origin, [m].
        com: x and y of the robot's CoM, shape (2,), [m].
        soles: Sole centres, shape (2, 3), [m].
        rotations_soles: Attitudes of the soles, shape (2, 3, 3).
    """

    rotation_trunk: Array
    height_trunk: float
    com: Array
    soles: Array
    rotations_soles: Array


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
       static penetration again (the legs bend a little for that; CoM and trunk
       keep their place but for the mean of the two lifts). The contact moves
       inside the sole.
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
    data = mujoco.MjData(model)
    qpos = np.array(model.qpos0)
    for name, address in zip(ids.joint_names, ids.qpos_joints, strict=True):
        qpos[address] = robot.nominal_posture[name]

    nominal = _nominal_stance(model, data, ids, robot, ball, qpos)
    qpos = _place_ball(qpos, ids, np.array([0.0, 0.0, ball.radius]))
    qpos = _solve(model, data, ids, nominal, qpos, "ball.radius", ball.radius)
    sole_depth, floor_depth = _static_depths(model, data, ids, qpos)

    centre = np.array([ball_offset[0], ball_offset[1], ball.radius - floor_depth])
    stance = _lean(model, data, ids, qpos, lean, 2.0 * ball.radius)
    perturbation = {"lean": lean, "ball_offset": ball_offset}
    distance = ball.radius - sole_depth
    stance = _settle(stance, robot, distance, centre, floor_depth, perturbation)
    qpos = _place_ball(qpos, ids, centre)
    qpos = _solve(model, data, ids, stance, qpos, "initial", perturbation)
    return _turn(qpos, ids, yaw), np.zeros(model.nv)


def _nominal_stance(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    ids: SceneIds,
    robot: RobotDescription,
    ball: BallParameters,
    qpos: Array,
) -> _Stance:
    """Return the symmetric stance with contacts at zero distance."""
    width, radius = robot.stance_half_width, ball.radius
    if not width <= _MAX_WIDTH_RATIO * radius:
        valid = (
            f"at least {width / _MAX_WIDTH_RATIO:.3g} m, for a stance that is "
            f"{2.0 * width:g} m wide"
        )
        raise ConfigError("ball.radius", radius, valid)
    _forward(model, data, qpos)
    height = float(
        data.xpos[ids.body_trunk, 2] - np.mean(data.site_xpos[ids.site_soles, 2])
    )
    angle = math.asin(width / radius)
    soles, rotations = np.empty((2, 3)), np.empty((2, 3, 3))
    for i, side in enumerate((1.0, -1.0)):
        # Turning about x by a negative angle tilts z to the left, positive y.
        rotations[i] = _rotation(_X, -side * angle)
        soles[i] = radius * rotations[i][:, 2] + [0.0, 0.0, radius]
    top = float(np.mean(soles[:, 2]))
    return _Stance(np.eye(3), top + height, np.zeros(2), soles, rotations)


def _lean(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    ids: SceneIds,
    qpos: Array,
    lean: tuple[float, float],
    top: float,
) -> _Stance:
    """Return the present stance, turned as a whole about the ball's top point."""
    _forward(model, data, qpos)
    turn = _rotation(_Y, lean[0]) @ _rotation(_X, lean[1])
    pivot = np.array([0.0, 0.0, top])
    return _Stance(
        rotation_trunk=turn @ data.xmat[ids.body_trunk].reshape(3, 3),
        height_trunk=float((pivot + turn @ (data.xpos[ids.body_trunk] - pivot))[2]),
        com=(pivot + turn @ (data.subtree_com[ids.body_trunk] - pivot))[:2],
        soles=pivot + (data.site_xpos[ids.site_soles] - pivot) @ turn.T,
        rotations_soles=turn @ data.site_xmat[ids.site_soles].reshape(2, 3, 3),
    )


def _settle(
    stance: _Stance,
    robot: RobotDescription,
    distance: float,
    centre: Array,
    floor_depth: float,
    perturbation: object,
) -> _Stance:
    """Return the stance with both sole planes at a distance from the ball's centre.

    Args:
        stance: The stance.
        robot: Description of the robot.
        distance: Distance of the planes from the centre, [m].
        centre: Ball's centre, shape (3,), [m].
        floor_depth: How deep the ball, and the robot with it, sinks in, [m].
        perturbation: What was asked for, for the message.

    Raises:
        ConfigError: A contact would lie outside its sole.
    """
    soles = stance.soles - [0.0, 0.0, floor_depth]
    limits = np.array([robot.sole_half_length, robot.sole_half_width]) - _EDGE
    lifts = np.empty(2)
    for i, rotation in enumerate(stance.rotations_soles):
        normal = rotation[:, 2]
        gap = distance - normal @ (soles[i] - centre)
        lifts[i] = gap / normal[2]
        soles[i, 2] += lifts[i]
        contact = rotation.T @ (centre - soles[i])
        if np.any(np.abs(contact[:2]) > limits):
            valid = (
                "small enough for each sole to touch the ball within "
                f"{limits[0]:.3g} x {limits[1]:.3g} m of the sole's centre, not at "
                f"({contact[0]:.3f}, {contact[1]:.3f}) m"
            )
            raise ConfigError("initial", perturbation, valid)
    height = stance.height_trunk - floor_depth + float(np.mean(lifts))
    return _Stance(
        stance.rotation_trunk, height, stance.com, soles, stance.rotations_soles
    )


def _solve(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    ids: SceneIds,
    stance: _Stance,
    qpos: Array,
    key: str,
    value: object,
) -> Array:
    """Return the posture that meets a stance, by damped Gauss-Newton steps.

    Unknowns are the trunk's position and the joints of the legs; the trunk's
    attitude is given and the other joints keep their angles.

    Raises:
        ConfigError: No posture within the joint ranges meets the stance.
    """
    qpos = qpos.copy()
    legs = _leg_joints(model, ids)
    address = model.jnt_qposadr[legs]
    low, high = model.jnt_range[legs].T
    columns = np.r_[ids.qvel_trunk.start : ids.qvel_trunk.start + 3]
    columns = np.r_[columns, model.jnt_dofadr[legs]]
    trunk = ids.qpos_trunk.start
    mujoco.mju_mat2Quat(qpos[trunk + 3 : trunk + 7], stance.rotation_trunk.ravel())
    qpos[trunk : trunk + 3] = [*stance.com, stance.height_trunk]

    for _ in range(_MAX_ITERATIONS):
        error, jacobian = _residual(model, data, ids, stance, qpos)
        if np.max(np.abs(error)) < _TOLERANCE:
            break
        j = jacobian[:, columns]
        hessian = j.T @ j + _DAMPING * np.eye(columns.size)
        step = np.clip(np.linalg.solve(hessian, -j.T @ error), -_MAX_STEP, _MAX_STEP)
        qpos[trunk : trunk + 3] += step[:3]
        qpos[address] = np.clip(qpos[address] + step[3:], low, high)
    else:
        worst = int(np.argmin(np.minimum(qpos[address] - low, high - qpos[address])))
        name = model.joint(int(legs[worst])).name
        valid = (
            "a start that a posture within the joint ranges meets; "
            f"{name} stops at {qpos[address][worst]:.3f} rad"
        )
        if key == "ball.radius":
            valid = f"a ball large enough to stand on; {valid}"
        raise ConfigError(key, value, valid)
    return qpos


def _residual(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    ids: SceneIds,
    stance: _Stance,
    qpos: Array,
) -> tuple[Array, Array]:
    """Return what the posture misses of a stance, (15,), and its Jacobian."""
    _forward(model, data, qpos)
    errors, jacobians = [], []
    for i, site in enumerate(ids.site_soles):
        jac_position, jac_rotation = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, jac_position, jac_rotation, int(site))
        present = data.site_xmat[site].reshape(3, 3)
        errors += [
            data.site_xpos[site] - stance.soles[i],
            _rotation_error(present, stance.rotations_soles[i]),
        ]
        jacobians += [jac_position, jac_rotation]
    jac_com, jac_trunk = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacSubtreeCom(model, data, jac_com, ids.body_trunk)
    mujoco.mj_jacBody(model, data, jac_trunk, None, ids.body_trunk)
    errors += [
        data.subtree_com[ids.body_trunk][:2] - stance.com,
        data.xpos[ids.body_trunk][2:] - stance.height_trunk,
    ]
    jacobians += [jac_com[:2], jac_trunk[2:]]
    return np.concatenate(errors), np.vstack(jacobians)


def _static_depths(
    model: mujoco.MjModel, data: mujoco.MjData, ids: SceneIds, qpos: Array
) -> tuple[float, float]:
    """Return the penetrations of sole and floor contacts that carry the weights.

    Inverse dynamics at rest gives the force of a contact from its depth: a normal
    force, without friction. The depths are scaled until the vertical forces on the
    feet add up to the robot's weight (each sole carries half of it) and that on the
    floor to both weights, which makes the start a true equilibrium of the scene.

    Args:
        model: The compiled scene.
        data: Scratch.
        ids: Ids of the scene.
        qpos: Stance whose contacts are at zero distance.

    Returns:
        Depth at the soles, along their normals, and at the floor, [m].
    """
    gravity = float(np.linalg.norm(model.opt.gravity))
    weight_robot = gravity * float(model.body_subtreemass[ids.body_trunk])
    weight_all = weight_robot + gravity * float(model.body_mass[ids.body_ball])
    normal_z = float(data.site_xmat[ids.site_soles[0]][8])
    drop_sole, drop_floor = _FIRST_DEPTH, _FIRST_DEPTH
    if gravity == 0.0:
        return 0.0, 0.0
    for _ in range(_DEPTH_ITERATIONS):
        data.qpos[:] = qpos
        data.qpos[ids.qpos_ball.start + 2] -= drop_floor
        data.qpos[ids.qpos_trunk.start + 2] -= drop_floor + drop_sole
        data.qvel[:], data.qacc[:] = 0.0, 0.0
        mujoco.mj_inverse(model, data)
        on_feet, on_floor = _vertical_forces(model, data, ids)
        ratio_sole = weight_robot / on_feet if on_feet > 0.0 else 2.0
        ratio_floor = weight_all / on_floor if on_floor > 0.0 else 2.0
        drop_sole, drop_floor = drop_sole * ratio_sole, drop_floor * ratio_floor
        if max(abs(ratio_sole - 1.0), abs(ratio_floor - 1.0)) < _TOLERANCE:
            break
    return drop_sole * normal_z, drop_floor


def _vertical_forces(
    model: mujoco.MjModel, data: mujoco.MjData, ids: SceneIds
) -> tuple[float, float]:
    """Return the vertical parts of the normal forces on both soles and on the floor.

    Both in [N], positive as pressure.
    """
    on_feet, on_floor, force = 0.0, 0.0, np.zeros(6)
    for i, contact in enumerate(data.contact[: data.ncon]):
        pair = {int(contact.geom[0]), int(contact.geom[1])}
        if ids.geom_ball not in pair:
            continue
        mujoco.mj_contactForce(model, data, i, force)
        vertical = float(force[0] * abs(contact.frame[2]))  # normal: first row
        if ids.geom_floor in pair:
            on_floor += vertical
        elif pair & {int(geom) for geom in ids.geom_soles}:
            on_feet += vertical
    return on_feet, on_floor


def _leg_joints(model: mujoco.MjModel, ids: SceneIds) -> Array:
    """Return the ids of the joints between the trunk and the feet."""
    found: list[int] = []
    for foot in ids.body_feet:
        body = int(foot)
        while body != ids.body_trunk:
            first, number = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            found += range(first, first + number)
            body = int(model.body_parentid[body])
    return np.array(sorted(found))


def _forward(model: mujoco.MjModel, data: mujoco.MjData, qpos: Array) -> None:
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)


def _place_ball(qpos: Array, ids: SceneIds, centre: Array) -> Array:
    placed = qpos.copy()
    placed[ids.qpos_ball] = [*centre, 1.0, 0.0, 0.0, 0.0]
    return placed


def _turn(qpos: Array, ids: SceneIds, yaw: float) -> Array:
    """Turn robot and ball about the world's z axis; the ball keeps its attitude."""
    turned = qpos.copy()
    quaternion = np.array([math.cos(yaw / 2.0), 0.0, 0.0, math.sin(yaw / 2.0)])
    for start in (ids.qpos_trunk.start, ids.qpos_ball.start):
        position = np.zeros(3)
        mujoco.mju_rotVecQuat(position, qpos[start : start + 3], quaternion)
        turned[start : start + 3] = position
    attitude = slice(ids.qpos_trunk.start + 3, ids.qpos_trunk.stop)
    result = np.zeros(4)
    mujoco.mju_mulQuat(result, quaternion, qpos[attitude])
    turned[attitude] = result
    return turned


def _rotation(axis: tuple[float, float, float], angle: float) -> Array:
    quaternion, matrix = np.zeros(4), np.zeros(9)
    mujoco.mju_axisAngle2Quat(quaternion, np.array(axis), angle)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _rotation_error(present: Array, target: Array) -> Array:
    """Return the turn from target to present as a vector in the world, [rad]."""
    quaternion, vector = np.zeros(4), np.zeros(3)
    mujoco.mju_mat2Quat(quaternion, (present @ target.T).ravel())
    mujoco.mju_quat2Vel(vector, quaternion, 1.0)
    return vector
