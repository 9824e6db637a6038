"""The estimator as a linear system, by finite differences of its own update."""

from __future__ import annotations

from dataclasses import dataclass, fields
from types import SimpleNamespace

import numpy as np

from ballsim.error_model.innovations import INNOVATIONS, compute_innovations
from ballsim.error_model.snapshots import (
    N_KEPT,
    compare,
    disturb,
    restore,
    take_snapshot,
)
from ballsim.estimate_errors import (
    count_components,
    find_components,
    subtract_estimates,
)
from ballsim_controllers.estimation.state_estimator import (
    StateEstimator,
    update_estimate,
)
from ballsim_controllers.messages import (
    ESTIMATE,
    Array,
    Record,
    SensorReading,
    telemetry_dtype,
)

__all__ = ["LinearEstimator", "find_outputs", "linearise"]

_STEP = 1e-6  # of the finite differences, in SI units


@dataclass(frozen=True, slots=True)
class LinearEstimator:
    r"""First order of one update, ``x' = A x + B z``, ``y = C x + D z``.

    Attributes:
        A: From the errors of what it keeps to those after the update, (n, n).
        B: From the errors of the reading to the same, (n, m).
        C: From the errors of what it keeps to those of the outputs, (q, n).
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


def find_outputs(name: str) -> slice:
    """Return where a quantity of the estimate, or an innovation, is in the outputs.

    Args:
        name: One of `ballsim.estimate_errors.ESTIMATE_ERRORS` or of `INNOVATIONS`.
    """
    if name not in INNOVATIONS:
        return find_components(name)
    names = list(INNOVATIONS)
    before = [INNOVATIONS[other] for other in names[: names.index(name)]]
    first = count_components() + sum(before)
    return slice(first, first + INNOVATIONS[name])


def linearise(estimator: StateEstimator, reading: SensorReading) -> LinearEstimator:
    """Return the first order of the next update; the estimator stays as it is.

    Central differences, exact to the second order. What it keeps are attitudes too,
    whose errors are rotation vectors in the world: an error state on the manifold.

    Args:
        estimator: The estimator, before the update.
        reading: The reading that it gets.
    """
    before = take_snapshot(estimator)
    m = reading.record.view(np.float64).size - 1  # but for the time
    n_rows = 2 * (N_KEPT + m)
    # As in a controller: what is compiled for one of them serves here, too.
    n_joints = len(reading.joint_positions)
    reports: Record = np.zeros(n_rows + 1, telemetry_dtype(n_joints))
    estimates = reports["estimate"]
    update_estimate(estimates[-1:], reading.record, *estimator.arguments)
    after = take_snapshot(estimator)
    kept = np.empty((n_rows, N_KEPT))
    innovations = np.empty((n_rows, sum(INNOVATIONS.values())))
    for row in range(n_rows):
        i, step = row // 2, -_STEP if row % 2 else _STEP
        restore(estimator, before)
        disturbed = reading.record
        if i < N_KEPT:
            disturb(estimator, i, step)
        else:
            disturbed = disturbed.copy()
            disturbed.view(np.float64)[i - N_KEPT + 1] += step
        start, estimate = take_snapshot(estimator), estimates[row : row + 1]
        update_estimate(estimate, disturbed, *estimator.arguments)
        kept[row] = compare(estimator, after)
        innovations[row] = compute_innovations(estimator, start, disturbed, estimate)
    restore(estimator, before)
    errors = _subtract(estimates[:-1], estimates[-1:])
    rows = np.hstack([kept, errors, innovations])
    columns = (rows[::2] - rows[1::2]).T / (2.0 * _STEP)
    to_kept, to_output = np.split(columns, [N_KEPT])
    A, B = np.split(to_kept, [N_KEPT], axis=1)
    C, D = np.split(to_output, [N_KEPT], axis=1)
    return LinearEstimator(A, B, C, D)


def _subtract(estimates: Record, other: Record) -> Array:
    """Return estimates less another one, as estimates less the truth."""
    e, o = (
        SimpleNamespace(**{name: rows[name] for name in ESTIMATE.names or ()})
        for rows in (estimates, np.repeat(other, len(estimates)))
    )
    cop = o.cop_in_world - o.position_ball_in_world[:, :2]
    return subtract_estimates(e, o, cop, o.normal_forces)
