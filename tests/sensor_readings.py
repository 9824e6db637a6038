"""What a run's sensors read of a given signal."""

from __future__ import annotations

import numpy as np

from ballsim.config_io import load_config
from ballsim.preparation import PreparedRun, prepare
from ballsim.sensor_config import SensorsConfig
from ballsim.sensors import SensorSuite
from ballsim_controllers.messages import Array, JointTargets, SensorReading

PERIOD = 0.002


class _Silent:
    telemetry = None

    def step(self, reading: SensorReading, command: object) -> JointTargets:
        raise NotImplementedError


def prepare_sensors() -> PreparedRun:
    """Return a run of the shipped robot; only its sensors are of interest."""
    return prepare(load_config("stand").config, controller=_Silent())


def read_all(
    prepared: PreparedRun, config: SensorsConfig, truth: Array, seed: int = 0
) -> dict[str, Array]:
    """Return the readings of each sensor, shape (n, channels), by its name."""
    suite = SensorSuite(prepared.ids, config, PERIOD, seed)
    rows = [suite.read(i * PERIOD, row).record[0].copy() for i, row in enumerate(truth)]
    names = {
        "encoder": "joint_positions",
        "velocity": "joint_velocities",
        "gyro": "angular_velocity_imu",
        "accelerometer": "acceleration_imu",
        "foot_force": "foot_forces",
        "foot_torque": "foot_torques",
        "ball_gyro": "angular_velocity_ball",
    }
    return {
        name: np.array([row[field] for row in rows]).reshape(len(rows), -1)
        for name, field in names.items()
    }


def make_noise(prepared: PreparedRun, n: int, seed: int = 1) -> Array:
    size = (n, prepared.plant.model.nsensordata)
    return np.random.default_rng(seed).normal(size=size)


def make_zeros(prepared: PreparedRun, n: int) -> Array:
    return np.zeros((n, prepared.plant.model.nsensordata))
