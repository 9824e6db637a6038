"""A robot that stands at rest: its estimator and what its sensors read."""

from __future__ import annotations

import numpy as np

from ballsim.config import Config
from ballsim.paths import robot_description_path
from ballsim.sensor_sheet import find_sensor_figures
from ballsim_controllers.estimation.state_estimator import StateEstimator
from ballsim_controllers.geometry import apply_transposed, cross
from ballsim_controllers.messages import BallParameters, SensorReading
from ballsim_controllers.robot import load_robot_description
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.settings import WheeledLipSettings, load_settings

__all__ = ["make_estimator", "make_standing_reading"]


def make_estimator(config: Config) -> tuple[StateEstimator, RobotModel]:
    """Return an estimator that has seen no reading yet, and its robot."""
    ball = config.ball
    own = {k: v for k, v in config.controller.settings.items() if k == "estimation"}
    settings = load_settings(WheeledLipSettings, "wheeled-lip", own)
    com_offset = settings.estimation.com_offset_m
    robot = RobotModel(
        load_robot_description(robot_description_path(config.robot.name)),
        has_own_model=com_offset > 0.0,
    )
    believed = BallParameters(
        ball.believed_radius_scale * ball.radius,
        ball.believed_mass_scale * ball.mass,
        ball.believed_inertia_scale * ball.moment_of_inertia,
    )
    period = config.simulation.control_period
    figures = find_sensor_figures(config.sensors, period)
    return StateEstimator(robot, believed, period, figures, com_offset), robot


def make_standing_reading(
    estimator: StateEstimator, robot: RobotModel, left_share: float = 0.5
) -> SensorReading:
    """Return what perfect sensors read in the nominal stance.

    The ball bears the feet vertically at the centres of the soles, which are below the
    CoM as seen from the side, and symmetric to it as seen from ahead.

    Args:
        estimator: Knows the stance.
        robot: The robot; left in the stance.
        left_share: Share of the weight on the left foot: a half at rest.
    """
    model, data = robot.model, robot.data
    robot.update(estimator.stance.qpos, np.zeros(model.nv))
    forces, torques = np.empty((2, 3)), np.empty((2, 3))
    up = np.array([0.0, 0.0, robot.gravity])
    for i, site in enumerate(robot.wrench_ids):
        weight, sole = -robot.foot_masses[i] * up, robot.feet[i].position
        share = left_share if i == 0 else 1.0 - left_share
        force = -share * robot.mass * up - weight
        torque = -cross(data.site_xpos[site] - sole, force) - cross(
            data.xipos[robot.foot_body_ids[i]] - sole, weight
        )
        rotation = data.site_xmat[site].reshape(3, 3)
        forces[i] = apply_transposed(rotation, force)
        torques[i] = apply_transposed(rotation, torque)
    imu = data.site_xmat[robot.imu_id].reshape(3, 3)
    return SensorReading.of(
        time=0.0,
        joint_positions=estimator.stance.qpos[7:],
        joint_velocities=np.zeros(robot.joint_count),
        angular_velocity_imu=np.zeros(3),
        acceleration_imu=apply_transposed(imu, up),
        foot_forces=forces,
        foot_torques=torques,
        angular_velocity_ball=np.zeros(3),
    )
