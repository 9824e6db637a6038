"""Laws of the contacts that are found from the ankles' wrenches."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ballsim_controllers.estimation.contacts import ContactEstimator
from ballsim_controllers.estimation.state_estimator import StateEstimator
from ballsim_controllers.messages import Array, BallParameters, SensorReading
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance


def stand_somewhere(robot: RobotModel, seed: int) -> None:
    """Put the robot into a posture with tilted soles, at rest, somewhere."""
    generator = np.random.default_rng(seed)
    qpos = solve_nominal_stance(robot, 0.5).qpos.copy()
    qpos[:3] += generator.normal(size=3)
    turn = Rotation.from_rotvec(0.15 * generator.normal(size=3)).as_quat()
    qpos[3:7] = turn[[3, 0, 1, 2]]
    qpos[7:] += generator.normal(scale=0.1, size=18)
    robot.update(qpos, np.zeros(robot.model.nv))


def ankle_wrench(
    robot: RobotModel, foot: int, force: Array, point: Array
) -> tuple[Array, Array]:
    """Return what the ankle sensor of a foot at rest reads for a force at a point.

    The foot is in balance: shank, ball and weight act on it.
    """
    data, site = robot.data, robot.wrench_ids[foot]
    origin, rotation = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
    mass = robot.model.body_mass[robot.foot_body_ids[foot]]
    weight = np.array([0.0, 0.0, -mass * robot.gravity])
    centre = data.xipos[robot.foot_body_ids[foot]]
    shank_force = -force - weight
    shank_torque = -np.cross(point - origin, force) - np.cross(centre - origin, weight)
    return rotation.T @ shank_force, rotation.T @ shank_torque


@pytest.mark.parametrize("foot", [0, 1])
def test_contact_is_found_from_the_ankle(robot: RobotModel, foot: int) -> None:
    """A force at a known point of the sole is found, force and point."""
    generator = np.random.default_rng(1)
    estimator = ContactEstimator(robot)
    for seed in range(10):
        stand_somewhere(robot, seed)
        sole = robot.feet[foot]
        offset = generator.uniform(-1.0, 1.0, 2) * [0.09, 0.038]
        local = np.array([*generator.normal(scale=60.0, size=2), 320.0])
        force = sole.rotation @ local
        point = sole.position + sole.rotation[:, :2] @ offset
        contact = estimator.estimate(foot, *ankle_wrench(robot, foot, force, point))
        np.testing.assert_allclose(contact.force, force, atol=1e-9)
        assert contact.normal_force == pytest.approx(320.0, abs=1e-9)
        np.testing.assert_allclose(contact.offset, offset, atol=1e-9)
        assert contact.confidence == 1.0


def test_contact_stays_in_the_sole(robot: RobotModel) -> None:
    """A CoP computed beyond the sole is put on its edge, and hardly trusted."""
    stand_somewhere(robot, 0)
    estimator, sole = ContactEstimator(robot), robot.feet[0]
    half = (robot.robot.sole_half_length, robot.robot.sole_half_width)
    trusts = []
    for outside in (-0.01, -0.002, 0.0, 0.05):
        point = sole.position + sole.rotation[:, 0] * (half[0] + outside)
        wrench = ankle_wrench(robot, 0, 300.0 * sole.rotation[:, 2], point)
        contact = estimator.estimate(0, *wrench)
        assert contact.offset[0] == pytest.approx(min(half[0] + outside, half[0]))
        trusts.append(contact.confidence)
    assert trusts[0] == 1.0
    assert trusts[1] == pytest.approx(0.5)
    assert trusts[2] == trusts[3] == pytest.approx(0.01)


def test_unloaded_foot_has_no_contact(robot: RobotModel) -> None:
    """A hanging foot carries nothing; light loads are half trusted."""
    stand_somewhere(robot, 1)
    estimator, sole = ContactEstimator(robot, full_load=60.0), robot.feet[1]
    for load, confidence in ((0.0, 0.0), (-20.0, 0.0), (30.0, 0.5), (200.0, 1.0)):
        wrench = ankle_wrench(robot, 1, load * sole.rotation[:, 2], sole.position)
        contact = estimator.estimate(1, *wrench)
        assert contact.normal_force == pytest.approx(max(load, 0.0), abs=1e-9)
        assert contact.confidence == pytest.approx(confidence)
        np.testing.assert_allclose(contact.offset, 0.0, atol=1e-9)


def standing_reading(
    robot: RobotModel, qpos: Array, swing: int | None
) -> SensorReading:
    """Return what a robot at rest reads, one foot in the air if asked for."""
    robot.update(qpos, np.zeros(robot.model.nv))
    forces, torques = np.empty((2, 3)), np.empty((2, 3))
    for i, foot in enumerate(robot.feet):
        load = 318.0 if i != swing else 0.0
        forces[i], torques[i] = ankle_wrench(
            robot, i, load * foot.rotation[:, 2], foot.position
        )
    return SensorReading.of(
        time=0.0,
        joint_positions=qpos[7:].copy(),
        joint_velocities=np.zeros(18),
        angular_velocity_imu=np.zeros(3),
        acceleration_imu=np.array([0.0, 0.0, robot.gravity]),
        foot_forces=forces,
        foot_torques=torques,
        angular_velocity_ball=np.zeros(3),
    )


def test_inertia_of_a_lifted_foot_is_no_contact(robot: RobotModel) -> None:
    """A force on a foot that is clear of the ball is its own inertia, not a load."""
    qpos = solve_nominal_stance(robot, 0.5).qpos
    estimator = StateEstimator(robot, BallParameters(0.5, 40.0, 0.5), 0.004)
    lifted = qpos.copy()
    knee, hip = (robot.joint_names.index(f"right_{j}") for j in ("knee", "hip_pitch"))
    lifted[7 + knee] += 0.3
    lifted[7 + hip] -= 0.15
    reading = standing_reading(robot, qpos, None)
    standing = estimator.update(reading)
    assert (standing.normal_forces > 300.0).all()
    swinging = standing_reading(robot, lifted, 1)
    forces = swinging.foot_forces.copy()
    forces[1, 2] -= 80.0  # the shank pushes the foot down
    estimate = estimator.update(swinging.changed(foot_forces=forces))
    assert estimate.normal_forces[0] > 300.0
    assert estimate.normal_forces[1] == 0.0
    # The same force on the same foot near the ball counts.
    near = standing_reading(robot, qpos, 1)
    forces = near.foot_forces.copy()
    forces[1, 2] -= 80.0
    estimate = estimator.update(near.changed(foot_forces=forces))
    assert estimate.normal_forces[1] == pytest.approx(80.0, abs=5.0)
