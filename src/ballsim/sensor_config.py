"""Configuration of the sensors: noise figures, each in its own unit."""

from __future__ import annotations

from dataclasses import dataclass

from ballsim.settings import Number, TableOf, Text, check_table, setting

__all__ = [
    "AccelerometerConfig",
    "EncoderConfig",
    "ForceConfig",
    "GyroConfig",
    "SensorsConfig",
    "TorqueConfig",
]


@dataclass(frozen=True, slots=True)
class EncoderConfig:
    """Joint encoders and the velocities that the drives derive from them.

    Attributes:
        noise_std: White noise of a sample, [rad].
        bias_std: Constant offset of each joint, [rad].
        velocity_bandwidth: Bandwidth of the velocity tracker, [Hz]; 0 for the
            plain difference over one control period.
    """

    noise_std: float = setting(Number(0.0, 1.0, unit="rad"), 0.0, "noise_std_rad")
    bias_std: float = setting(Number(0.0, 1.0, unit="rad"), 0.0, "bias_std_rad")
    velocity_bandwidth: float = setting(
        Number(0.0, 1e4, unit="Hz"), 0.0, "velocity_bandwidth_hz"
    )

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class GyroConfig:
    """A gyro.

    Attributes:
        noise_std: White noise of a sample, per axis, [rad/s].
        bias_std: Constant offset, per axis, [rad/s].
    """

    noise_std: float = setting(Number(0.0, 10.0, unit="rad/s"), 0.0, "noise_std_rad_s")
    bias_std: float = setting(Number(0.0, 10.0, unit="rad/s"), 0.0, "bias_std_rad_s")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class AccelerometerConfig:
    """An accelerometer.

    Attributes:
        noise_std: White noise of a sample, per axis, [m/s^2].
        bias_std: Constant offset, per axis, [m/s^2].
    """

    noise_std: float = setting(Number(0.0, 100.0, unit="m/s2"), 0.0, "noise_std_m_s2")
    bias_std: float = setting(Number(0.0, 100.0, unit="m/s2"), 0.0, "bias_std_m_s2")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class ForceConfig:
    """The force part of an ankle's force-torque sensor.

    Attributes:
        noise_std: White noise of a sample, per axis, [N].
        bias_std: Constant offset, per axis, [N].
    """

    noise_std: float = setting(Number(0.0, 1e4, unit="N"), 0.0, "noise_std_n")
    bias_std: float = setting(Number(0.0, 1e4, unit="N"), 0.0, "bias_std_n")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class TorqueConfig:
    """The torque part of an ankle's force-torque sensor.

    Attributes:
        noise_std: White noise of a sample, per axis, [N m].
        bias_std: Constant offset, per axis, [N m].
    """

    noise_std: float = setting(Number(0.0, 1e4, unit="N m"), 0.0, "noise_std_n_m")
    bias_std: float = setting(Number(0.0, 1e4, unit="N m"), 0.0, "bias_std_n_m")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class SensorsConfig:
    """The sensors: a preset, every figure of which can be replaced.

    Attributes:
        preset: Name of the preset that the figures started from.
        encoder: Joint encoders.
        gyro: Gyro on the trunk.
        accelerometer: Accelerometer on the trunk.
        foot_force: Forces at the ankles.
        foot_torque: Torques at the ankles.
        ball_gyro: Gyro in the ball.
    """

    preset: str = setting(Text(), "ideal", "preset")
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
