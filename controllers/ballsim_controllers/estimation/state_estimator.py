"""State of robot and ball from sensor readings alone."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.estimation.ball import BallEstimator, update_ball
from ballsim_controllers.estimation.contacts import (
    CONTACT,
    ContactEstimator,
    clear_contact,
    estimate_contact,
    place_loads,
)
from ballsim_controllers.estimation.corrections import TILT_STATE
from ballsim_controllers.estimation.error_covariance import (
    Levers,
    advance_covariance,
    make_covariance,
)
from ballsim_controllers.estimation.floor_balance import find_offset, prepare_offset
from ballsim_controllers.estimation.legs import (
    FUSION,
    fuse_legs,
    is_near_ball,
    move_com,
    share_of_rate,
)
from ballsim_controllers.estimation.levelling import level
from ballsim_controllers.estimation.rolling import make_level, roll
from ballsim_controllers.estimation.tilt import correct_tilt, predict_tilt
from ballsim_controllers.geometry import (
    apply,
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
from ballsim_controllers.robot_kinematics import (
    angular_momentum,
    com_velocity,
    move_mass,
    refresh_kinematics,
)
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.sensor_figures import SensorFigures
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

__all__ = ["StateEstimator", "update_estimate"]

#: Rate at which the ball's place follows the contacts, [1/s].
_PLACE_RATE = 40.0
#: Rate at which the CoM's velocity follows the kinematics, [1/s].
_COM_RATE = 40.0


class StateEstimator:
    """Fuses ball gyro, trunk IMU, encoders and ankle sensors.

    1. The ball's gyro gives its motion (`ball`).
    2. Gyro and accelerometer predict the trunk's attitude and velocity; the
       standing legs, which roll on the ball without slip, correct them (`tilt`).
    3. The ankle sensors give each contact point; with the leg's kinematics and
       the sole's normal it locates the ball below the trunk (`contacts`, `legs`).
    4. The contact forces' moment about the CoM tells the vertical (`levelling`), soles
       that roll on the ball directions and the ball's gyro (`rolling`, `heading`).
    5. Momentum about the ball's foot on the floor tells what of the place over the ball
       contacts and soles get wrong (`floor_balance`).
    6. The CoM's velocity follows Newton's law with the measured contact forces
       and is held to the kinematics.

    One covariance of all errors along a horizontal axis gives the gains of 2 to 4,
    biases and the CoM's offset included (`error_covariance`).

    Nothing is known at the start but the nominal standing pose: upright, at
    rest, the ball under the feet as far as the first reading shows.

    Args:
        robot_model: The robot; refreshed by each update.
        ball: Parameters of the ball.
        dt: Control period, [s].
        figures: What the data sheets of the sensors say; nothing is known if None.
        com_offset: One sigma of the CoM's place along each horizontal axis of the
            trunk, [m]; estimated if above 0.

    Raises:
        InvalidSettingError: It is above 0, but others share the robot's model.
    """

    def __init__(
        self,
        robot_model: RobotModel,
        ball: BallParameters,
        dt: float,
        figures: SensorFigures | None = None,
        com_offset: float = 0.0,
    ) -> None:
        """Build the parts."""
        if com_offset > 0.0 and not robot_model.has_own_model:
            valid = "0 for a robot whose model is shared"
            raise InvalidSettingError("com_offset", com_offset, valid)
        figures = figures or SensorFigures()
        self._robot = robot = robot_model
        self.stance = solve_nominal_stance(robot, ball.radius)
        self.nominal_com_height = self.stance.com_height
        self._ball = BallEstimator(ball.radius, dt)
        tilts: Record = np.zeros(1, TILT_STATE)
        tilts["rotation"] = np.eye(3)
        model, data, imu = robot.model, robot.data, robot.imu_id
        robot.update(self.stance.qpos, np.zeros(model.nv))
        trunk = data.xmat[robot.trunk_id].reshape(3, 3)
        self._fusion: Record = np.zeros(1, FUSION)
        for name, value in (
            ("dt", dt),
            ("radius", ball.radius),
            ("rotation_imu_to_trunk", trunk.T @ data.site_xmat[imu].reshape(3, 3)),
            (
                "position_imu_in_trunk",
                trunk.T @ (data.site_xpos[imu] - data.xpos[robot.trunk_id]),
            ),
            ("trunk_rate_share", share_of_rate(figures.gyro_noise, dt)),
            ("ball_rate_share", share_of_rate(figures.ball_gyro_noise, dt)),
            ("place_share", 1.0 - np.exp(-_PLACE_RATE * dt)),
            ("com_share", 1.0 - np.exp(-_COM_RATE * dt)),
            ("leg_trust", 1.0),
        ):
            self._fusion[name] = value
        contacts: Record = np.zeros(2, CONTACT)
        top = 2.0 * ball.radius
        imu_height = float(data.site_xpos[imu][2])
        trunk_height = float(data.xpos[robot.trunk_id][2])
        levers = Levers(
            imu_over_contact=imu_height - top,
            imu_over_trunk=imu_height - trunk_height,
            trunk_over_ball=trunk_height - ball.radius,
            com_over_contact=self.nominal_com_height,
            radius=ball.radius,
        )
        covariances = make_covariance(
            dt,
            robot.gravity,
            robot.mass * robot.gravity,
            levers,
            figures,
            com_offset,
        )
        levels = make_level(dt, figures, levers)
        prepare_offset(levels, figures, ball, robot.mass)
        #: What `update_estimate` takes beside estimate and reading.
        self.arguments = (
            self._fusion,
            self._ball.state,
            tilts,
            levels,
            covariances,
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
    covariances: Record,
    contacts: Record,
    foot_parameters: Record,
    robots: Record,
) -> None:
    """Advance everything by a reading and write the estimate.

    Args:
        estimates: The estimate, shape (1,), dtype `ESTIMATE`.
        readings: The reading, shape (1,), dtype of `reading_dtype`.
        fusions: Constants and state of the fusion, shape (1,), dtype `FUSION`.
        balls: State of the ball's estimator, shape (1,), dtype `BALL_STATE`.
        tilts: State of the tilt filter, shape (1,), dtype `TILT_STATE`.
        levels: State of levelling and rolling, shape (1,), dtype `LEVEL`.
        covariances: Of the errors, shape (1,), dtype `COVARIANCE`.
        contacts: Contact of each foot, shape (2,), dtype `CONTACT`.
        foot_parameters: Shape (2,), dtype `FOOT_PARAMETERS`.
        robots: The robot, shape (1,), dtype of `robot_dtype`.
    """
    move_mass(robots, levels[0]["com_offset"])
    # Legs relative to a trunk at the origin and at rest.
    _predict(readings, fusions, balls, tilts, robots)
    refresh_kinematics(robots)
    advance_covariance(covariances)
    _correct(
        readings,
        fusions,
        balls,
        tilts,
        levels,
        covariances,
        contacts,
        foot_parameters,
        robots,
    )
    # From here on the present rate counts, where its noise has to be smoothed.
    if fusions[0]["trunk_rate_share"] < 1.0:
        rates = view_1d(robots[0]["qvel"], robots[0]["nv"])[3:6]
        rates[:] = fusions[0]["angular_velocity_trunk"]
    refresh_kinematics(robots)
    kinematic = _assemble(estimates, readings, fusions, balls, contacts, robots)
    # The forces are held against the legs alone, not against what the IMU made of them.
    robot, fusion, trunk = robots[0], fusions[0], np.empty(3)
    for i in range(3):
        trunk[i] = estimates[0]["linear_velocity_trunk_in_world"][i]
        kinematic[i] += fusion["leg_velocity"][i] - trunk[i]
    turning = angular_momentum(robots)
    is_balance = level(
        levels,
        tilts,
        balls,
        covariances,
        estimates,
        contacts,
        kinematic,
        turning,
        fusion["confidence"],
        robot["mass"],
        robot["gravity"],
    )
    find_offset(levels, estimates, turning, is_balance, robots)
    height = fusion["trunk_from_ball"][2]
    roll(levels, tilts, balls, covariances, fusion, trunk, height)


@compiled
def _predict(
    readings: Record,
    fusions: Record,
    balls: Record,
    tilts: Record,
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
    tilt = tilts[0]
    omega = apply(mounting, reading["angular_velocity_imu"]) - tilt["gyro_bias"]
    smooth = fusion["angular_velocity_trunk"]
    spin, share = fusion["angular_velocity_ball"], fusion["ball_rate_share"]
    if tilt["has_started"] == 0:
        smooth[:], spin[:] = omega, balls[0]["angular_velocity"]
    for i in range(3):
        smooth[i] += fusion["trunk_rate_share"] * (omega[i] - smooth[i])
        spin[i] += share * (balls[0]["angular_velocity"][i] - spin[i])
    force = apply(mounting, reading["acceleration_imu"]) - tilt["accelerometer_bias"]
    # The joints' velocities are means since the last reading: so are all that are
    # added to them.
    mean, last = omega.copy(), tilt["gyro"]
    if tilt["has_started"] != 0:
        for i in range(3):
            mean[i] = 0.5 * (last[i] + omega[i])
    predict_tilt(tilts, omega, force, dt, robot["gravity"])
    qpos[:3] = 0.0
    qpos[3:7] = rotation_to_quaternion(tilt["rotation"])
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
    levels: Record,
    covariances: Record,
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
        if is_near_ball(feet["position"][i], feet["rotation"][i], fusion):
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
    place, velocity, confidence = fuse_legs(
        contacts, feet, ball, fusion, tilt["rotation"]
    )

    # The IMU is not at the trunk's origin. Velocities are means since the last reading,
    # as those of joints and gyros are.
    lever = cross(qvel[3:6], fusion["position_imu_in_trunk"])
    correct_tilt(
        tilts,
        levels,
        balls,
        covariances,
        velocity + apply(tilt["rotation"], lever),
        confidence,
        fusion["dt"],
    )
    fusion["place"][:] = place
    fusion["leg_velocity"][:] = velocity
    fusion["confidence"] = confidence
    arm = apply(tilt["rotation"], lever)
    relative = fusion["trunk_from_ball"]
    if fusion["has_place"] == 0:
        fusion["has_place"] = 1
        relative[:] = place
    share = confidence * fusion["place_share"]
    for i in range(3):
        trunk = 0.5 * (tilt["last_velocity"][i] + tilt["velocity"][i]) - arm[i]
        predicted = relative[i] + fusion["dt"] * (
            trunk - ball["mean_linear_velocity"][i]
        )
        relative[i] = predicted + share * (place[i] - predicted)
        qpos[i] = ball["position"][i] + relative[i]
        if i < 2:
            qpos[i] += levels[0]["offset"][i]
        qvel[i] = trunk
    qpos[3:7] = rotation_to_quaternion(tilt["rotation"])


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
    qpos, qvel = view_1d(robot["qpos"], nv + 1), view_1d(robot["qvel"], nv)
    com = view_1d(robot["subtree_com"], 3)
    kinematic = com_velocity(robots)
    move_com(fusion, contacts, kinematic, robot["mass"], robot["gravity"])
    place_loads(estimate, contacts, feet, ball["position"])
    estimate["time"] = readings[0]["time"]
    estimate["quaternion_trunk_to_world"][:] = qpos[3:7]
    estimate["angular_velocity_trunk_in_trunk"][:] = fusion["angular_velocity_trunk"]
    estimate["position_trunk_in_world"][:] = qpos[:3]
    estimate["linear_velocity_trunk_in_world"][:] = qvel[:3]
    estimate["position_com_in_world"][:] = com
    estimate["linear_velocity_com_in_world"][:] = fusion["com_velocity"]
    estimate["position_ball_in_world"][:] = ball["position"]
    spin = fusion["angular_velocity_ball"]
    estimate["angular_velocity_ball_in_world"][:] = spin
    estimate["linear_velocity_ball_in_world"][0] = fusion["radius"] * spin[1]
    estimate["linear_velocity_ball_in_world"][1] = -fusion["radius"] * spin[0]
    estimate["linear_velocity_ball_in_world"][2] = 0.0
    return kinematic
