"""What a sensor does to a signal apart from noise: scale, axes, limits, steps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ballsim.noise import Effect, make_generator
from ballsim.sensor_config import SENSORS, ForceConfig, SensorConfig, SensorsConfig
from ballsim_controllers.messages import Array, IntArray

__all__ = ["Distortion", "make_distortion"]


@dataclass(frozen=True, slots=True)
class Distortion:
    """Errors that depend on the signal; channels in the order of the sensors.

    A channel reads ``truth + matrix @ truth + noise``, then cut off at the limits,
    then rounded to a multiple of its step.

    Attributes:
        matrix: What each channel reads too much of each other one, shape (n, n).
        limits: Greatest value that is read, of either sign, shape (n,); infinite
            where there is none.
        steps: What is rounded to, shape (n,); 0 where nothing is.
    """

    matrix: Array
    limits: Array
    steps: Array

    @property
    def is_none(self) -> bool:
        """Return True if nothing is changed at all."""
        has_any = self.matrix.any() or self.steps.any()
        return not has_any and not np.isfinite(self.limits).any()


def make_distortion(
    config: SensorsConfig, sections: Mapping[str, slice], seed: int
) -> Distortion:
    """Draw the errors of scale and axes and collect limits and steps.

    Args:
        config: Figures of the sensors.
        sections: Channels of each sensor, by its name.
        seed: Seed of the run.
    """
    n = max(section.stop for section in sections.values())
    distortion = Distortion(np.zeros((n, n)), np.full(n, math.inf), np.zeros(n))
    for sensor, section in sections.items():
        level = config.find_level(sensor)
        if level == 0.0:
            continue
        table: SensorConfig = getattr(config, sensor)
        stream = SENSORS.index(sensor)
        channels = np.arange(section.start, section.stop)
        scale = make_generator(seed, stream, Effect.SCALE)
        factors = level * table.scale_std * scale.standard_normal(len(channels))
        distortion.matrix[channels, channels] = factors
        axes = level * float(getattr(table, "misalignment_std", 0.0))
        if axes > 0.0:
            generator = make_generator(seed, stream, Effect.MISALIGNMENT)
            for triad in channels.reshape(-1, 3):
                lean = axes * generator.standard_normal((3, 3))
                lean[np.diag_indices(3)] = 0.0
                distortion.matrix[np.ix_(triad, triad)] += lean
        coupling = level * float(getattr(table, "coupling_std", 0.0))
        if coupling > 0.0:
            other = "foot_torque" if sensor == "foot_force" else "foot_force"
            generator = make_generator(seed, stream, Effect.COUPLING)
            others = np.arange(sections[other].start, sections[other].stop)
            for to, of in zip(
                channels.reshape(-1, 3), others.reshape(-1, 3), strict=True
            ):
                share = coupling * generator.standard_normal((3, 3))
                distortion.matrix[np.ix_(to, of)] = share
        _limit(distortion, table, channels)
    return distortion


def _limit(distortion: Distortion, table: SensorConfig, channels: IntArray) -> None:
    """Write the limits and steps of a sensor's channels."""
    distortion.steps[channels] = float(getattr(table, "resolution", 0.0))
    limit = float(getattr(table, "limit", 0.0))
    if limit > 0.0:
        distortion.limits[channels] = limit
    if isinstance(table, ForceConfig):
        vertical = channels.reshape(-1, 3)[:, 2]
        distortion.limits[vertical] = table.limit_z if table.limit_z > 0.0 else math.inf
