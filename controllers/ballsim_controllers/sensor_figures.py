"""What the data sheets of a robot's sensors say, as the estimator takes it."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields

import numpy as np

from ballsim_controllers.errors import InvalidSettingError

__all__ = ["SensorFigures"]


@dataclass(frozen=True, slots=True)
class SensorFigures:
    """Standard deviations that a data sheet and a calibration promise.

    The estimator weighs its sensors by them. All are 0 for sensors that nothing is
    known of: then only what the model behind the estimator gets wrong counts.

    Attributes:
        encoder_noise: White noise of a sample of a joint's angle, [rad].
        encoder_bias: Error of a joint's zero position, [rad].
        gyro_noise: Density of the trunk's gyro, [rad/s/sqrt(Hz)].
        gyro_bias: Its bias at switch-on, [rad/s].
        gyro_walk: Random walk of the bias, [rad/s^2/sqrt(Hz)].
        accelerometer_noise: Density of the accelerometer, [m/s^2/sqrt(Hz)].
        accelerometer_bias: Its bias, errors of its axes on gravity included, [m/s^2].
        accelerometer_walk: Random walk of the bias, [m/s^3/sqrt(Hz)].
        torque_noise: White noise of a sample of an ankle's torque, [N m].
        ball_gyro_noise: Density of the ball's gyro, [rad/s/sqrt(Hz)].
        ball_gyro_bias: Its bias at switch-on, [rad/s].
        ball_gyro_walk: Random walk of the bias, [rad/s^2/sqrt(Hz)].
        ball_gyro_scale: Error of its scale.
        ball_gyro_axes: Error of its axes, [rad].
    """

    encoder_noise: float = 0.0
    encoder_bias: float = 0.0
    gyro_noise: float = 0.0
    gyro_bias: float = 0.0
    gyro_walk: float = 0.0
    accelerometer_noise: float = 0.0
    accelerometer_bias: float = 0.0
    accelerometer_walk: float = 0.0
    torque_noise: float = 0.0
    ball_gyro_noise: float = 0.0
    ball_gyro_bias: float = 0.0
    ball_gyro_walk: float = 0.0
    ball_gyro_scale: float = 0.0
    ball_gyro_axes: float = 0.0

    def __post_init__(self) -> None:
        """Refuse figures that are no standard deviations."""
        for item in fields(self):
            value = getattr(self, item.name)
            if not (np.isfinite(value) and value >= 0.0):
                valid = "a finite number, not below 0"
                raise InvalidSettingError(f"sensors.{item.name}", value, valid)

    @property
    def are_perfect(self) -> bool:
        """Return whether nothing is known that a sensor gets wrong."""
        return not any(astuple(self))
