"""State of robot and ball from sensor readings alone."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.estimation.ball import BallEstimator
from ballsim_controllers.estimation.contacts import (
    NO_CONTACT,
    ContactEstimator,
    FootContact,
)
from ballsim_controllers.estimation.tilt import TiltFilter, TiltNoise
from ballsim_controllers.geometry import cross, rotation_to_quaternion
from ballsim_controllers.messages import (
    Array,
    BallParameters,
    SensorReading,
    StateEstimate,
)
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

__all__ = ["StateEstimator"]

#: Rate at which the ball's place follows the contacts, [1/s].
_PLACE_RATE = 40.0
#: Rate at which the CoM's velocity follows the kinematics, [1/s].
_COM_RATE = 40.0
#: Distance of a sole's plane from the ball above which it cannot touch, [m].
_CONTACT_GAP = 0.008


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
        self._robot = robot_model
        self._radius = ball.radius
        self._dt = dt
        self.stance = solve_nominal_stance(robot_model, ball.radius)
        self.nominal_com_height = self.stance.com_height
        self._ball = BallEstimator(ball.radius, dt)
        self._contacts = ContactEstimator(robot_model)
        self._tilt = TiltFilter(dt, robot_model.gravity, TiltNoise())
        model, imu = robot_model.model, robot_model.imu_id
        robot_model.update(self.stance.qpos, np.zeros(model.nv))
        data = robot_model.data
        trunk = data.xmat[robot_model.trunk_id].reshape(3, 3)
        self._imu_rotation = trunk.T @ data.site_xmat[imu].reshape(3, 3)
        self._imu_offset = trunk.T @ (
            data.site_xpos[imu] - data.xpos[robot_model.trunk_id]
        )
        self._qpos = np.zeros(model.nq)
        self._qvel = np.zeros(model.nv)
        #: From the ball's centre to the trunk, in the world, shape (3,), [m].
        self._trunk_from_ball: Array | None = None
        self._com_velocity: Array | None = None

    def update(self, reading: SensorReading) -> StateEstimate:
        """Return the estimate at the time of a reading.

        The robot model is left at the estimated configuration and velocity.
        """
        dt, robot = self._dt, self._robot
        ball, tilt = self._ball, self._tilt
        ball.update(reading.angular_velocity_ball)
        omega = self._imu_rotation @ reading.angular_velocity_imu
        tilt.predict(omega, self._imu_rotation @ reading.acceleration_imu)

        # Legs relative to a trunk at the origin and at rest.
        qpos, qvel = self._qpos, self._qvel
        qpos[:3] = 0.0
        qpos[3:7] = rotation_to_quaternion(tilt.rotation)
        qpos[7:] = reading.joint_positions
        qvel[:3] = 0.0
        qvel[3:6] = omega
        qvel[6:] = reading.joint_velocities
        robot.update(qpos, qvel)
        contacts = [
            self._contacts.estimate(i, reading.foot_forces[i], reading.foot_torques[i])
            if self._is_near_ball(i)
            else NO_CONTACT
            for i in range(2)
        ]
        place, velocity, confidence = self._legs(contacts)

        lever = tilt.rotation @ cross(omega, self._imu_offset)
        tilt.correct(velocity + lever, confidence)
        lever = tilt.rotation @ cross(omega, self._imu_offset)
        trunk_velocity = tilt.velocity - lever
        if self._trunk_from_ball is None:
            self._trunk_from_ball = place
        relative = self._trunk_from_ball + dt * (trunk_velocity - ball.linear_velocity)
        share = confidence * (1.0 - np.exp(-_PLACE_RATE * dt))
        self._trunk_from_ball = relative + share * (place - relative)

        qpos[:3] = ball.position + self._trunk_from_ball
        qpos[3:7] = rotation_to_quaternion(tilt.rotation)
        qvel[:3] = trunk_velocity
        robot.update(qpos, qvel)
        return self._assemble(reading.time, omega, contacts)

    def _is_near_ball(self, foot: int) -> bool:
        """Return whether a foot may touch the ball at all.

        The ankle sensor of a swinging foot shows the foot's own inertia, which
        must not be taken for a touchdown. The robot model's trunk is at the
        origin.
        """
        if self._trunk_from_ball is None:
            return True
        offset = self._robot.feet[foot].position + self._trunk_from_ball
        reach = self._radius + _CONTACT_GAP
        rotation = self._robot.feet[foot].rotation
        height = float(offset @ rotation[:, 2])
        return height < reach

    def _legs(self, contacts: list[FootContact]) -> tuple[Array, Array, float]:
        """Return trunk place over the ball, trunk velocity and confidence.

        Means over the feet, weighted by load and confidence. The robot model's
        trunk is at the origin and at rest.
        """
        robot, ball = self._robot, self._ball
        place, velocity, total = np.zeros(3), np.zeros(3), 0.0
        for i, contact in enumerate(contacts):
            weight = contact.confidence * contact.normal_force
            if weight <= 0.0:
                continue
            foot = robot.feet[i]
            arm = foot.rotation[:, :2] @ contact.offset
            point = foot.position + arm
            normal = foot.rotation[:, 2]
            place += weight * (self._radius * normal - point)
            surface = ball.linear_velocity + cross(
                ball.angular_velocity, self._radius * normal
            )
            swing = foot.linear_velocity + cross(foot.angular_velocity, arm)
            velocity += weight * (surface - swing)
            total += weight
        if total <= 0.0:
            last = self._trunk_from_ball
            return (np.zeros(3) if last is None else last), velocity, 0.0
        confidence = max(contact.confidence for contact in contacts)
        return place / total, velocity / total, confidence

    def _assemble(
        self, time: float, omega: Array, contacts: list[FootContact]
    ) -> StateEstimate:
        robot, ball = self._robot, self._ball
        kinematic = robot.com_velocity()
        force = contacts[0].force + contacts[1].force
        acceleration = force / robot.mass
        acceleration[2] -= robot.gravity
        if self._com_velocity is None:
            self._com_velocity = kinematic
        predicted = self._com_velocity + self._dt * acceleration
        share = 1.0 - np.exp(-_COM_RATE * self._dt)
        self._com_velocity = predicted + share * (kinematic - predicted)
        points = np.empty((2, 3))
        for i, contact in enumerate(contacts):
            foot = robot.feet[i]
            if contact.normal_force > 0.0:
                offset = contact.offset
            else:
                offset = (foot.rotation.T @ (ball.position - foot.position))[:2]
            points[i] = foot.position + foot.rotation[:, :2] @ offset
        normal = np.array([contact.normal_force for contact in contacts])
        load = float(normal.sum())
        cop = normal @ points[:, :2] / load if load > 1.0 else ball.position[:2].copy()
        return StateEstimate.of(
            time=time,
            quaternion_trunk_to_world=self._qpos[3:7].copy(),
            angular_velocity_trunk_in_trunk=omega.copy(),
            position_trunk_in_world=self._qpos[:3].copy(),
            linear_velocity_trunk_in_world=self._qvel[:3].copy(),
            position_com_in_world=robot.position_com_in_world,
            linear_velocity_com_in_world=self._com_velocity.copy(),
            position_ball_in_world=ball.position.copy(),
            linear_velocity_ball_in_world=ball.linear_velocity.copy(),
            angular_velocity_ball_in_world=ball.angular_velocity.copy(),
            contacts_in_world=points,
            normal_forces=normal,
            cop_in_world=cop,
        )
