"""Standard deviations that the estimate's errors should have, over time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ballsim.config import Config
from ballsim.error_model.error_system import make_error_system, make_start
from ballsim.error_model.linear_estimator import linearise
from ballsim.error_model.sensor_errors import find_sensor_errors
from ballsim.error_model.standing import make_estimator, make_standing_reading
from ballsim.estimate_errors import find_components
from ballsim_controllers.messages import Array

__all__ = ["ErrorPrediction", "predict_errors"]

_SETTLED = 2048  # ticks after which the gains of the filters do not change any more
_PER_OCTAVE = 16  # instants before that
_STRIDE = 16  # ticks between two instants after it, at most


@dataclass(frozen=True, slots=True)
class ErrorPrediction:
    """How large the errors of the state estimate should be.

    Attributes:
        time: Instants, increasing, from 0 to the end of the run, shape (n,), [s].
        covariance: Of the errors, shape (n, q, q), rows and columns as
            `ballsim.estimate_errors.find_components` tells.
    """

    time: Array
    covariance: Array

    def find_covariance(self, quantity: str) -> Array:
        """Return the covariances of one quantity, shape (n, d, d)."""
        columns = find_components(quantity)
        return self.covariance[:, columns, columns]

    def sigma(self, quantity: str, time: Array) -> Array:
        """Return standard deviations of a quantity, interpolated.

        Args:
            quantity: One of `ballsim.estimate_errors.ESTIMATE_ERRORS`, whose name
                ends with the unit: ``com_to_ball_m``, ``trunk_tilt_rad`` (about the
                trunk's axes: to the right, forwards), ...
            time: Instants, shape (k,), [s].

        Returns:
            One column per component, shape (k, n_components), in that unit.
        """
        own = self.find_covariance(quantity)
        variances = np.diagonal(own, axis1=1, axis2=2)
        sigmas = np.sqrt(np.maximum(variances, 0.0)).T
        return np.column_stack([np.interp(time, self.time, row) for row in sigmas])


def predict_errors(config: Config) -> ErrorPrediction:
    """Predict the errors of the state estimate of a run from its configuration alone.

    The estimator's update is linearised in the nominal stance, at the first tick and
    at each power of two after it, as its gains settle; the errors of the sensors go
    through it from the start on. No simulation, no truth: what a run adds, errors of
    the model behind the estimator, is not in it.

    Args:
        config: The run.
    """
    period, n_ticks = config.simulation.control_period, config.n_ticks
    estimator, robot = make_estimator(config)
    reading = make_standing_reading(estimator, robot)
    sensors = find_sensor_errors(config.sensors, reading, period)
    system = make_error_system(
        config, linearise(estimator, reading), sensors, is_first=True
    )
    P = make_start(config, system, sensors)
    ticks, covariances = [0], [system.observe(P)]
    P = system.advance(P)
    estimator.update(reading)
    tick, n_seen = 1, 1
    while tick < n_ticks:
        for _ in range(tick - n_seen):
            estimator.update(reading)
        n_seen = tick
        system = make_error_system(config, linearise(estimator, reading), sensors)
        length = tick if tick < _SETTLED else n_ticks - tick
        stride = min(max(1, tick // _PER_OCTAVE), _STRIDE)
        many = system.repeat(stride)
        for _ in range(math.ceil(length / stride)):
            ticks.append(tick)
            covariances.append(many.observe(P))
            P = many.advance(P)
            tick += stride
    return ErrorPrediction(period * np.array(ticks), np.array(covariances))
