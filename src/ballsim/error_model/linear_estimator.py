"""The estimator as a linear system, by finite differences of its own update."""

from __future__ import annotations

from dataclasses import dataclass, fields
from types import SimpleNamespace

import numpy as np

from ballsim.estimate_errors import subtract_estimates
from ballsim_controllers.estimation.state_estimator import (
    StateEstimator,
    update_estimate,
)
from ballsim_controllers.geometry import rotation_from_vector, rotation_vector_between
from ballsim_controllers.messages import (
    ESTIMATE,
    Array,
    Record,
    SensorReading,
    telemetry_dtype,
)

__all__ = [
    "TRUNK_ATTITUDE",
    "LinearEstimator",
    "Snapshot",
    "linearise",
    "restore",
    "take_snapshot",
]

#: What the estimator keeps from tick to tick and is wrong about: the index of the
#: record among `StateEstimator.arguments`, the field, its number of components.
#: Attitudes are turned about the axes of the world.
_MEMORY = (
    (1, "rotation", 3),  # of the ball
    (1, "gyro", 3),
    (1, "position", 3),
    (1, "linear_velocity", 3),
    (2, "rotation", 3),  # of the trunk
    (2, "velocity", 3),
    (2, "gyro", 3),
    (0, "trunk_from_ball", 3),
    (0, "com_velocity", 3),
    (3, "velocity", 2),  # of the levelling
    (3, "rest", 2),
    (3, "bias", 3),
)
TRUNK_ATTITUDE = 12
"""First component of the trunk's attitude among what the estimator keeps."""

_KEPT = 5  # records that change: fusion, ball, tilt, levelling, contacts
_STEP = 1e-6  # of the finite differences, in SI units

Snapshot = tuple[Record, ...]


@dataclass(frozen=True, slots=True)
class LinearEstimator:
    r"""First order of one update, ``x' = A x + B z``, ``y = C x + D z``.

    Attributes:
        A: From the errors of what it keeps to those after the update, (n, n).
        B: From the errors of the reading to the same, (n, m).
        C: From the errors of what it keeps to those of the estimate, (q, n).
        D: From the errors of the reading to the same, (q, m).
    """

    A: Array
    B: Array
    C: Array
    D: Array

    def __post_init__(self) -> None:
        """Forbid changes."""
        for field in fields(self):
            getattr(self, field.name).flags.writeable = False


def take_snapshot(estimator: StateEstimator) -> Snapshot:
    """Return a copy of all that an estimator keeps from tick to tick."""
    return tuple(record.copy() for record in estimator.arguments[:_KEPT])


def restore(estimator: StateEstimator, snapshot: Snapshot) -> None:
    """Put an estimator back to where it was."""
    for record, kept in zip(estimator.arguments[:_KEPT], snapshot, strict=True):
        record[:] = kept


def linearise(estimator: StateEstimator, reading: SensorReading) -> LinearEstimator:
    """Return the first order of the next update; the estimator stays as it is.

    Central differences, exact to the second order. What it keeps are attitudes too,
    whose errors are rotation vectors in the world: an error state on the manifold.

    Args:
        estimator: The estimator, before the update.
        reading: The reading that it gets.
    """
    before = take_snapshot(estimator)
    n = sum(size for *_, size in _MEMORY)
    m = reading.record.view(np.float64).size - 1  # but for the time
    # As in a controller: what is compiled for one of them serves here, too.
    reports: Record = np.zeros(
        2 * (n + m) + 1, telemetry_dtype(len(reading.joint_positions))
    )
    estimates = reports["estimate"]
    update_estimate(estimates[-1:], reading.record, *estimator.arguments)
    after = take_snapshot(estimator)
    kept = np.empty((2 * (n + m), n))
    for row in range(2 * (n + m)):
        restore(estimator, before)
        i, step = row // 2, -_STEP if row % 2 else _STEP
        disturbed = reading.record
        if i < n:
            _disturb(estimator, i, step)
        else:
            disturbed = disturbed.copy()
            disturbed.view(np.float64)[i - n + 1] += step
        update_estimate(estimates[row : row + 1], disturbed, *estimator.arguments)
        kept[row] = _compare(estimator, after)
    restore(estimator, before)
    rows = np.hstack([kept, _subtract(estimates[:-1], estimates[-1:])])
    columns = (rows[::2] - rows[1::2]).T / (2.0 * _STEP)
    return LinearEstimator(
        columns[:n, :n], columns[:n, n:], columns[n:, :n], columns[n:, n:]
    )


def _disturb(estimator: StateEstimator, component: int, step: float) -> None:
    """Change one component of what an estimator keeps."""
    for index, name, size in _MEMORY:
        if component < size:
            field = estimator.arguments[index][name][0]
            if name == "rotation":
                turn = np.zeros(3)
                turn[component] = step
                field[:] = rotation_from_vector(turn) @ field
            else:
                field[component] += step
            return
        component -= size


def _compare(estimator: StateEstimator, snapshot: Snapshot) -> list[float]:
    """Return what an estimator keeps less a snapshot."""
    errors: list[float] = []
    for index, name, _ in _MEMORY:
        now, then = estimator.arguments[index][name][0], snapshot[index][name][0]
        is_attitude = name == "rotation"
        error = rotation_vector_between(then, now) if is_attitude else now - then
        errors.extend(error.tolist())
    return errors


def _subtract(estimates: Record, other: Record) -> Array:
    """Return estimates less another one, as estimates less the truth."""
    e, o = (
        SimpleNamespace(**{name: rows[name] for name in ESTIMATE.names or ()})
        for rows in (estimates, np.repeat(other, len(estimates)))
    )
    cop = o.cop_in_world - o.position_ball_in_world[:, :2]
    return subtract_estimates(e, o, cop, o.normal_forces)
