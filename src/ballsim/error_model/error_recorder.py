"""Keeps the errors of the state estimate of a run, and its filters' innovations."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np

from ballsim.error_model.innovations import compute_innovations
from ballsim.error_model.snapshots import take_snapshot
from ballsim.error_model.standing import make_estimator
from ballsim.estimate_errors import compute_error_components
from ballsim.preparation import PreparedRun
from ballsim.recording.recorder import RunBlock
from ballsim.sensors import SensorSuite
from ballsim.truth import StateTruth
from ballsim_controllers.estimation.state_estimator import update_estimate
from ballsim_controllers.messages import (
    ESTIMATE,
    Array,
    Record,
    SensorReading,
    reading_dtype,
    telemetry_dtype,
)

__all__ = ["ErrorRecorder"]


class ErrorRecorder:
    """Keeps errors and innovations at all ticks, columns as in `find_outputs`.

    The sensors sample one physics step before the controller gets the reading. The
    estimate is compared with what was true then: a known age is no error of a filter.

    The innovations are those of a second estimator, which gets the readings of the run
    one after the other: the controller's own has no time to report them. A third one
    gets what perfect sensors would have read of the same motion: its errors are those
    of the model behind the estimator alone.

    Args:
        prepared: The run; its sensors are replaced by themselves with perfect ones
            beside them.

    Attributes:
        prepared: What is to be run.
    """

    def __init__(self, prepared: PreparedRun) -> None:
        """Build the estimators."""
        config = prepared.config
        perfect = dataclasses.replace(config.sensors, noise_multiplier=0.0)
        period = config.simulation.control_period
        self._sensors = _TwoSuites(
            prepared.sensors, SensorSuite(prepared.ids, perfect, period, config.seed)
        )
        self.prepared = dataclasses.replace(prepared, sensors=self._sensors)
        self._replays = (_Replay(prepared), _Replay(prepared))
        self._age = 1.0 / config.n_substeps
        self._times: list[Array] = []
        self._loads: list[Array] = []
        self._rows: tuple[list[Array], list[Array]] = [], []
        self._contact_before: tuple[Array, Array] | None = None
        self._truth_before: StateTruth | None = None

    def start(self, context: object) -> None:
        """Do nothing."""

    def record(self, block: RunBlock) -> None:
        """Add the rows of a block."""
        series, contact, n = block.series, block.contact, block.series.n_ticks
        self._times.append(np.array(series.time[:-1]))
        self._loads.append(np.array(series.telemetry.normal_forces[:n]))
        truth = _shift(block.truth, self._truth_before, self._age)
        first = series.first_tick
        perfect = np.concatenate(
            [reading.record for reading in self._sensors.perfect[first : first + n]]
        )
        for readings, replay, rows in zip(
            (series.readings.rows[:n], perfect), self._replays, self._rows, strict=True
        ):
            estimates, innovations = replay.run(readings)
            errors = compute_error_components(
                estimates, truth, contact, self._contact_before
            )
            rows.append(np.hstack([errors, innovations]))
        self._contact_before = (
            contact.normal_forces[-1],
            contact.cop_to_ball_in_world[-1],
        )
        self._truth_before = block.truth

    def close(self) -> None:
        """Do nothing."""

    @property
    def time(self) -> Array:
        """Return the times of the ticks, shape (n,), [s]."""
        return np.concatenate(self._times)

    @property
    def loads(self) -> Array:
        """Return the estimated normal force on each foot, shape (n, 2), [N]."""
        return np.concatenate(self._loads)

    @property
    def rows(self) -> Array:
        """Return the errors and innovations, shape (n, q)."""
        return np.concatenate(self._rows[0])

    @property
    def model_rows(self) -> Array:
        """Return the same with perfect sensors and the same motion, shape (n, q)."""
        return np.concatenate(self._rows[1])


class _TwoSuites(SensorSuite):
    """Sensors of a run with perfect ones beside them, whose readings are kept."""

    def __init__(self, sensors: SensorSuite, perfect: SensorSuite) -> None:
        self._sensors, self._perfect = sensors, perfect
        self.perfect: list[SensorReading] = []

    @property
    def encoder_zeros(self) -> Array:
        return self._sensors.encoder_zeros

    def read(self, time: float, sensordata: Array) -> SensorReading:
        self.perfect.append(self._perfect.read(time, sensordata))
        return self._sensors.read(time, sensordata)


class _Replay:
    """An estimator that gets readings that are already there."""

    def __init__(self, prepared: PreparedRun) -> None:
        self._estimator, robot = make_estimator(prepared.config)
        self._n_joints = robot.joint_count

    def run(self, readings: Record) -> tuple[Any, Array]:
        """Return the estimates, by field, and the innovations, (n, n_innovations)."""
        estimator, rows = self._estimator, []
        reports: Record = np.zeros(len(readings), telemetry_dtype(self._n_joints))
        estimates = reports["estimate"]
        readings = readings.view(reading_dtype(self._n_joints))
        for i in range(len(readings)):
            reading, estimate = readings[i : i + 1], estimates[i : i + 1]
            before = take_snapshot(estimator)
            update_estimate(estimate, reading, *estimator.arguments)
            rows.append(compute_innovations(estimator, before, reading, estimate))
        fields = {name: estimates[name] for name in ESTIMATE.names or ()}
        return SimpleNamespace(**fields), np.array(rows)


def _shift(truth: StateTruth, before: StateTruth | None, share: float) -> StateTruth:
    """Return what was true a share of a period before each row but the last.

    Args:
        truth: Rows of a block, the last one being the first of the next block.
        before: Rows of the block before; None at the start, where all is at rest.
        share: Part of a period.
    """
    shifted = {}
    for field in dataclasses.fields(truth):
        rows = getattr(truth, field.name)
        # The last row of a block is the first one of the next.
        first = rows[:1] if before is None else getattr(before, field.name)[-2:-1]
        earlier = np.concatenate([first, rows[:-1]])
        shifted[field.name] = rows + share * (earlier - rows)
    return dataclasses.replace(truth, **shifted)
