"""What the figures of the sensors say about the errors of a reading."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ballsim.sensor_config import SENSORS, SensorsConfig
from ballsim_controllers.messages import Array, SensorReading

__all__ = ["SensorErrors", "find_sensor_errors"]

_FIELDS = {
    "encoder": "joint_positions",
    "gyro": "angular_velocity_imu",
    "accelerometer": "acceleration_imu",
    "foot_force": "foot_forces",
    "foot_torque": "foot_torques",
    "ball_gyro": "angular_velocity_ball",
}


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Errors of the channels of all sensors, in the order of `SENSORS`.

    All channels are independent of one another.

    Attributes:
        white_std: Of one sample, shape (m,).
        bias_std: Of what is constant, shape (m,).
        walk_std: Of the step that the bias takes in one period, shape (m,).
    """

    white_std: Array
    bias_std: Array
    walk_std: Array


def find_sensor_errors(
    config: SensorsConfig, reading: SensorReading, period: float
) -> SensorErrors:
    r"""Return the errors of readings like one.

    Errors of scale, axes and coupling are constant factors, drawn once: on a signal
    that does not change they are a bias with the variance

    .. math:: \sigma_b^2 + \sum_j \sigma_{ij}^2 z_j^2 .

    Rounding to a step is white noise of step / sqrt(12); samples that are held for
    k periods weigh as white noise of k times the variance. Delays and losses of
    samples are no noise and are left out.

    Args:
        config: Figures of the sensors.
        reading: What is read.
        period: Control period, [s].
    """
    white, bias, walk = [], [], []
    for sensor in SENSORS:
        table, level = getattr(config, sensor), config.find_level(sensor)
        signal = np.ravel(getattr(reading, _FIELDS[sensor]))
        n = len(signal)
        held = table.sample_period(period)
        step = float(getattr(table, "resolution", 0.0)) if level > 0.0 else 0.0
        sample = level * table.sample_std(held)
        std = math.hypot(sample, step / math.sqrt(12.0)) * math.sqrt(held / period)
        white.append(np.full(n, std))
        steps = level * float(getattr(table, "random_walk", 0.0)) * math.sqrt(period)
        walk.append(np.full(n, steps))
        variance = table.bias_std**2 + (table.scale_std * signal) ** 2
        lean = float(getattr(table, "misalignment_std", 0.0))
        if lean > 0.0:
            triads = (signal**2).reshape(-1, 3)
            others = triads.sum(axis=1, keepdims=True) - triads
            variance += lean**2 * others.ravel()
        coupling = float(getattr(table, "coupling_std", 0.0))
        if coupling > 0.0:
            other = "foot_torque" if sensor == "foot_force" else "foot_force"
            squares = getattr(reading, _FIELDS[other]) ** 2
            variance += coupling**2 * np.repeat(squares.sum(axis=1), 3)
        bias.append(level * np.sqrt(variance))
    return SensorErrors(*(np.concatenate(part) for part in (white, bias, walk)))
