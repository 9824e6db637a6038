"""Points of a sampled design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ballsim.errors import ConfigError
from ballsim.settings import Choice, Integer, check_table, setting

__all__ = ["SALTELLI", "SamplingConfig", "design_points"]

SALTELLI = "saltelli"

_METHODS = ("latin-hypercube", "sobol", SALTELLI)


@dataclass(frozen=True, slots=True)
class SamplingConfig:
    """How the points within the ranges are chosen.

    Attributes:
        method: ``latin-hypercube``, ``sobol`` (scrambled), or ``saltelli``: Sobol
            points arranged for the indices of `variance.estimate_indices`.
        count: Number of points, of base points for ``saltelli``; a power of two
            unless it is a Latin hypercube.
        seed: Seed of the points, apart from the seeds of the runs.
    """

    method: str = setting(Choice(_METHODS), "sobol", "method")
    count: int = setting(Integer(2, 2**20), 64, "count")
    seed: int = setting(Integer(), 0, "seed")

    def __post_init__(self) -> None:
        """Check the fields, and the count for Sobol points."""
        check_table(self)
        if self.method != "latin-hypercube" and self.count & (self.count - 1):
            raise ConfigError("count", self.count, "a power of two for Sobol points")

    def count_points(self, n_factors: int) -> int:
        """Return the number of points of a design.

        Args:
            n_factors: Dimension of the cube.
        """
        return self.count * (n_factors + 2 if self.method == SALTELLI else 1)


def design_points(sampling: SamplingConfig, n_factors: int) -> list[list[float]]:
    """Draw the points of a sampled design in the unit cube.

    Args:
        sampling: How.
        n_factors: Dimension of the cube.

    Returns:
        Points, each with a number in [0, 1) for each factor. Those of ``saltelli``
        are the base points A, the base points B, and for each factor A with this
        one taken from B.
    """
    from scipy.stats import qmc  # noqa: PLC0415 (takes seconds)

    engine: Any
    if sampling.method == SALTELLI:
        engine = qmc.Sobol(2 * n_factors, scramble=True, rng=sampling.seed)
        a, b = np.hsplit(engine.random(sampling.count), 2)
        mixed = [np.where(np.arange(n_factors) == i, b, a) for i in range(n_factors)]
        arranged: list[list[float]] = np.vstack([a, b, *mixed]).tolist()
        return arranged
    if sampling.method == "sobol":
        engine = qmc.Sobol(n_factors, scramble=True, rng=sampling.seed)
    else:
        engine = qmc.LatinHypercube(n_factors, rng=sampling.seed)
    points: list[list[float]] = engine.random(sampling.count).tolist()
    return points
