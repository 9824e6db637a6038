"""Configuration of the sensors: noise figures, each in its own unit.

White noise is given per sample (`noise_std`) or, where the figure of a sensor is a
density (`noise_density`), per square root of its bandwidth. A sample that stands for
a control period T has the standard deviation density / sqrt(T), as at
https://github.com/ethz-asl/kalibr/wiki/IMU-Noise-Model; both parts add up as
variances. The multipliers scale white noise and bias alike, and never the draws.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ballsim.settings import Choice, Number, TableOf, Text, check_table, setting

__all__ = [
    "SENSORS",
    "AccelerometerConfig",
    "EncoderConfig",
    "ForceConfig",
    "GyroConfig",
    "SensorsConfig",
    "TorqueConfig",
]

SENSORS = (
    "encoder",
    "gyro",
    "accelerometer",
    "foot_force",
    "foot_torque",
    "ball_gyro",
)
_MULTIPLIER = Number(0.0, 1000.0)


@dataclass(frozen=True, slots=True)
class EncoderConfig:
    """Joint encoders and the velocities that the drives derive from them.

    Attributes:
        noise_std: White noise of a sample, [rad].
        noise_density: White noise, [rad/sqrt(Hz)].
        bias_std: Constant offset of each joint, [rad].
        noise_multiplier: Factor on the noise and bias of this sensor.
        velocity_bandwidth: Bandwidth of the velocity tracker, [Hz]; 0 for the
            plain difference over one control period.
    """

    noise_std: float = setting(Number(0.0, 1.0, unit="rad"), 0.0, "noise_std_rad")
    noise_density: float = setting(
        Number(0.0, 1.0, unit="rad/rtHz"), 0.0, "noise_density_rad_rthz"
    )
    bias_std: float = setting(Number(0.0, 1.0, unit="rad"), 0.0, "bias_std_rad")
    velocity_bandwidth: float = setting(
        Number(0.0, 1e4, unit="Hz"), 0.0, "velocity_bandwidth_hz"
    )
    noise_multiplier: float = setting(_MULTIPLIER, 1.0, "noise_multiplier")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample that stands for a period in [s]."""
        return math.hypot(self.noise_std, self.noise_density / math.sqrt(period))


@dataclass(frozen=True, slots=True)
class GyroConfig:
    """A gyro.

    Attributes:
        noise_std: White noise of a sample, per axis, [rad/s].
        noise_density: White noise, [rad/s/sqrt(Hz)].
        bias_std: Constant offset, per axis, [rad/s].
        noise_multiplier: Factor on the noise and bias of this sensor.
    """

    noise_std: float = setting(Number(0.0, 10.0, unit="rad/s"), 0.0, "noise_std_rad_s")
    noise_density: float = setting(
        Number(0.0, 10.0, unit="rad/s/rtHz"), 0.0, "noise_density_rad_s_rthz"
    )
    bias_std: float = setting(Number(0.0, 10.0, unit="rad/s"), 0.0, "bias_std_rad_s")
    noise_multiplier: float = setting(_MULTIPLIER, 1.0, "noise_multiplier")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample that stands for a period in [s]."""
        return math.hypot(self.noise_std, self.noise_density / math.sqrt(period))


@dataclass(frozen=True, slots=True)
class AccelerometerConfig:
    """An accelerometer.

    Attributes:
        noise_std: White noise of a sample, per axis, [m/s^2].
        noise_density: White noise, [m/s^2/sqrt(Hz)].
        bias_std: Constant offset, per axis, [m/s^2].
        noise_multiplier: Factor on the noise and bias of this sensor.
    """

    noise_std: float = setting(Number(0.0, 100.0, unit="m/s2"), 0.0, "noise_std_m_s2")
    noise_density: float = setting(
        Number(0.0, 100.0, unit="m/s2/rtHz"), 0.0, "noise_density_m_s2_rthz"
    )
    bias_std: float = setting(Number(0.0, 100.0, unit="m/s2"), 0.0, "bias_std_m_s2")
    noise_multiplier: float = setting(_MULTIPLIER, 1.0, "noise_multiplier")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample that stands for a period in [s]."""
        return math.hypot(self.noise_std, self.noise_density / math.sqrt(period))


@dataclass(frozen=True, slots=True)
class ForceConfig:
    """The force part of an ankle's force-torque sensor.

    Attributes:
        noise_std: White noise of a sample, per axis, [N].
        bias_std: Constant offset, per axis, [N].
        noise_multiplier: Factor on the noise and bias of this sensor.
    """

    noise_std: float = setting(Number(0.0, 1e4, unit="N"), 0.0, "noise_std_n")
    bias_std: float = setting(Number(0.0, 1e4, unit="N"), 0.0, "bias_std_n")
    noise_multiplier: float = setting(_MULTIPLIER, 1.0, "noise_multiplier")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample, whatever its period in [s]."""
        return self.noise_std


@dataclass(frozen=True, slots=True)
class TorqueConfig:
    """The torque part of an ankle's force-torque sensor.

    Attributes:
        noise_std: White noise of a sample, per axis, [N m].
        bias_std: Constant offset, per axis, [N m].
        noise_multiplier: Factor on the noise and bias of this sensor.
    """

    noise_std: float = setting(Number(0.0, 1e4, unit="N m"), 0.0, "noise_std_n_m")
    bias_std: float = setting(Number(0.0, 1e4, unit="N m"), 0.0, "bias_std_n_m")
    noise_multiplier: float = setting(_MULTIPLIER, 1.0, "noise_multiplier")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample, whatever its period in [s]."""
        return self.noise_std


@dataclass(frozen=True, slots=True)
class SensorsConfig:
    """The sensors: a preset, every figure of which can be replaced.

    Attributes:
        preset: Name of the preset that the figures started from.
        noise_multiplier: Factor on the noise and bias of all sensors.
        noisy: The one sensor that has noise and bias, or ``all`` of them.
        delay: Time by which readings arrive late, [s], a multiple of the control
            period. Until the first one has arrived, it is there already: the robot
            stood there before.
        encoder: Joint encoders.
        gyro: Gyro on the trunk.
        accelerometer: Accelerometer on the trunk.
        foot_force: Forces at the ankles.
        foot_torque: Torques at the ankles.
        ball_gyro: Gyro in the ball.
    """

    preset: str = setting(Text(), "ideal", "preset")
    noise_multiplier: float = setting(_MULTIPLIER, 1.0, "noise_multiplier")
    noisy: str = setting(Choice(("all", *SENSORS)), "all", "noisy")
    delay: float = setting(Number(0.0, 1.0, unit="s"), 0.0, "delay_s")
    encoder: EncoderConfig = setting(TableOf(EncoderConfig), EncoderConfig, "encoder")
    gyro: GyroConfig = setting(TableOf(GyroConfig), GyroConfig, "gyro")
    accelerometer: AccelerometerConfig = setting(
        TableOf(AccelerometerConfig), AccelerometerConfig, "accelerometer"
    )
    foot_force: ForceConfig = setting(TableOf(ForceConfig), ForceConfig, "foot_force")
    foot_torque: TorqueConfig = setting(
        TableOf(TorqueConfig), TorqueConfig, "foot_torque"
    )
    ball_gyro: GyroConfig = setting(TableOf(GyroConfig), GyroConfig, "ball_gyro")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)
