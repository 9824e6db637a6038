"""What the readings tell the estimator that it did not expect, read from outside.

Each is an innovation times the gain that its filter applies: what the correction has
moved. The gain cancels in the normalised square, NIS.
"""

from __future__ import annotations

import numpy as np

from ballsim.error_model.snapshots import FUSION, TILT, Snapshot
from ballsim_controllers.estimation.state_estimator import StateEstimator
from ballsim_controllers.estimation.tilt import predict_tilt
from ballsim_controllers.messages import Array, Record

__all__ = ["INNOVATIONS", "compute_innovations"]

#: Number of components of each.
INNOVATIONS = {
    "trunk_velocity_innovation": 3,  # of the IMU's, by the legs
    "trunk_place_innovation": 3,  # over the ball, by contacts and soles
    "com_velocity_innovation": 3,  # by legs and ball, against the contact forces
    "balance_innovation": 2,  # place of the CoM, against the forces' moment
}


def compute_innovations(
    estimator: StateEstimator, before: Snapshot, reading: Record, estimates: Record
) -> Array:
    """Return the innovations of the last update, shape (11,).

    Args:
        estimator: The estimator, after the update.
        before: What it kept before.
        reading: The reading, shape (1,), dtype of `reading_dtype`.
        estimates: What the update has written, shape (1,), dtype `ESTIMATE`.
    """
    estimate = estimates[0]
    fusion, balls, tilt, level, _, contacts, _, robots = estimator.arguments
    robot, mounting = robots[0], fusion["rotation_imu_to_trunk"][0]
    dt, gravity = float(fusion["dt"][0]), float(robot["gravity"])
    predicted, kept = before[TILT].copy(), before[TILT][0]
    force = mounting @ reading["acceleration_imu"][0] - kept["accelerometer_bias"]
    omega = mounting @ reading["angular_velocity_imu"][0] - kept["gyro_bias"]
    predict_tilt(predicted, omega, force, dt, gravity)
    moved = (
        estimate["linear_velocity_trunk_in_world"] - balls["mean_linear_velocity"][0]
    )
    pushed = contacts["force"].sum(axis=0) / robot["mass"]
    pushed[2] -= gravity
    return np.concatenate(
        [
            tilt["velocity"][0] - predicted["velocity"][0],
            fusion["trunk_from_ball"][0]
            - before[FUSION]["trunk_from_ball"][0]
            - dt * moved,
            fusion["com_velocity"][0] - before[FUSION]["com_velocity"][0] - dt * pushed,
            level["lead"][0],
        ]
    )
