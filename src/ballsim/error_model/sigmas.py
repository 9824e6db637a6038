"""Standard deviations that the estimate's errors should have, over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim.config import Config
from ballsim.error_model.error_system import ErrorSystem, make_error_system, make_start
from ballsim.error_model.linear_estimator import (
    LinearEstimator,
    find_outputs,
    linearise,
)
from ballsim.error_model.sensor_errors import find_sensor_errors
from ballsim.error_model.snapshots import LEVEL
from ballsim.error_model.standing import make_estimator, make_standing_reading
from ballsim_controllers.estimation.state_estimator import StateEstimator
from ballsim_controllers.messages import Array, IntArray, SensorReading
from ballsim_controllers.whole_body.standing_soles import SETTLING

__all__ = [
    "BOTH",
    "LANDED",
    "LEFT",
    "RIGHT",
    "ErrorPrediction",
    "find_support",
    "predict_errors",
]

BOTH, LEFT, RIGHT, LANDED = range(4)
"""Feet that bear the robot: both for a while, one, or both since a moment ago."""

_SETTLED = 2048  # ticks after which the gains of the filters do not change any more
_PER_OCTAVE = 16  # instants before that
_LEAST_SHARE = 0.1  # of the load that a foot bears which counts
_STRIDE = 64  # ticks between two instants after it, at most


@dataclass(frozen=True, slots=True)
class ErrorPrediction:
    """How large the errors of the state estimate should be.

    Attributes:
        time: Instants, increasing, from 0 to the end of the run, shape (n,), [s].
        tick: Their control ticks.
        covariance: Of the errors and innovations, shape (n, q, q), rows and columns as
            `ballsim.error_model.linear_estimator.find_outputs` tells.
        last_system: The error system of one tick on both feet at the end of the run.
        last_state: Covariance of its state then.
    """

    time: Array
    tick: IntArray
    covariance: Array
    last_system: ErrorSystem
    last_state: Array

    def find_columns(self, quantity: str) -> slice:
        """Return where a quantity, or an innovation, is in the covariances."""
        return find_outputs(quantity)

    def find_covariance(self, quantity: str, ticks: range | None = None) -> Array:
        """Return the covariances of one quantity, shape (k, d, d).

        Args:
            quantity: See `sigma`.
            ticks: For the last instants not after these ticks; all instants if None.
        """
        columns = self.find_columns(quantity)
        covariances: Array = self.covariance[:, columns, columns]
        if ticks is None:
            return covariances
        last: IntArray = np.searchsorted(self.tick, ticks, side="right") - 1
        chosen: Array = covariances[last]
        return chosen

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


def predict_errors(config: Config, support: IntArray | None = None) -> ErrorPrediction:
    """Predict the errors of the state estimate of a run from its configuration alone.

    The estimator's update is linearised in the nominal stance, at the first tick and
    again each time when half as many have gone by, as its gains settle; the errors of
    the sensors go through it from the start on. No simulation, no truth: what a run
    adds, errors of the model behind the estimator, is not in it.

    Args:
        config: The run.
        support: Feet that bear the robot at each tick, see `find_support`, shape
            (n_ticks,); both throughout if None. On one foot there is one leg less to
            average over, and soles that have just landed may pivot.
    """
    period, n_ticks = config.simulation.control_period, config.n_ticks
    if support is None:
        support = find_support(np.ones((n_ticks, 2)), period)
    feet = support
    estimator, robot = make_estimator(config)
    readings = [
        make_standing_reading(estimator, robot, share) for share in (0.5, 1.0, 0.0, 0.5)
    ]
    sensors = find_sensor_errors(config.sensors, readings[BOTH], period)
    system = make_error_system(
        config, linearise(estimator, readings[BOTH]), sensors, is_first=True
    )
    P = make_start(config, system, sensors)
    ticks, covariances = [0], [system.observe(P)]
    P = system.advance(P)
    estimator.update(readings[BOTH])
    tick, until = 1, 1
    while tick < n_ticks:
        if tick == until:  # the gains as they are now hold for half as long again
            until = tick + max(1, tick // 2) if tick < _SETTLED else n_ticks
            last = [BOTH] if until >= n_ticks else []  # of which the system is kept
            longest = min(max(1, tick // _PER_OCTAVE), _STRIDE)
            single = {
                foot: make_error_system(
                    config, _linearise(estimator, readings[foot], foot), sensors
                )
                for foot in np.unique([*feet[tick:until], *last]).tolist()
            }
            strides: dict[tuple[int, int], ErrorSystem] = {}
            for bearing in feet[tick:until] if until < n_ticks else ():
                estimator.update(readings[bearing])
        foot, stride = int(feet[tick]), longest
        while np.any(feet[tick : tick + stride] != foot) or (
            tick + stride > until and until < n_ticks
        ):
            stride //= 2
        if (foot, stride) not in strides:
            strides[foot, stride] = single[foot].repeat(stride)
        many = strides[foot, stride]
        ticks.append(tick)
        covariances.append(many.observe(P))
        P = many.advance(P)
        tick += stride
    instants = np.array(ticks)
    return ErrorPrediction(
        period * instants, instants, np.array(covariances), single[BOTH], P
    )


def _linearise(
    estimator: StateEstimator, reading: SensorReading, foot: int
) -> LinearEstimator:
    """Linearise an estimator whose soles stand for good, unless they have `LANDED`."""
    levels = estimator.arguments[LEVEL]
    stood = levels["stood"].copy()
    levels["stood"] = 0.0 if foot == LANDED else 2.0 * SETTLING
    linear = linearise(estimator, reading)
    levels["stood"] = stood
    return linear


def find_support(normal_forces: Array, period: float) -> IntArray:
    """Return which feet bear the robot: `BOTH`, `LEFT`, `RIGHT` or `LANDED`.

    Args:
        normal_forces: On each foot, left first, shape (n, 2), [N].
        period: Time between two of these, [s].

    Returns:
        Shape (n,).
    """
    left, right = normal_forces.T
    least = _LEAST_SHARE * (left + right)
    bearing = np.where(right < least, LEFT, np.where(left < least, RIGHT, LANDED))
    ticks = np.arange(len(bearing))
    landing = np.maximum.accumulate(np.where(bearing == LANDED, -1, ticks))
    has_stood = period * (ticks - landing) > SETTLING
    support: IntArray = np.where(has_stood, BOTH, bearing)
    return support
