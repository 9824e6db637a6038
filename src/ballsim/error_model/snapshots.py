"""What an estimator keeps from tick to tick, as a vector of errors."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.estimation.state_estimator import StateEstimator
from ballsim_controllers.geometry import rotation_from_vector, rotation_vector_between
from ballsim_controllers.messages import Array, Record

__all__ = [
    "BALL",
    "FUSION",
    "LEVEL",
    "N_KEPT",
    "TILT",
    "TRUNK_ATTITUDE",
    "Snapshot",
    "compare",
    "disturb",
    "restore",
    "take_snapshot",
]

FUSION, BALL, TILT, LEVEL = range(4)
"""Places of the records among `StateEstimator.arguments`."""

_N_RECORDS = 6  # covariances and contacts are kept too

#: What the estimator is wrong about: record, field, number of components. Attitudes
#: are turned about the axes of the world.
_MEMORY = (
    (TILT, "rotation", 3),
    (TILT, "velocity", 3),
    (TILT, "gyro", 3),
    (TILT, "acceleration", 3),
    (TILT, "lead", 3),
    (TILT, "gyro_bias", 3),
    (TILT, "accelerometer_bias", 3),
    (BALL, "rotation", 3),
    (BALL, "gyro", 3),
    (BALL, "bias", 3),
    (BALL, "position", 3),
    (BALL, "linear_velocity", 3),
    (BALL, "angular_velocity", 3),
    (FUSION, "trunk_from_ball", 3),
    (FUSION, "com_velocity", 3),
    (FUSION, "force_bias", 3),
    (FUSION, "angular_velocity_trunk", 3),
    (FUSION, "angular_velocity_ball", 3),
    (LEVEL, "velocity", 2),
    (LEVEL, "lead", 2),
    (LEVEL, "place", 2),
    (LEVEL, "com_offset", 2),
    (LEVEL, "floor_momentum", 2),
    (LEVEL, "offset", 2),
    (LEVEL, "heading_place", 2),
    (LEVEL, "spin", 1),
    (LEVEL, "pivot", 1),
)
N_KEPT = sum(size for *_, size in _MEMORY)
"""Number of components."""
TRUNK_ATTITUDE = 0
"""First of the three components of the trunk's attitude."""

Snapshot = tuple[Record, ...]


def take_snapshot(estimator: StateEstimator) -> Snapshot:
    """Return a copy of all that an estimator keeps from tick to tick."""
    return tuple(record.copy() for record in estimator.arguments[:_N_RECORDS])


def restore(estimator: StateEstimator, snapshot: Snapshot) -> None:
    """Put an estimator back to where it was."""
    for record, kept in zip(estimator.arguments[:_N_RECORDS], snapshot, strict=True):
        record[:] = kept


def disturb(estimator: StateEstimator, component: int, step: float) -> None:
    """Change one component of what an estimator keeps.

    Args:
        estimator: The estimator.
        component: Below `N_KEPT`.
        step: By how much, in SI units.
    """
    for index, name, size in _MEMORY:
        if component < size:
            field = _find_field(estimator.arguments[index], name)
            if name == "rotation":
                turn = np.zeros(3)
                turn[component] = step
                field[:] = rotation_from_vector(turn) @ field
            else:
                field[component] += step
            return
        component -= size


def compare(estimator: StateEstimator, snapshot: Snapshot) -> list[float]:
    """Return what an estimator keeps less a snapshot, `N_KEPT` components."""
    errors: list[float] = []
    for index, name, _ in _MEMORY:
        now = _find_field(estimator.arguments[index], name)
        then = _find_field(snapshot[index], name)
        is_attitude = name == "rotation"
        error = rotation_vector_between(then, now) if is_attitude else now - then
        errors.extend(error.tolist())
    return errors


def _find_field(records: Record, name: str) -> Array:
    """Return a field of the one record that there is, as an array to write to."""
    field: Array = records[name]
    return field if field.ndim == 1 else field[0]
