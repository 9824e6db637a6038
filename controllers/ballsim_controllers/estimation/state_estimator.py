"""State of robot and ball from sensor readings alone."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.ball import BallEstimator, update_ball
from ballsim_controllers.estimation.contacts import (
    CONTACT,
    ContactEstimator,
    clear_contact,
    estimate_contact,
)
from ballsim_controllers.estimation.levelling import level, make_level
from ballsim_controllers.estimation.tilt import (
    TiltFilter,
    TiltNoise,
    correct_tilt,
    predict_tilt,
)
from ballsim_controllers.geometry import (
    apply,
    apply_transposed,
    cross,
    rotation_to_quaternion,
)
from ballsim_controllers.messages import (
    ESTIMATE,
    Array,
    BallParameters,
    Record,
    SensorReading,
    StateEstimate,
)
from ballsim_controllers.native import view_1d, view_2d
from ballsim_controllers.robot_kinematics import com_velocity, refresh_kinematics
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

__all__ = ["StateEstimator", "update_estimate"]

#: Rate at which the ball's place follows the contacts, [1/s].
_PLACE_RATE = 40.0
#: Rate at which the CoM's velocity follows the kinematics, [1/s].
_COM_RATE = 40.0
#: Distance of a sole's plane from the ball above which it cannot touch, [m].
_CONTACT_GAP = 0.008

#: What the fusion depends on and what it keeps from tick to tick.
_FUSION = np.dtype(
    [
        ("dt", np.float64),
        ("radius", np.float64),
        ("rotation_imu_to_trunk", np.float64, (3, 3)),
        ("position_imu_in_trunk", np.float64, 3),
        ("place_share", np.float64),
        ("com_share", np.float64),
        ("angular_velocity_trunk", np.float64, 3),  # in the trunk
        ("mean_angular_velocity_trunk", np.float64, 3),  # since the last reading
        ("half_step", np.float64, 3),  # what the IMU's velocity gains in half a period
        ("linear_velocity_trunk", np.float64, 3),  # in the world
        ("has_place", np.int64),
        ("trunk_from_ball", np.float64, 3),  # ball's centre to trunk, in the world
        ("has_com_velocity", np.int64),
        ("com_velocity", np.float64, 3),
    ]
)


class StateEstimator:
    """Fuses ball gyro, trunk IMU, encoders and ankle sensors.

    1. The ball's gyro gives its motion (`BallEstimator`).
    2. Gyro and accelerometer predict the trunk's attitude and velocity; the
       standing legs, which roll on the ball without slip, correct them
       (`TiltFilter`).
    3. The ankle sensors give each contact point; with the leg's kinematics and
       the sole's normal it locates the ball below the trunk.
    4. The CoM's velocity follows Newton's law with the measured contact forces
       and is held to the kinematics.

    Nothing is known at the start but the nominal standing pose: upright, at
    rest, the ball under the feet as far as the first reading shows.

    Args:
        robot_model: The robot; refreshed by each update.
        ball: Parameters of the ball.
        dt: Control period, [s].
    """

    def __init__(
        self, robot_model: RobotModel, ball: BallParameters, dt: float
    ) -> None:
        """Build the parts."""
        self._robot = robot = robot_model
        self.stance = solve_nominal_stance(robot, ball.radius)
        self.nominal_com_height = self.stance.com_height
        self._ball = BallEstimator(ball.radius, dt)
        self._tilt = TiltFilter(dt, robot.gravity, TiltNoise())
        model, data, imu = robot.model, robot.data, robot.imu_id
        robot.update(self.stance.qpos, np.zeros(model.nv))
        trunk = data.xmat[robot.trunk_id].reshape(3, 3)
        self._fusion: Record = np.zeros(1, _FUSION)
        for name, value in (
            ("dt", dt),
            ("radius", ball.radius),
            ("rotation_imu_to_trunk", trunk.T @ data.site_xmat[imu].reshape(3, 3)),
            (
                "position_imu_in_trunk",
                trunk.T @ (data.site_xpos[imu] - data.xpos[robot.trunk_id]),
            ),
            ("place_share", 1.0 - np.exp(-_PLACE_RATE * dt)),
            ("com_share", 1.0 - np.exp(-_COM_RATE * dt)),
        ):
            self._fusion[name] = value
        contacts: Record = np.zeros(2, CONTACT)
        #: What `update_estimate` takes beside estimate and reading.
        self.arguments = (
            self._fusion,
            self._ball.state,
            self._tilt.state,
            make_level(dt),
            contacts,
            ContactEstimator(robot).parameters,
            robot.record,
        )

    def update(self, reading: SensorReading) -> StateEstimate:
        """Return the estimate at the time of a reading.

        The robot model is left at the estimated configuration and velocity.
        """
        estimate: Record = np.empty(1, ESTIMATE)
        update_estimate(estimate, reading.record, *self.arguments)
        return StateEstimate(estimate)


@compiled
def update_estimate(
    estimates: Record,
    readings: Record,
    fusions: Record,
    balls: Record,
    tilts: Record,
    levels: Record,
    contacts: Record,
    foot_parameters: Record,
    robots: Record,
) -> None:
    """Advance everything by a reading and write the estimate.

    Args:
        estimates: The estimate, shape (1,), dtype `ESTIMATE`.
        readings: The reading, shape (1,), dtype of `reading_dtype`.
        fusions: Constants and state of the fusion, shape (1,), dtype `_FUSION`.
        balls: State of the ball's estimator, shape (1,), dtype `BALL_STATE`.
        tilts: State of the tilt filter, shape (1,), dtype `TILT_STATE`.
        levels: State of the levelling, shape (1,), dtype `LEVEL`.
        contacts: Contact of each foot, shape (2,), dtype `CONTACT`.
        foot_parameters: Shape (2,), dtype `FOOT_PARAMETERS`.
        robots: The robot, shape (1,), dtype of `robot_dtype`.
    """
    # Legs relative to a trunk at the origin and at rest.
    _predict(readings, fusions, balls, tilts, levels[0]["bias"], robots)
    refresh_kinematics(robots)
    _correct(readings, fusions, balls, tilts, contacts, foot_parameters, robots)
    refresh_kinematics(robots)
    kinematic = _assemble(estimates, readings, fusions, balls, contacts, robots)
    robot = robots[0]
    level(
        levels, tilts, estimates, contacts, kinematic, robot["mass"], robot["gravity"]
    )


@compiled
def _predict(
    readings: Record,
    fusions: Record,
    balls: Record,
    tilts: Record,
    bias: Array,
    robots: Record,
) -> None:
    """Predict with the gyros; write the pose of a trunk at the origin, at rest."""
    reading, fusion, robot = readings[0], fusions[0], robots[0]
    qpos, qvel = (
        view_1d(robot["qpos"], robot["nv"] + 1),
        view_1d(robot["qvel"], robot["nv"]),
    )
    dt = fusion["dt"]
    update_ball(balls, reading["angular_velocity_ball"], fusion["radius"], dt)
    mounting = fusion["rotation_imu_to_trunk"]
    omega = apply(mounting, reading["angular_velocity_imu"])
    fusion["angular_velocity_trunk"][:] = omega
    force = apply(mounting, reading["acceleration_imu"]) - bias
    # The joints' velocities are means since the last reading: so are all that are
    # added to them.
    mean, last = fusion["mean_angular_velocity_trunk"], tilts[0]["gyro"]
    has_started = tilts[0]["has_started"] != 0
    for i in range(3):
        mean[i] = 0.5 * (last[i] + omega[i]) if has_started else omega[i]
    predict_tilt(tilts, omega, force, dt, robot["gravity"])
    gain = 0.5 * dt if has_started else 0.0
    fusion["half_step"][:] = gain * apply(tilts[0]["rotation"], force)
    fusion["half_step"][2] -= gain * robot["gravity"]
    qpos[:3] = 0.0
    qpos[3:7] = rotation_to_quaternion(tilts[0]["rotation"])
    qpos[7:] = reading["joint_positions"]
    qvel[:3] = 0.0
    qvel[3:6] = mean
    qvel[6:] = reading["joint_velocities"]


@compiled
def _correct(
    readings: Record,
    fusions: Record,
    balls: Record,
    tilts: Record,
    contacts: Record,
    foot_parameters: Record,
    robots: Record,
) -> None:
    """Correct tilt and velocity with the standing legs; write the trunk's state."""
    reading, fusion, ball, tilt = readings[0], fusions[0], balls[0], tilts[0]
    robot = robots[0]
    feet, nv = robot["feet"], robot["nv"]
    site_xpos = view_2d(robot["site_xpos"], robot["n_sites"], 3)
    site_xmat = view_2d(robot["site_xmat"], robot["n_sites"], 9)
    xipos = view_2d(robot["xipos"], robot["n_bodies"], 3)
    qpos, qvel = view_1d(robot["qpos"], nv + 1), view_1d(robot["qvel"], nv)
    for i in range(2):
        site = robot["wrench_sites"][i]
        if _is_near_ball(feet["position"][i], feet["rotation"][i], fusion):
            estimate_contact(
                contacts[i],
                reading["foot_forces"][i],
                reading["foot_torques"][i],
                site_xpos[site],
                site_xmat[site].reshape(3, 3),
                xipos[robot["foot_bodies"][i]],
                feet["position"][i],
                feet["rotation"][i],
                foot_parameters[i],
            )
        else:
            clear_contact(contacts[i])
    place, velocity, confidence = _fuse_legs(contacts, feet, ball, fusion)

    # The legs' velocity is half a period old: it is brought forward with the IMU.
    position, half_step = fusion["position_imu_in_trunk"], fusion["half_step"]
    lever = cross(fusion["angular_velocity_trunk"], position)
    mean_lever = cross(fusion["mean_angular_velocity_trunk"], position)
    measured = velocity + apply(tilt["rotation"], mean_lever) + half_step
    correct_tilt(tilts, measured, confidence)
    trunk_velocity = tilt["velocity"] - apply(tilt["rotation"], lever)
    fusion["linear_velocity_trunk"][:] = trunk_velocity
    mean_velocity = tilt["velocity"] - half_step - apply(tilt["rotation"], mean_lever)
    relative = fusion["trunk_from_ball"]
    if fusion["has_place"] == 0:
        fusion["has_place"] = 1
        relative[:] = place
    share = confidence * fusion["place_share"]
    for i in range(3):
        moved = trunk_velocity[i] - ball["linear_velocity"][i]
        predicted = relative[i] + fusion["dt"] * moved
        relative[i] = predicted + share * (place[i] - predicted)
        qpos[i] = ball["position"][i] + relative[i]
        qvel[i] = mean_velocity[i]
    qpos[3:7] = rotation_to_quaternion(tilt["rotation"])


@compiled
def _is_near_ball(position: Array, rotation: Array, fusion: Record) -> bool:
    """Return whether a foot may touch the ball at all.

    The ankle sensor of a swinging foot shows the foot's own inertia, which
    must not be taken for a touchdown. The robot model's trunk is at the origin.

    Args:
        position: Centre of the sole from the trunk, in the world, (3,), [m].
        rotation: Sole to world, shape (3, 3).
        fusion: State of the fusion.
    """
    if fusion["has_place"] == 0:
        return True
    height = 0.0
    for i in range(3):
        height += (position[i] + fusion["trunk_from_ball"][i]) * rotation[i, 2]
    return bool(height < fusion["radius"] + _CONTACT_GAP)


@compiled
def _fuse_legs(
    contacts: Record, feet: Record, ball: Record, fusion: Record
) -> tuple[Array, Array, float]:
    """Return trunk place over the ball, trunk velocity and confidence.

    Means over the feet, weighted by load and confidence. The robot model's
    trunk is at the origin and at rest.
    """
    radius = fusion["radius"]
    place, velocity, total, confidence = np.zeros(3), np.zeros(3), 0.0, 0.0
    for i in range(2):
        contact = contacts[i]
        weight = contact["confidence"] * contact["normal_force"]
        if weight <= 0.0:
            continue
        rotation = feet["rotation"][i]
        normal, arm = np.empty(3), np.empty(3)
        for j in range(3):
            normal[j] = radius * rotation[j, 2]
            arm[j] = (
                rotation[j, 0] * contact["offset"][0]
                + rotation[j, 1] * contact["offset"][1]
            )
        surface = cross(ball["mean_angular_velocity"], normal)
        swing = cross(feet["angular_velocity"][i], arm)
        for j in range(3):
            place[j] += weight * (normal[j] - feet["position"][i, j] - arm[j])
            velocity[j] += weight * (
                ball["mean_linear_velocity"][j]
                + surface[j]
                - feet["linear_velocity"][i, j]
                - swing[j]
            )
        total += weight
        confidence = max(confidence, contact["confidence"])
    if total <= 0.0:
        return fusion["trunk_from_ball"].copy(), velocity, 0.0
    return place / total, velocity / total, confidence


@compiled
def _assemble(
    estimates: Record,
    readings: Record,
    fusions: Record,
    balls: Record,
    contacts: Record,
    robots: Record,
) -> Array:
    """Advance the CoM's velocity, write the estimate, return the kinematic velocity."""
    estimate, fusion, ball, robot = estimates[0], fusions[0], balls[0], robots[0]
    feet, nv = robot["feet"], robot["nv"]
    qpos = view_1d(robot["qpos"], nv + 1)
    com = view_1d(robot["subtree_com"], 3)
    kinematic = com_velocity(robots)
    velocity = fusion["com_velocity"]
    if fusion["has_com_velocity"] == 0:
        fusion["has_com_velocity"] = 1
        velocity[:] = kinematic
    for i in range(3):
        force = contacts[0]["force"][i] + contacts[1]["force"][i]
        acceleration = force / robot["mass"] - (robot["gravity"] if i == 2 else 0.0)
        kinematic[i] += 0.5 * fusion["dt"] * acceleration
        predicted = velocity[i] + fusion["dt"] * acceleration
        velocity[i] = predicted + fusion["com_share"] * (kinematic[i] - predicted)

    load = 0.0
    cop = np.zeros(2)
    for i in range(2):
        contact, rotation = contacts[i], feet["rotation"][i]
        position = feet["position"][i]
        x, y = contact["offset"][0], contact["offset"][1]
        if contact["normal_force"] <= 0.0:
            to_ball = apply_transposed(rotation, ball["position"] - position)
            x, y = to_ball[0], to_ball[1]
        for j in range(3):
            place = position[j] + rotation[j, 0] * x + rotation[j, 1] * y
            estimate["contacts_in_world"][i, j] = place
            if j < 2:
                cop[j] += contact["normal_force"] * place
        estimate["normal_forces"][i] = contact["normal_force"]
        load += contact["normal_force"]
    for j in range(2):
        estimate["cop_in_world"][j] = (
            cop[j] / load if load > 1.0 else ball["position"][j]
        )
    estimate["time"] = readings[0]["time"]
    estimate["quaternion_trunk_to_world"][:] = qpos[3:7]
    estimate["angular_velocity_trunk_in_trunk"][:] = fusion["angular_velocity_trunk"]
    estimate["position_trunk_in_world"][:] = qpos[:3]
    estimate["linear_velocity_trunk_in_world"][:] = fusion["linear_velocity_trunk"]
    estimate["position_com_in_world"][:] = com
    estimate["linear_velocity_com_in_world"][:] = velocity
    estimate["position_ball_in_world"][:] = ball["position"]
    estimate["linear_velocity_ball_in_world"][:] = ball["linear_velocity"]
    estimate["angular_velocity_ball_in_world"][:] = ball["angular_velocity"]
    return kinematic
