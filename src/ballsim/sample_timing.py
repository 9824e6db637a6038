"""When a sensor's samples are taken, how old they are, and which of them are lost."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ballsim.noise import BLOCK_LENGTH, Effect, make_generator
from ballsim.sensor_config import SENSORS, SensorConfig, SensorsConfig
from ballsim_controllers.messages import Array, IntArray

__all__ = ["Ages", "SampleSchedule", "find_ages"]

BoolArray = npt.NDArray[np.bool_]

_TOLERANCE = 1e-9  # of a control period
_FRAMES = {  # channels that travel together and are lost together
    "encoder": 1,
    "gyro": 3,
    "accelerometer": 3,
    "foot_force": 3,
    "foot_torque": 3,
    "ball_gyro": 3,
}


@dataclass(frozen=True, slots=True)
class Ages:
    """How old the sample of each channel is when it is read.

    Attributes:
        whole: Whole control periods, shape (n,).
        fraction: The rest, as a part of one, shape (n,).
    """

    whole: IntArray
    fraction: Array


def find_ages(
    config: SensorsConfig, sections: Mapping[str, slice], period: float
) -> Ages:
    """Return the age of each channel's samples.

    Args:
        config: Figures of the sensors.
        sections: Channels of each sensor, by its name.
        period: Control period, [s].
    """
    n = max(section.stop for section in sections.values())
    ages = Ages(np.zeros(n, dtype=np.int_), np.zeros(n))
    for sensor, section in sections.items():
        table: SensorConfig = getattr(config, sensor)
        count = table.delay / period
        whole = math.floor(count + _TOLERANCE)
        ages.whole[section] = whole
        rest = count - whole
        ages.fraction[section] = rest if rest > _TOLERANCE else 0.0
    return ages


class SampleSchedule:
    """Which channels have a fresh sample in each control period.

    The first reading is fresh everywhere.

    Args:
        config: Figures of the sensors.
        sections: Channels of each sensor, by its name.
        period: Control period, [s].
        seed: Seed of the run.
    """

    def __init__(
        self,
        config: SensorsConfig,
        sections: Mapping[str, slice],
        period: float,
        seed: int,
    ) -> None:
        """Open the streams."""
        self._period = period
        self._sensors: list[tuple[SensorConfig, slice, int]] = []
        self._streams: list[np.random.Generator] = []
        for sensor, section in sections.items():
            self._sensors.append((getattr(config, sensor), section, _FRAMES[sensor]))
            # One frame carries the whole wrench of an ankle.
            device = "foot_force" if sensor == "foot_torque" else sensor
            stream = SENSORS.index(device)
            self._streams.append(make_generator(seed, stream, Effect.DROPS))
        n = max(section.stop for section in sections.values())
        self._fresh = np.ones((BLOCK_LENGTH, n), dtype=np.bool_)
        self._next, self._tick = BLOCK_LENGTH, 0

    @property
    def is_always_fresh(self) -> bool:
        """Return True if no sample is ever held or lost."""
        return not any(
            _is_slow(table, self._period)
            or table.drop_probability > 0.0
            or table.dropout_period > 0.0
            for table, _, _ in self._sensors
        )

    def advance(self) -> BoolArray:
        """Return which channels have a fresh sample, shape (n,).

        The array is to be read only, before the next call.
        """
        if self._next == BLOCK_LENGTH:
            self._fill_block()
        fresh: BoolArray = self._fresh[self._next]
        self._next += 1
        return fresh

    def _fill_block(self) -> None:
        ticks = np.arange(self._tick, self._tick + BLOCK_LENGTH)
        times = self._period * ticks
        for (table, section, n_in_frame), stream in zip(
            self._sensors, self._streams, strict=True
        ):
            is_there = np.ones(BLOCK_LENGTH, dtype=np.bool_)
            if _is_slow(table, self._period):
                count = np.floor(times * table.rate + _TOLERANCE)
                before = np.floor((times - self._period) * table.rate + _TOLERANCE)
                is_there &= count > before
            if table.dropout_period > 0.0:
                slack = _TOLERANCE * self._period
                since = np.mod(times + slack, table.dropout_period)
                is_out = since < table.dropout_duration - slack
                is_there &= ~(is_out & (times + slack >= table.dropout_period))
            fresh = self._fresh[:, section]
            fresh[:] = is_there[:, None]
            if table.drop_probability > 0.0:
                n_frames = fresh.shape[1] // n_in_frame
                drawn = stream.random((BLOCK_LENGTH, n_frames))
                is_kept = drawn >= table.drop_probability
                fresh &= np.repeat(is_kept, n_in_frame, axis=1)
        if self._tick == 0:
            self._fresh[0] = True
        self._tick += BLOCK_LENGTH
        self._next = 0


def _is_slow(table: SensorConfig, period: float) -> bool:
    """Return True if a sensor samples less often than the controller reads."""
    return table.sample_period(period) > period * (1.0 + _TOLERANCE)
