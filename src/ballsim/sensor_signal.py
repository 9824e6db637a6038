"""The way of a signal through a sensor: age, distortion, noise, limits, hold."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ballsim.distortion import Distortion
from ballsim.sample_timing import Ages, SampleSchedule
from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Array, IntArray

__all__ = ["SensorSignal"]


class SensorSignal:
    """Shapes the signals of all channels, sample after sample.

    In the order of a real sensor: what it feels is some time old, comes in with the
    wrong scale and along wrong axes, gets bias and noise, is cut off at the ends of
    the range, is rounded, and is sent if a sample is due and not lost.

    Args:
        distortion: Scale, axes, limits and steps.
        ages: How old the signal is.
        schedule: Which samples are taken and arrive.
    """

    def __init__(
        self, distortion: Distortion, ages: Ages, schedule: SampleSchedule
    ) -> None:
        """Load the kernels, on arrays that are thrown away."""
        self._distortion, self._ages, self._schedule = distortion, ages, schedule
        n = len(distortion.steps)
        self._has_matrix = bool(distortion.matrix.any())
        # One sample more than the oldest one, to interpolate.
        self._history = np.full((int(ages.whole.max()) + 2, n), math.nan)
        self._newest = 0
        self._last_row = np.zeros(0)
        if not self.is_plain:
            self.shape(np.zeros(n), np.zeros(n))
            self._history[:], self._newest = math.nan, 0

    @property
    def is_plain(self) -> bool:
        """Return True if the signals get noise and nothing else."""
        is_prompt = not (self._ages.whole.any() or self._ages.fraction.any())
        is_steady = self._schedule.is_always_fresh
        return self._distortion.is_none and is_prompt and is_steady

    def shape(self, truth: Array, errors: Array) -> Array:
        """Return the samples of all channels before they are sent, shape (n,).

        Args:
            truth: True values in the present, shape (n,).
            errors: Bias and noise, shape (n,).
        """
        distortion, ages = self._distortion, self._ages
        values = np.empty_like(truth)
        self._newest = (self._newest + 1) % len(self._history)
        _recall(self._history, self._newest, ages.whole, ages.fraction, truth, values)
        _distort(
            values,
            distortion.matrix,
            self._has_matrix,
            errors,
            distortion.limits,
            distortion.steps,
        )
        return values

    def send(self, row: Array, values: Array, velocities: Array) -> None:
        """Write all of a reading but its time, the last values where none is fresh.

        Args:
            row: The reading as numbers: time, positions, velocities, the rest.
            values: Samples of all channels, positions first, shape (n,).
            velocities: Velocities of the joints, shape (n_joints,), [rad/s].
        """
        if len(self._last_row) != len(row):
            self._last_row = np.zeros(len(row))
        _send(row, self._last_row, values, velocities, self._schedule.advance())


@compiled
def _recall(
    history: Array,
    newest: int,
    whole: IntArray,
    fraction: Array,
    truth: Array,
    values: Array,
) -> None:
    """Store the present and write what each channel feels of the past.

    Args:
        history: Last values of all channels, a ring, shape (depth, n), changed in
            place; NaN before the first ones.
        newest: Row of the ring for the present.
        whole: Whole periods of age, shape (n,).
        fraction: The rest, as a part of a period, shape (n,).
        truth: Present values, shape (n,).
        values: What is written, shape (n,).
    """
    depth, n = history.shape
    if math.isnan(history[(newest + 1) % depth, 0]):
        for k in range(depth):  # the robot stood there before
            if math.isnan(history[k, 0]):
                history[k] = truth
    history[newest] = truth
    for i in range(n):
        later = history[(newest - whole[i]) % depth, i]
        values[i] = later
        if fraction[i] > 0.0:
            earlier = history[(newest - whole[i] - 1) % depth, i]
            values[i] = later + fraction[i] * (earlier - later)


@compiled
def _distort(
    values: Array,
    matrix: Array,
    has_matrix: bool,
    errors: Array,
    limits: Array,
    steps: Array,
) -> None:
    """Apply matrix, errors, limits and steps to the values (in place).

    Args:
        values: Shape (n,).
        matrix: What each channel reads too much of each other one, shape (n, n).
        has_matrix: False if that is nothing.
        errors: Bias and noise, shape (n,).
        limits: Greatest value of either sign, shape (n,).
        steps: What is rounded to, or 0, shape (n,).
    """
    n = values.shape[0]
    true = values.copy()
    for i in range(n):
        if has_matrix:
            extra = 0.0
            for j in range(n):
                extra += matrix[i, j] * true[j]
            values[i] += extra
        value = values[i] + errors[i]
        value = min(max(value, -limits[i]), limits[i])
        if steps[i] > 0.0:
            value = steps[i] * math.floor(value / steps[i] + 0.5)
        values[i] = value


@compiled
def _send(
    row: Array,
    last: Array,
    values: Array,
    velocities: Array,
    fresh: npt.NDArray[np.bool_],
) -> None:
    """Write a reading from fresh samples and the last row (changed in place)."""
    n = velocities.shape[0]
    for i in range(values.shape[0]):
        if fresh[i]:
            if i < n:
                last[1 + i], last[1 + n + i] = values[i], velocities[i]
            else:
                last[1 + n + i] = values[i]
    row[1:] = last[1:]
