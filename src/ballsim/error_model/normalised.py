r"""Normalised squares of errors and innovations (NEES, NIS) and their bands.

For N runs and errors e of d components with the predicted covariance S,

.. math:: \frac{1}{N d} \sum e^T S^{-1} e

is 1 on the mean, and N d times it is :math:`\chi^2_{N d}` at one instant [Bar-Shalom,
Li, Kirubarajan 2001, section 5.4.2]. Averaged over n instants it varies less, but not
as that of n independent ones: biases do not change from one to the next. How many they
are worth follows from the predicted correlation :math:`\rho_k = L^{-1} C_k L^{-T}` of
errors k instants apart, with S = L L' :

.. math:: n_\mathrm{eff} = \frac{n^2 d}{\sum_{ij} \mathrm{tr} \rho_{i-j} \rho_{i-j}^T}
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ballsim.error_model.sigmas import ErrorPrediction
from ballsim_controllers.messages import Array

__all__ = ["CHECKED", "Consistency", "check_consistency", "count_independent"]

#: Quantities and innovations with the number of components that are looked at: the
#: vertical is left out where only the model knows it.
CHECKED = {
    "trunk_tilt_rad": 2,
    "trunk_yaw_rad": 1,
    "trunk_angular_velocity_rad_s": 3,
    "com_to_ball_m": 2,
    "com_velocity_m_s": 3,
    "ball_position_m": 2,
    "ball_velocity_m_s": 2,
    "ball_angular_velocity_rad_s": 3,
    "cop_to_ball_m": 2,
    "normal_force_n": 2,
    "trunk_velocity_innovation": 3,
    "trunk_place_innovation": 3,
    "com_velocity_innovation": 3,
    "balance_innovation": 2,
}
_LEVEL = 0.99  # of the bands
_LINEAR = 0.1  # by which squares may differ: linearised in the nominal stance


@dataclass(frozen=True, slots=True)
class Consistency:
    """How the errors of a quantity compare with what was predicted.

    Attributes:
        name: Quantity or innovation.
        rms: Of the errors, all components together, in the quantity's unit.
        sensors: The same as the sensors' figures predict it.
        model: The same of the model's errors.
        square: Normalised square, 1 on the mean.
        band: Where 99 % of such squares are, and a tenth more to either side: the
            prediction is linearised in the nominal stance, not where the robot stands.
        n_independent: Independent instants that a run is worth.
    """

    name: str
    rms: float
    sensors: float
    model: float
    square: float
    band: tuple[float, float]
    n_independent: float

    @property
    def is_inside(self) -> bool:
        """Return True if the square is in its band."""
        return self.band[0] <= self.square <= self.band[1]


def check_consistency(
    name: str,
    errors: Array,
    ticks: range,
    predictions: Sequence[ErrorPrediction],
    model: Array,
) -> Consistency:
    """Compare the errors of a quantity in some runs with what was predicted.

    Args:
        name: A key of `CHECKED`.
        errors: Of all runs at some instants, shape (n_runs, n, d).
        ticks: The instants, control ticks.
        predictions: What the sensors' figures predict for each run.
        model: Second moment of the model's errors, shape (d, d).
    """
    from scipy.stats import chi2  # noqa: PLC0415 - slow

    n_runs, _, d = errors.shape
    sensors = np.array([p.find_covariance(name, ticks)[:, :d, :d] for p in predictions])
    roots = np.linalg.cholesky(sensors + model)
    scaled = np.linalg.solve(roots, errors[..., None])[..., 0]
    square = float(np.mean(np.sum(scaled * scaled, axis=2)) / d)
    n_independent = count_independent(name, d, ticks, predictions[0])
    freedom = n_runs * d * n_independent
    low, high = chi2.ppf([0.5 * (1 - _LEVEL), 0.5 * (1 + _LEVEL)], freedom) / freedom

    def root_trace(matrices: Array) -> float:
        return float(np.sqrt(np.mean(np.trace(matrices, axis1=-2, axis2=-1))))

    return Consistency(
        name=name,
        rms=float(np.sqrt(np.mean(np.sum(errors * errors, axis=2)))),
        sensors=root_trace(sensors),
        model=root_trace(model),
        square=square,
        band=(float(low) * (1.0 - _LINEAR), float(high) * (1.0 + _LINEAR)),
        n_independent=n_independent,
    )


def count_independent(
    name: str, d: int, ticks: range, prediction: ErrorPrediction
) -> float:
    """Return how many independent instants some instants of a run are worth.

    Args:
        name: A key of `CHECKED`.
        d: Number of components.
        ticks: The instants.
        prediction: Errors of the same run.
    """
    n = len(ticks)
    outputs = prediction.find_columns(name)
    outputs = slice(outputs.start, outputs.start + d)
    system = prediction.last_system.repeat(ticks.step)
    lags = system.correlate(prediction.last_state, outputs, n)
    inverse = np.linalg.inv(np.linalg.cholesky(lags[0]))
    squares = np.sum((inverse @ lags @ inverse.T) ** 2, axis=(1, 2))
    pairs = 2.0 * (n - np.arange(n))  # that are so far apart
    pairs[0] = n
    return float(n * n * d / (pairs @ squares))
