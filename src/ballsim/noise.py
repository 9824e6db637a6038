"""Noise of the simulated sensors: one code path for every sensor and preset.

A channel reads ``truth + bias + white``: the bias is drawn once for each run,
the white part for each sample. Every sensor has its own stream of random
numbers, so that a change of one sensor's figures leaves the draws of all the
others, and its own standard draws, as they are (common random numbers).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ballsim_controllers.messages import Array

__all__ = ["NoiseFigures", "NoiseModel", "SensorChannels", "make_generator"]

_BLOCK_LENGTH = 256  # samples drawn at once, for speed


def make_generator(seed: int, stream: int) -> np.random.Generator:
    """Return the generator of one stream of random numbers of a run.

    Args:
        seed: Seed of the run.
        stream: Number of the stream, such as the index of a sensor.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=(stream,))
    return np.random.Generator(np.random.Philox(sequence))


class NoiseFigures(Protocol):
    """What the configuration says of a sensor, in the sensor's unit."""

    @property
    def noise_multiplier(self) -> float:
        """Return the factor on white part and bias."""
        ...

    @property
    def bias_std(self) -> float:
        """Return the standard deviation of the constant bias."""
        ...

    def sample_std(self, period: float) -> float:
        """Return the standard deviation of the white part over a period in [s]."""
        ...


@dataclass(frozen=True, slots=True)
class SensorChannels:
    """Noise figures of one sensor.

    Attributes:
        n_channels: Number of scalars that it reads.
        noise_std: Standard deviation of the white part, in the sensor's unit.
        bias_std: Standard deviation of the constant bias, likewise.
        generator: The sensor's own stream of random numbers.
    """

    n_channels: int
    noise_std: float
    bias_std: float
    generator: np.random.Generator


class NoiseModel:
    """What the channels of all sensors add to the truth: bias and white noise.

    Args:
        sensors: Sensors in the order of their channels.
    """

    def __init__(self, sensors: Sequence[SensorChannels]) -> None:
        """Draw the biases and the first block of noise."""
        self._sensors = tuple(sensors)
        n_channels = sum(sensor.n_channels for sensor in sensors)
        self._errors = np.empty((_BLOCK_LENGTH, n_channels))
        self._bias = np.concatenate(
            [s.bias_std * s.generator.standard_normal(s.n_channels) for s in sensors]
        )
        self._next = _BLOCK_LENGTH

    @property
    def bias(self) -> Array:
        """Return a copy of the biases of this run, shape (n_channels,)."""
        return self._bias.copy()

    def draw(self) -> Array:
        """Return bias and white noise of one sample, shape (n_channels,).

        The array is to be read only, before the next call.
        """
        if self._next == _BLOCK_LENGTH:
            self._draw_block()
        errors: Array = self._errors[self._next]
        self._next += 1
        return errors

    def _draw_block(self) -> None:
        start = 0
        for sensor in self._sensors:
            stop = start + sensor.n_channels
            errors = self._errors[:, start:stop]
            errors[:] = self._bias[start:stop]
            if sensor.noise_std > 0.0:
                white = sensor.generator.standard_normal(errors.shape)
                errors += sensor.noise_std * white
            start = stop
        self._next = 0
