"""How far the controller's state estimate is from the truth."""

from __future__ import annotations

from typing import Any

import numpy as np

from ballsim.heading_error import compute_headings
from ballsim.series import RunSeries
from ballsim.truth import ContactTruth, StateTruth
from ballsim_controllers.messages import Array

__all__ = [
    "ESTIMATE_ERRORS",
    "MIN_LOAD",
    "MeanSquares",
    "compute_error_components",
    "compute_estimate_errors",
    "count_components",
    "find_components",
    "subtract_estimates",
]

MIN_LOAD = 20.0  # least force on both feet for a CoP to mean anything, [N]

# Quantities and how many components each has; the names end with the unit.
_COMPONENTS = {
    "trunk_tilt_rad": 3,
    "trunk_yaw_rad": 1,
    "trunk_angular_velocity_rad_s": 3,
    "com_to_ball_m": 3,
    "com_velocity_m_s": 3,
    "ball_position_m": 3,
    "ball_velocity_m_s": 3,
    "ball_angular_velocity_rad_s": 3,
    "cop_to_ball_m": 2,
    "normal_force_n": 2,
}
ESTIMATE_ERRORS = tuple(_COMPONENTS)
_FIRST_COLUMNS = np.cumsum([0, *_COMPONENTS.values()])[:-1]


class MeanSquares:
    """Running means and maxima of squares; what is not finite does not count.

    Args:
        n_columns: Number of quantities.
    """

    def __init__(self, n_columns: int) -> None:
        """Begin with nothing."""
        self._sums, self._maxima = np.zeros(n_columns), np.zeros(n_columns)
        self._counts = np.zeros(n_columns, dtype=np.int64)

    def add(self, squares: Array) -> None:
        """Add squares, shape (n, n_columns)."""
        is_finite = np.isfinite(squares)
        squares = np.where(is_finite, squares, 0.0)
        self._sums += squares.sum(axis=0)
        self._counts += is_finite.sum(axis=0)
        np.maximum(self._maxima, squares.max(axis=0), out=self._maxima)

    def root_means(self) -> list[float | None]:
        """Return the root mean squares; None for a quantity without any value."""
        return self._roots(self._sums / np.maximum(self._counts, 1))

    def root_maxima(self) -> list[float | None]:
        """Return the greatest absolute values; None likewise."""
        return self._roots(self._maxima)

    def _roots(self, squares: Array) -> list[float | None]:
        pairs = zip(np.sqrt(squares).tolist(), self._counts.tolist(), strict=True)
        return [root if count > 0 else None for root, count in pairs]


def count_components() -> int:
    """Return how many numbers make up the error of an estimate."""
    return sum(_COMPONENTS.values())


def find_components(quantity: str) -> slice:
    """Return the columns of a quantity among those of `compute_error_components`."""
    first = int(_FIRST_COLUMNS[ESTIMATE_ERRORS.index(quantity)])
    return slice(first, first + _COMPONENTS[quantity])


def compute_estimate_errors(
    series: RunSeries,
    truth: StateTruth,
    contact: ContactTruth,
    contact_before: tuple[Array, Array] | None,
) -> Array:
    """Return the squared distance between estimate and truth at each tick.

    Args:
        series: See `compute_error_components`, as what follows.
        truth: True states.
        contact: True contact of the feet.
        contact_before: That of the tick before.

    Returns:
        Shape (n, 10), columns as in `ESTIMATE_ERRORS`; NaN where either side is
        not defined.
    """
    errors = compute_error_components(series.telemetry, truth, contact, contact_before)
    squares: Array = np.add.reduceat(errors * errors, _FIRST_COLUMNS, axis=1)
    return squares


def compute_error_components(
    estimates: Any,
    truth: StateTruth,
    contact: ContactTruth,
    contact_before: tuple[Array, Array] | None,
) -> Array:
    """Return the estimate less the truth at each tick.

    A contact is stored with the tick before it, so the estimate of a tick is
    compared with the contact of the row before.

    Args:
        estimates: Estimates of a run, one per tick; fields as in `StateEstimate`.
        truth: True states, at these ticks and one more.
        contact: True contact of the feet.
        contact_before: Normal forces and CoP of the tick before the first row,
            None at the start of the run.

    Returns:
        Shape (n, n_components), columns as `find_components` tells.
    """
    n = len(contact.normal_forces)
    forces, cop = np.full((n, 2), np.nan), np.full((n, 2), np.nan)
    if contact_before is not None:
        forces[0], cop[0] = contact_before
    forces[1:] = contact.normal_forces[:-1]
    cop[1:] = contact.cop_to_ball_in_world[:-1]
    cop[forces.sum(axis=1) < MIN_LOAD] = np.nan
    return subtract_estimates(estimates, truth, cop, forces)


def subtract_estimates(estimate: Any, truth: Any, cop: Array, forces: Array) -> Array:
    """Return estimates less true states.

    Args:
        estimate: Has the fields of `StateEstimate`, n rows each.
        truth: Has those of `StateTruth` but the soles, n rows or more.
        cop: True CoP relative to the ball's centre, shape (n, 2), [m].
        forces: True normal force on each foot, shape (n, 2), [N].

    Returns:
        Shape (n, n_components), columns as `find_components` tells.
    """
    e, n = estimate, len(cop)
    ball, true_ball = e.position_ball_in_world, truth.position_ball_in_world[:n]
    com, true_com = e.position_com_in_world, truth.position_com_in_world[:n]
    attitude, true_attitude = (
        e.quaternion_trunk_to_world,
        truth.quaternion_trunk_to_world[:n],
    )
    yaw = compute_headings(attitude) - compute_headings(true_attitude)
    return np.column_stack(
        [
            _cross(_vertical_in_trunk(attitude), _vertical_in_trunk(true_attitude)),
            (yaw + np.pi) % (2.0 * np.pi) - np.pi,
            e.angular_velocity_trunk_in_trunk
            - truth.angular_velocity_trunk_in_trunk[:n],
            (com - ball) - (true_com - true_ball),
            e.linear_velocity_com_in_world - truth.linear_velocity_com_in_world[:n],
            ball - true_ball,
            e.linear_velocity_ball_in_world - truth.linear_velocity_ball_in_world[:n],
            e.angular_velocity_ball_in_world - truth.angular_velocity_ball_in_world[:n],
            e.cop_in_world - ball[:, :2] - cop,
            e.normal_forces - forces,
        ]
    )


def _vertical_in_trunk(quaternions: Array) -> tuple[Array, Array, Array]:
    """Return the components of the world's vertical in the trunk, shape (n,) each."""
    w, x, y, z = quaternions.T
    return 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


def _cross(a: tuple[Array, Array, Array], b: tuple[Array, Array, Array]) -> Array:
    """Return the vector product, shape (n, 3), of vectors given by components."""
    return np.column_stack(
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    )
