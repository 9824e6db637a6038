"""Configuration of the sensors: what a data sheet says, each figure in its own unit.

White noise is given per sample (`noise_std`) or, where the figure of a sensor is a
density (`noise_density`), per square root of its bandwidth. A sample that stands for
a period T has the standard deviation density / sqrt(T), as at
https://github.com/ethz-asl/kalibr/wiki/IMU-Noise-Model; both parts add up as
variances. `random_walk` is the density of the bias's rate of change, from the same
model. The multipliers scale all that is drawn, and never the draws; where they are 0
nothing is rounded off or limited either. Delay, rate and drop-outs are left as they
are. Everything is off by default.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ballsim.errors import ConfigError
from ballsim.settings import Choice, Number, TableOf, Text, check_table, setting

__all__ = [
    "SENSORS",
    "AccelerometerConfig",
    "EncoderConfig",
    "ForceConfig",
    "GyroConfig",
    "SensorConfig",
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
_SCALE = Number(0.0, 1.0)
_ANGLE = Number(0.0, 1.0, unit="rad")
_TIME = Number(0.0, 3600.0, unit="s")


@dataclass(frozen=True, slots=True)
class SensorConfig:
    """What every sensor has.

    Attributes:
        part: Part whose figures stand in for those that are not given, or ``none``.
        noise_multiplier: Factor on all that is drawn for this sensor.
        scale_std: Relative error of the scale of each channel, drawn once.
        delay: Time by which its samples are older than the readings that they stand
            in, [s]. Between two control periods the signal is interpolated linearly;
            noise is not delayed. Before the start the first value stands in.
        rate: Samples taken per second, [Hz], each held until the next one; 0, or
            more than the control rate, for a fresh one in each control period.
        drop_probability: Probability that a sample is lost: the one before it is
            held. Force and torque of an ankle travel in one frame.
        dropout_period: Time between two scheduled drop-outs, [s]; the first one
            begins after one of them. 0 for none.
        dropout_duration: How long each of them lasts, [s]; the last sample is held.
    """

    part: str = setting(Text(), "none", "part")
    noise_multiplier: float = setting(_MULTIPLIER, 1.0, "noise_multiplier")
    scale_std: float = setting(_SCALE, 0.0, "scale_std")
    delay: float = setting(Number(0.0, 1.0, unit="s"), 0.0, "delay_s")
    rate: float = setting(Number(0.0, 1e6, unit="Hz"), 0.0, "rate_hz")
    drop_probability: float = setting(Number(0.0, 1.0), 0.0, "drop_probability")
    dropout_period: float = setting(_TIME, 0.0, "dropout_period_s")
    dropout_duration: float = setting(_TIME, 0.0, "dropout_duration_s")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)
        period, duration = self.dropout_period, self.dropout_duration
        if period > 0.0 and duration >= period:
            valid = f"below dropout_period_s = {period:g}"
            raise ConfigError("dropout_duration_s", duration, valid)
        if period == 0.0 and duration > 0.0:
            valid = "0, or left out, without a dropout_period_s"
            raise ConfigError("dropout_duration_s", duration, valid)

    def sample_period(self, period: float) -> float:
        """Return the time that a sample stands for, [s].

        Args:
            period: Control period, [s].
        """
        return max(period, 1.0 / self.rate) if self.rate > 0.0 else period


@dataclass(frozen=True, slots=True)
class EncoderConfig(SensorConfig):
    """Joint encoders and the velocities that the drives derive from them.

    A drive derives the velocity from every sample, with all its errors, before it
    sends both in a frame; what is held or lost is the frame.

    Attributes:
        noise_std: White noise of a sample, [rad].
        noise_density: White noise, [rad/sqrt(Hz)].
        bias_std: Constant offset of each joint, [rad].
        resolution: Step that a sample is rounded to, [rad]; 0 for none.
        velocity_bandwidth: Bandwidth of the velocity tracker, [Hz]; 0 for the
            plain difference over one control period.
    """

    noise_std: float = setting(_ANGLE, 0.0, "noise_std_rad")
    noise_density: float = setting(
        Number(0.0, 1.0, unit="rad/rtHz"), 0.0, "noise_density_rad_rthz"
    )
    bias_std: float = setting(_ANGLE, 0.0, "bias_std_rad")
    resolution: float = setting(_ANGLE, 0.0, "resolution_rad")
    velocity_bandwidth: float = setting(
        Number(0.0, 1e4, unit="Hz"), 0.0, "velocity_bandwidth_hz"
    )

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample that stands for a period in [s]."""
        return math.hypot(self.noise_std, self.noise_density / math.sqrt(period))


@dataclass(frozen=True, slots=True)
class GyroConfig(SensorConfig):
    """A gyro.

    Attributes:
        noise_std: White noise of a sample, per axis, [rad/s].
        noise_density: White noise, [rad/s/sqrt(Hz)].
        bias_std: Offset at switch-on, per axis, [rad/s].
        random_walk: Random walk of the bias, [rad/s^2/sqrt(Hz)].
        misalignment_std: Angle by which each axis leans towards each of the two
            others, drawn once, [rad].
        limit: Greatest value that is read, of either sign, [rad/s]; 0 for none.
        resolution: Step that a sample is rounded to, [rad/s]; 0 for none.
    """

    noise_std: float = setting(Number(0.0, 10.0, unit="rad/s"), 0.0, "noise_std_rad_s")
    noise_density: float = setting(
        Number(0.0, 10.0, unit="rad/s/rtHz"), 0.0, "noise_density_rad_s_rthz"
    )
    bias_std: float = setting(Number(0.0, 10.0, unit="rad/s"), 0.0, "bias_std_rad_s")
    random_walk: float = setting(
        Number(0.0, 10.0, unit="rad/s2/rtHz"), 0.0, "random_walk_rad_s2_rthz"
    )
    misalignment_std: float = setting(_ANGLE, 0.0, "misalignment_std_rad")
    limit: float = setting(Number(0.0, 1e4, unit="rad/s"), 0.0, "limit_rad_s")
    resolution: float = setting(
        Number(0.0, 10.0, unit="rad/s"), 0.0, "resolution_rad_s"
    )

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample that stands for a period in [s]."""
        return math.hypot(self.noise_std, self.noise_density / math.sqrt(period))


@dataclass(frozen=True, slots=True)
class AccelerometerConfig(SensorConfig):
    """An accelerometer.

    Attributes:
        noise_std: White noise of a sample, per axis, [m/s^2].
        noise_density: White noise, [m/s^2/sqrt(Hz)].
        bias_std: Offset at switch-on, per axis, [m/s^2].
        random_walk: Random walk of the bias, [m/s^3/sqrt(Hz)].
        misalignment_std: Angle by which each axis leans towards each of the two
            others, drawn once, [rad].
        limit: Greatest value that is read, of either sign, [m/s^2]; 0 for none.
        resolution: Step that a sample is rounded to, [m/s^2]; 0 for none.
    """

    noise_std: float = setting(Number(0.0, 100.0, unit="m/s2"), 0.0, "noise_std_m_s2")
    noise_density: float = setting(
        Number(0.0, 100.0, unit="m/s2/rtHz"), 0.0, "noise_density_m_s2_rthz"
    )
    bias_std: float = setting(Number(0.0, 100.0, unit="m/s2"), 0.0, "bias_std_m_s2")
    random_walk: float = setting(
        Number(0.0, 100.0, unit="m/s3/rtHz"), 0.0, "random_walk_m_s3_rthz"
    )
    misalignment_std: float = setting(_ANGLE, 0.0, "misalignment_std_rad")
    limit: float = setting(Number(0.0, 1e5, unit="m/s2"), 0.0, "limit_m_s2")
    resolution: float = setting(Number(0.0, 100.0, unit="m/s2"), 0.0, "resolution_m_s2")

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample that stands for a period in [s]."""
        return math.hypot(self.noise_std, self.noise_density / math.sqrt(period))


@dataclass(frozen=True, slots=True)
class ForceConfig(SensorConfig):
    """The force part of an ankle's force-torque sensor.

    Attributes:
        noise_std: White noise of a sample, per axis, [N].
        bias_std: Offset at switch-on, per axis, [N].
        random_walk: Random walk of the bias, [N/s/sqrt(Hz)].
        misalignment_std: Share of each axis in each of the two others, drawn once,
            [rad].
        coupling_std: What each axis reads of a torque about any of the three, drawn
            once, [N/(N m)].
        limit: Greatest value along x and y, of either sign, [N]; 0 for none.
        limit_z: Likewise along z, [N].
        resolution: Step that a sample is rounded to, [N]; 0 for none.
    """

    noise_std: float = setting(Number(0.0, 1e4, unit="N"), 0.0, "noise_std_n")
    bias_std: float = setting(Number(0.0, 1e4, unit="N"), 0.0, "bias_std_n")
    random_walk: float = setting(
        Number(0.0, 1e4, unit="N/s/rtHz"), 0.0, "random_walk_n_s_rthz"
    )
    misalignment_std: float = setting(_ANGLE, 0.0, "misalignment_std_rad")
    coupling_std: float = setting(Number(0.0, 1e3, unit="1/m"), 0.0, "coupling_std_1_m")
    limit: float = setting(Number(0.0, 1e6, unit="N"), 0.0, "limit_n")
    limit_z: float = setting(Number(0.0, 1e6, unit="N"), 0.0, "limit_z_n")
    resolution: float = setting(Number(0.0, 1e4, unit="N"), 0.0, "resolution_n")

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample, whatever its period in [s]."""
        return self.noise_std


@dataclass(frozen=True, slots=True)
class TorqueConfig(SensorConfig):
    """The torque part of an ankle's force-torque sensor.

    Attributes:
        noise_std: White noise of a sample, per axis, [N m].
        bias_std: Offset at switch-on, per axis, [N m].
        random_walk: Random walk of the bias, [N m/s/sqrt(Hz)].
        misalignment_std: Share of each axis in each of the two others, drawn once,
            [rad].
        coupling_std: What each axis reads of a force along any of the three, drawn
            once, [N m/N].
        limit: Greatest value, of either sign, [N m]; 0 for none.
        resolution: Step that a sample is rounded to, [N m]; 0 for none.
    """

    noise_std: float = setting(Number(0.0, 1e4, unit="N m"), 0.0, "noise_std_n_m")
    bias_std: float = setting(Number(0.0, 1e4, unit="N m"), 0.0, "bias_std_n_m")
    random_walk: float = setting(
        Number(0.0, 1e4, unit="N m/s/rtHz"), 0.0, "random_walk_n_m_s_rthz"
    )
    misalignment_std: float = setting(_ANGLE, 0.0, "misalignment_std_rad")
    coupling_std: float = setting(Number(0.0, 1.0, unit="m"), 0.0, "coupling_std_m")
    limit: float = setting(Number(0.0, 1e6, unit="N m"), 0.0, "limit_n_m")
    resolution: float = setting(Number(0.0, 1e4, unit="N m"), 0.0, "resolution_n_m")

    def sample_std(self, period: float) -> float:
        """Return the white noise of a sample, whatever its period in [s]."""
        return self.noise_std


@dataclass(frozen=True, slots=True)
class SensorsConfig:
    """The sensors: a preset, every figure of which can be replaced.

    Attributes:
        preset: Name of the preset that the figures started from.
        noise_multiplier: Factor on all that is drawn, of all sensors.
        noisy: The one sensor that has errors, or ``all`` of them.
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

    def find_level(self, sensor: str) -> float:
        """Return the factor on all that is drawn for a sensor, by its name."""
        if self.noisy not in ("all", sensor):
            return 0.0
        table: SensorConfig = getattr(self, sensor)
        return self.noise_multiplier * table.noise_multiplier
