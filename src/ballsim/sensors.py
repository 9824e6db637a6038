"""From MuJoCo's ``sensordata`` to the readings that the controller gets."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from ballsim.distortion import make_distortion
from ballsim.faults import FaultInjector
from ballsim.noise import Effect, NoiseModel, SensorChannels, make_generator
from ballsim.sample_timing import SampleSchedule, find_ages
from ballsim.scene import SceneIds
from ballsim.sensor_config import SENSORS, SensorsConfig
from ballsim.sensor_signal import SensorSignal
from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Array, Record, SensorReading, reading_dtype

__all__ = ["SensorSuite", "VelocityTracker"]

IntArray = npt.NDArray[np.int_]

_ROWS_AT_ONCE = 64  # readings whose memory is taken at once


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
        n_joints: Number of joints.
    """

    def __init__(self, bandwidth: float, period: float, n_joints: int) -> None:
        """Compute the gains."""
        pole = math.exp(-2.0 * math.pi * bandwidth * period) if bandwidth > 0.0 else 0.0
        self.gains = np.array([period, 1.0 - pole**2, (1.0 - pole) ** 2 / period])
        self.state = np.full((2, n_joints), np.nan)

    def update(self, positions: Array) -> Array:
        """Return the velocities after one more sample, zero after the first.

        Args:
            positions: Encoder readings, [rad].

        Returns:
            Velocities, a fresh array of the same shape, [rad/s].
        """
        velocities = np.empty_like(positions)
        _track(self.gains, self.state, positions, velocities)
        return velocities


@compiled
def _track(gains: Array, state: Array, positions: Array, velocities: Array) -> None:
    """Advance a velocity tracker by one sample.

    Args:
        gains: Period [s], gain of the position, gain of the velocity [1/s].
        state: Position and velocity of each joint, shape (2, n), changed in
            place; NaN before the first sample.
        positions: Encoder readings, shape (n,), [rad].
        velocities: What is written, shape (n,), [rad/s].
    """
    period, position_gain, velocity_gain = gains
    for i in range(positions.shape[0]):
        if math.isnan(state[0, i]):
            state[0, i], state[1, i] = positions[i], 0.0
        else:
            predicted = state[0, i] + period * state[1, i]
            residual = positions[i] - predicted
            state[0, i] = predicted + position_gain * residual
            state[1, i] = state[1, i] + velocity_gain * residual
        velocities[i] = state[1, i]


@compiled
def _sample(
    row: Array,
    sensordata: Array,
    order: IntArray,
    errors: Array,
    gains: Array,
    state: Array,
) -> None:
    """Write all of a reading but its time.

    Args:
        row: The reading as numbers: time, positions, velocities, the rest.
        sensordata: MuJoCo's sensor values.
        order: Where the channels are among them, positions first.
        errors: What the sensors add to them, shape (n_channels,).
        gains: Gains of the velocity tracker.
        state: State of the velocity tracker, shape (2, n_joints).
    """
    n = state.shape[1]
    for i in range(order.shape[0]):
        place = 1 + i if i < n else 1 + n + i
        row[place] = sensordata[order[i]] + errors[i]
    _track(gains, state, row[1 : n + 1], row[n + 1 : 2 * n + 1])


class SensorSuite:
    """All sensors of the robot and of the ball.

    A reading that differs from the truth by bias, walk and white noise only, is made
    by one short kernel; what else the sensors do to their signals, if they do, is
    made by a `SensorSignal`.

    MuJoCo computes ``sensordata`` at the start of a physics step, so what is
    read after a step belongs to the state before it: all sensors lag by one
    physics step, 1 ms unless configured otherwise. With a delay they arrive by so
    much later, velocities included; the first reading stands in for those that were
    on their way at the start. The time of a reading is the time at which the
    controller gets it.

    Args:
        ids: Where the sensors are in ``sensordata``.
        config: Noise figures and delay.
        control_period: Time between two readings, [s].
        seed: Seed of the run; sensor i draws from the stream i and from those of
            its effects.
        faults: What fails, and when, if anything does.
    """

    def __init__(
        self,
        ids: SceneIds,
        config: SensorsConfig,
        control_period: float,
        seed: int,
        faults: FaultInjector | None = None,
    ) -> None:
        """Look up the channels and draw the biases."""
        n = len(ids.sensor_joints)
        channels = {
            "encoder": list(ids.sensor_joints),
            "gyro": _range(ids.sensor_gyro),
            "accelerometer": _range(ids.sensor_accelerometer),
            "foot_force": [i for s in ids.sensor_forces for i in _range(s)],
            "foot_torque": [i for s in ids.sensor_torques for i in _range(s)],
            "ball_gyro": _range(ids.sensor_gyro_ball),
        }
        self._dtype = reading_dtype(n)
        # Readings share no element, but a block of rows, which costs less to make.
        n_numbers = self._dtype.itemsize // np.dtype(np.float64).itemsize
        self._rows, self._next = np.empty((_ROWS_AT_ONCE, n_numbers)), _ROWS_AT_ONCE
        self._records: Record = self._rows.view(self._dtype)
        self._order = np.array([i for name in SENSORS for i in channels[name]])
        sections = _find_sections(channels)
        self._noise = NoiseModel(
            [
                _make_channels(config, name, len(channels[name]), control_period, seed)
                for name in SENSORS
            ]
        )
        signal = SensorSignal(
            make_distortion(config, sections, seed),
            find_ages(config, sections, control_period),
            SampleSchedule(config, sections, control_period, seed),
        )
        self._signal = None if signal.is_plain else signal
        bandwidth = config.encoder.velocity_bandwidth
        self._tracker = VelocityTracker(bandwidth, control_period, n)
        self._faults, self._n_read = faults, 0
        self._n_late = round(config.delay / control_period)
        self._on_their_way: deque[tuple[Array, Record]] = deque()
        self._warm_up()

    @property
    def encoder_zeros(self) -> Array:
        """Return what the encoders read too much, of the start, (n_joints,), [rad]."""
        return self._noise.bias[: self._tracker.state.shape[1]]

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
        if self._next == _ROWS_AT_ONCE:
            self._rows, self._next = np.empty_like(self._rows), 0
            self._records = self._rows.view(self._dtype)
        row, record = self._rows[self._next], self._records[self._next]
        self._next += 1
        row[0] = time
        errors, tracker = self._noise.draw(), self._tracker
        if self._signal is None:
            _sample(row, sensordata, self._order, errors, tracker.gains, tracker.state)
        else:
            values = self._signal.shape(sensordata[self._order], errors)
            n = tracker.state.shape[1]
            velocities = tracker.update(values[:n])
            self._signal.send(row, values, velocities)
        if self._faults is not None:
            self._faults.apply(self._n_read, row)
            self._n_read += 1
        if self._n_late:
            record = self._delay(time, row, record)
        return SensorReading(record)

    def _delay(self, time: float, row: Array, record: Record) -> Record:
        """Send a reading on its way and return the one that arrives at a time in [s].

        Args:
            time: When it arrives.
            row: The reading as numbers.
            record: The same as a record.
        """
        waiting = self._on_their_way
        while len(waiting) < self._n_late:
            copy = record.copy()
            waiting.append((copy.view(np.float64), copy))
        waiting.append((row, record))
        row, record = waiting.popleft()
        row[0] = time
        return record

    def _warm_up(self) -> None:
        """Load the kernel, on arrays that are thrown away."""
        n, n_sensordata = len(self._order), int(self._order.max()) + 1
        row, state = self._rows[0], self._tracker.state.copy()
        sensordata, errors = np.zeros(n_sensordata), np.zeros(n)
        _sample(row, sensordata, self._order, errors, self._tracker.gains, state)


def _find_sections(channels: Mapping[str, list[int]]) -> dict[str, slice]:
    """Return where the channels of each sensor are among all of them."""
    sections, start = {}, 0
    for name in SENSORS:
        stop = start + len(channels[name])
        sections[name], start = slice(start, stop), stop
    return sections


def _make_channels(
    config: SensorsConfig, sensor: str, n_channels: int, period: float, seed: int
) -> SensorChannels:
    """Return the noise of one sensor, in the units of its channels."""
    table, stream = getattr(config, sensor), SENSORS.index(sensor)
    level = config.find_level(sensor)
    walk = level * float(getattr(table, "random_walk", 0.0)) * math.sqrt(period)
    return SensorChannels(
        n_channels=n_channels,
        noise_std=level * table.sample_std(table.sample_period(period)),
        bias_std=level * table.bias_std,
        generator=make_generator(seed, stream),
        walk_std=walk,
        walk_generator=make_generator(seed, stream, Effect.WALK) if walk else None,
    )


def _range(section: slice) -> list[int]:
    return list(range(section.start, section.stop))
