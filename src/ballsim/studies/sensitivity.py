"""Which factor matters most: a ranking over many factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.messages import Array

__all__ = ["Sensitivity", "rank_sensitivities"]

_RUNS_PER_FACTOR = 3  # fewest cells for each coefficient


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Standardised rank regression of one quantity on all factors.

    Attributes:
        coefficients: Coefficient of each factor, by its key: by how many standard
            deviations the rank of the quantity moves if that of the factor moves
            by one.
        low: Lower ends of their 95 % intervals (bootstrap over the cells).
        high: Upper ends.
        explained: Share of the ranks' variance that the regression explains; a low
            one says that effects interact or are not monotonic.
    """

    coefficients: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    explained: float


def rank_sensitivities(
    factors: Mapping[str, Sequence[float]],
    quantity: Sequence[float],
    generator: np.random.Generator,
    n_bootstrap: int = 500,
) -> Sensitivity | None:
    """Rank factors by their monotonic effect on a quantity.

    Sobol indices want a design of their own, see `variance`; ranks do with any grid
    or sample, and do not mind outliers such as falls.

    Args:
        factors: Values of each factor at every cell, by key.
        quantity: The quantity at every cell; NaN where it has none.
        generator: Random numbers of the bootstrap.
        n_bootstrap: Samples of the bootstrap.

    Returns:
        The coefficients, or None if there are too few cells or nothing varies.

    Source:
        Saltelli et al., Global Sensitivity Analysis: The Primer, 2008, section 1.2.5.
    """
    y = np.array(quantity, dtype=float)
    is_used = np.isfinite(y)
    x = np.array(list(factors.values()), dtype=float).T
    if not x.size:
        return None
    x, y = x[is_used], y[is_used]
    n, m = x.shape
    if (
        n < _RUNS_PER_FACTOR * (m + 1)
        or np.ptp(y) == 0
        or (np.ptp(x, axis=0) == 0).any()
    ):
        return None
    ranks, target = _standard_ranks(x), _standard_ranks(y[:, None])[:, 0]
    best = _regress(ranks, target)
    residual = target - ranks @ best
    samples = []
    for _ in range(n_bootstrap):
        chosen = generator.integers(0, n, n)
        if np.ptp(target[chosen]) > 0 and (np.ptp(ranks[chosen], axis=0) > 0).all():
            samples.append(_regress(_scale(ranks[chosen]), _scale(target[chosen])))
    low, high = np.percentile(samples, [2.5, 97.5], axis=0)
    keys = list(factors)
    return Sensitivity(
        coefficients=dict(zip(keys, best.tolist(), strict=True)),
        low=dict(zip(keys, low.tolist(), strict=True)),
        high=dict(zip(keys, high.tolist(), strict=True)),
        explained=1.0 - float(residual @ residual) / n,
    )


def _standard_ranks(columns: Array) -> Array:
    """Return ranks, ties shared, with mean 0 and standard deviation 1."""
    from scipy.stats import rankdata  # noqa: PLC0415 (takes seconds)

    return _scale(rankdata(columns, axis=0))


def _scale(columns: Array) -> Array:
    result: Array = (columns - columns.mean(axis=0)) / columns.std(axis=0)
    return result


def _regress(x: Array, y: Array) -> Array:
    coefficients: Array = np.asarray(np.linalg.lstsq(x, y, rcond=None)[0], dtype=float)
    return coefficients
