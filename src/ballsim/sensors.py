"""From MuJoCo's ``sensordata`` to the readings that the controller gets."""

from __future__ import annotations

import math

import numpy as np

from ballsim.noise import NoiseFigures, NoiseModel, SensorChannels, make_generator
from ballsim.scene import SceneIds
from ballsim.sensor_config import SensorsConfig
from ballsim_controllers.messages import Array, SensorReading, reading_dtype

__all__ = ["SensorSuite", "VelocityTracker"]


class VelocityTracker:
    r"""Velocity of the joints as a drive derives it from its encoder.

    A critically damped alpha-beta filter with the double pole
    :math:`p = e^{-2 \pi f T}`:

    .. math::

        r &= y - (x + T v), \quad x \mathrel{+}= T v + (1 - p^2) r, \\
        v &\mathrel{+}= (1 - p)^2 r / T

    For p = 0 it is the plain difference over one period.

    Args:
        bandwidth: Bandwidth f, [Hz]; 0 for the plain difference.
        period: Time between two samples T, [s].
    """

    def __init__(self, bandwidth: float, period: float) -> None:
        """Compute the gains."""
        pole = math.exp(-2.0 * math.pi * bandwidth * period) if bandwidth > 0.0 else 0.0
        self._period = period
        self._position_gain = 1.0 - pole**2
        self._velocity_gain = (1.0 - pole) ** 2 / period
        self._position: Array | None = None
        self._velocity: Array = np.zeros(0)

    def update(self, positions: Array) -> Array:
        """Return the velocities after one more sample, zero after the first.

        Args:
            positions: Encoder readings, [rad].

        Returns:
            Velocities, a fresh array of the same shape, [rad/s].
        """
        if self._position is None:
            self._position = positions.copy()
            self._velocity = np.zeros_like(positions)
        else:
            predicted = self._position + self._period * self._velocity
            residual = positions - predicted
            self._position = predicted + self._position_gain * residual
            self._velocity = self._velocity + self._velocity_gain * residual
        return self._velocity.copy()


class SensorSuite:
    """All sensors of the robot and of the ball.

    MuJoCo computes ``sensordata`` at the start of a physics step, so what is
    read after a step belongs to the state before it: all sensors lag by one
    physics step, 1 ms unless configured otherwise. The time of a reading is
    the time at which the controller gets it.

    Args:
        ids: Where the sensors are in ``sensordata``.
        config: Noise figures.
        control_period: Time between two readings, [s].
        seed: Seed of the run; sensor i draws from the stream i.
    """

    def __init__(
        self, ids: SceneIds, config: SensorsConfig, control_period: float, seed: int
    ) -> None:
        """Look up the channels and draw the biases."""
        n = len(ids.sensor_joints)
        groups: tuple[tuple[NoiseFigures, list[int]], ...] = (
            (config.encoder, list(ids.sensor_joints)),
            (config.gyro, _range(ids.sensor_gyro)),
            (config.accelerometer, _range(ids.sensor_accelerometer)),
            (config.foot_force, [i for s in ids.sensor_forces for i in _range(s)]),
            (config.foot_torque, [i for s in ids.sensor_torques for i in _range(s)]),
            (config.ball_gyro, _range(ids.sensor_gyro_ball)),
        )
        self._n_joints = n
        self._dtype = reading_dtype(n)
        self._order = np.array([i for _, channels in groups for i in channels])
        self._noise = NoiseModel(
            [
                SensorChannels(
                    n_channels=len(channels),
                    noise_std=figures.noise_std,
                    bias_std=figures.bias_std,
                    generator=make_generator(seed, stream),
                )
                for stream, (figures, channels) in enumerate(groups)
            ]
        )
        bandwidth = config.encoder.velocity_bandwidth
        self._tracker = VelocityTracker(bandwidth, control_period)

    @property
    def n_channels(self) -> int:
        """Return the number of scalars that are read, velocities not counted."""
        return len(self._order)

    def read(self, time: float, sensordata: Array) -> SensorReading:
        """Return one noisy sample of every sensor.

        Args:
            time: Time at which the controller gets the sample, [s].
            sensordata: MuJoCo's sensor values; not kept.

        Returns:
            The reading; its arrays are fresh and share no elements.
        """
        n = self._n_joints
        values = self._noise.apply(sensordata[self._order])
        positions = values[:n]
        record = np.empty(1, self._dtype)
        # The record as one row of numbers: time, positions, velocities, the rest.
        row = record.view(np.float64)
        row[0] = time
        row[1 : n + 1] = positions
        row[n + 1 : 2 * n + 1] = self._tracker.update(positions)
        row[2 * n + 1 :] = values[n:]
        return SensorReading(record)


def _range(section: slice) -> list[int]:
    return list(range(section.start, section.stop))
