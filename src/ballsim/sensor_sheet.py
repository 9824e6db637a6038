"""What the robot's engineer knows of the sensors: their figures, not their errors."""

from __future__ import annotations

import math

from ballsim.sensor_config import AccelerometerConfig, GyroConfig, SensorsConfig
from ballsim_controllers.sensor_figures import SensorFigures

__all__ = ["find_sensor_figures"]

_GRAVITY = 9.81  # what errors of scale and axes of an accelerometer act on, [m/s^2]


def find_sensor_figures(config: SensorsConfig, period: float) -> SensorFigures:
    """Return the data sheets of the sensors that are built in.

    Multipliers count: a sensor of twice the noise is another sensor. What is drawn
    from the figures in a run is not in them.

    Args:
        config: Figures of the sensors.
        period: Control period, [s].
    """

    def level(sensor: str) -> float:
        return config.find_level(sensor)

    def density(sensor: str) -> float:
        table: GyroConfig | AccelerometerConfig = getattr(config, sensor)
        step = table.resolution / math.sqrt(12.0)
        held = table.sample_period(period)
        std = math.hypot(table.sample_std(held), step)
        return level(sensor) * std * math.sqrt(held)

    def gyro(sensor: str) -> tuple[float, float, float]:
        table: GyroConfig = getattr(config, sensor)
        bias, walk = level(sensor) * table.bias_std, level(sensor) * table.random_walk
        return density(sensor), bias, walk

    trunk, ball = gyro("gyro"), gyro("ball_gyro")
    encoder, accelerometer = config.encoder, config.accelerometer
    along = accelerometer.misalignment_std * _GRAVITY
    return SensorFigures(
        encoder_noise=level("encoder")
        * math.hypot(encoder.sample_std(period), encoder.resolution / math.sqrt(12.0)),
        encoder_bias=level("encoder") * encoder.bias_std,
        gyro_noise=trunk[0],
        gyro_bias=trunk[1],
        gyro_walk=trunk[2],
        accelerometer_noise=density("accelerometer"),
        accelerometer_bias=level("accelerometer")
        * math.hypot(accelerometer.bias_std, along),
        accelerometer_walk=level("accelerometer") * accelerometer.random_walk,
        torque_noise=level("foot_torque") * config.foot_torque.sample_std(period),
        ball_gyro_noise=ball[0],
        ball_gyro_bias=ball[1],
        ball_gyro_walk=ball[2],
        ball_gyro_scale=level("ball_gyro") * config.ball_gyro.scale_std,
        ball_gyro_axes=level("ball_gyro") * config.ball_gyro.misalignment_std,
    )
