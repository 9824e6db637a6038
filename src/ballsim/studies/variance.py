"""Which factor a quantity's variance comes from: Sobol indices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.messages import Array

__all__ = ["Index", "VarianceIndices", "estimate_indices"]


@dataclass(frozen=True, slots=True)
class Index:
    """A share of the variance.

    Attributes:
        value: The estimate; the noise of a small sample can bring it below 0.
        low: Lower end of its 95 % interval (bootstrap over the base points).
        high: Upper end.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class VarianceIndices:
    """Sobol indices of one quantity.

    Attributes:
        first: By factor, the share of the variance that would go on average if it
            were known: what it does on its own, monotonic or not.
        total: By factor, the share that would stay on average if all others were
            known: what it does on its own and together with others.
    """

    first: Mapping[str, Index]
    total: Mapping[str, Index]


def estimate_indices(
    keys: Sequence[str],
    values: Array,
    generator: np.random.Generator,
    n_bootstrap: int = 500,
) -> VarianceIndices | None:
    """Estimate the Sobol indices of a quantity from a Saltelli design.

    Args:
        keys: Keys of the factors.
        values: The quantity at the points of `sampling.design_points`, shape
            (2 + number of factors, n): at the base points A and B, then at A with
            one factor taken from B.
        generator: Random numbers of the bootstrap.
        n_bootstrap: Samples of the bootstrap.

    Returns:
        The indices, or None if a value is missing or nothing varies.

    Source:
        Saltelli et al., Computer Physics Communications 181, 2010, table 2 (b), (f).
    """
    if not np.isfinite(values).all() or np.ptp(values[:2]) == 0.0:
        return None
    n = values.shape[1]
    best = _estimate(values)
    samples = np.array(
        [_estimate(values[:, generator.integers(0, n, n)]) for _ in range(n_bootstrap)]
    )
    low, high = np.percentile(samples, [2.5, 97.5], axis=0)
    first, total = (
        {
            key: Index(*map(float, numbers))
            for key, *numbers in zip(keys, best[i], low[i], high[i], strict=True)
        }
        for i in range(2)
    )
    return VarianceIndices(first, total)


def _estimate(values: Array) -> Array:
    """Return first and total indices, shape (2, number of factors)."""
    from scipy.stats import sobol_indices  # noqa: PLC0415 (takes seconds)

    given = {"f_A": values[0:1], "f_B": values[1:2], "f_AB": values[2:, None, :]}
    found = sobol_indices(func=given, n=values.shape[1])
    return np.array([found.first_order, found.total_order])
