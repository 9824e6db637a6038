"""Noise of the simulated sensors: one code path for every sensor and preset.

A channel reads ``truth + bias + walk + white``: the bias is drawn once for each run,
the white part and the step of the walk for each control period. Every sensor has its
own streams of random numbers, and every effect beside bias and white noise has one of
its own, so that a change of one figure leaves all other draws, and its own standard
draws, as they are (common random numbers).
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.messages import Array

__all__ = ["BLOCK_LENGTH", "Effect", "NoiseModel", "SensorChannels", "make_generator"]

BLOCK_LENGTH = 256  # samples drawn at once, for speed


class Effect(enum.IntEnum):
    """Streams of a sensor beside the one of its bias and white noise."""

    WALK = 0
    SCALE = 1
    MISALIGNMENT = 2
    COUPLING = 3
    DROPS = 4


def make_generator(seed: int, *stream: int) -> np.random.Generator:
    """Return the generator of one stream of random numbers of a run.

    Args:
        seed: Seed of the run.
        stream: Number of the stream, such as the index of a sensor; followed by an
            `Effect` for that of one effect.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=stream)
    return np.random.Generator(np.random.Philox(sequence))


@dataclass(frozen=True, slots=True)
class SensorChannels:
    """Noise figures of one sensor.

    Attributes:
        n_channels: Number of scalars that it reads.
        noise_std: Standard deviation of the white part, in the sensor's unit.
        bias_std: Standard deviation of the constant bias, likewise.
        generator: The stream of both.
        walk_std: Standard deviation of the walk's step in one control period.
        walk_generator: The stream of the walk; needed if there is one.
    """

    n_channels: int
    noise_std: float
    bias_std: float
    generator: np.random.Generator
    walk_std: float = 0.0
    walk_generator: np.random.Generator | None = None


class NoiseModel:
    """What the channels of all sensors add to the truth: bias, walk, white noise.

    Args:
        sensors: Sensors in the order of their channels.
    """

    def __init__(self, sensors: Sequence[SensorChannels]) -> None:
        """Draw the biases and the first block of noise."""
        self._sensors = tuple(sensors)
        n_channels = sum(sensor.n_channels for sensor in sensors)
        self._errors = np.empty((BLOCK_LENGTH, n_channels))
        self._bias = np.concatenate(
            [s.bias_std * s.generator.standard_normal(s.n_channels) for s in sensors]
        )
        self._walk = np.zeros(n_channels)
        self._next = BLOCK_LENGTH

    @property
    def bias(self) -> Array:
        """Return a copy of the biases at the start of the run, shape (n_channels,)."""
        return self._bias.copy()

    def draw(self) -> Array:
        """Return what one sample adds, shape (n_channels,).

        The array is to be read only, before the next call.
        """
        if self._next == BLOCK_LENGTH:
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
            if sensor.walk_generator is not None and sensor.walk_std > 0.0:
                steps = sensor.walk_generator.standard_normal(errors.shape)
                walk = self._walk[start:stop] + np.cumsum(
                    sensor.walk_std * steps, axis=0
                )
                self._walk[start:stop] = walk[-1]
                errors += walk
            if sensor.noise_std > 0.0:
                white = sensor.generator.standard_normal(errors.shape)
                errors += sensor.noise_std * white
            start = stop
        self._next = 0
