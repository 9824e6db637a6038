"""Points of a sampled design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ballsim.errors import ConfigError
from ballsim.settings import Choice, Integer, check_table, setting

__all__ = ["SamplingConfig", "design_points"]


@dataclass(frozen=True, slots=True)
class SamplingConfig:
    """How the points within the ranges are chosen.

    Attributes:
        method: ``latin-hypercube`` or ``sobol`` (scrambled).
        count: Number of points; a power of two for Sobol points.
        seed: Seed of the points, apart from the seeds of the runs.
    """

    method: str = setting(Choice(("latin-hypercube", "sobol")), "sobol", "method")
    count: int = setting(Integer(2, 2**20), 64, "count")
    seed: int = setting(Integer(), 0, "seed")

    def __post_init__(self) -> None:
        """Check the fields, and the count for Sobol points."""
        check_table(self)
        if self.method == "sobol" and self.count & (self.count - 1):
            raise ConfigError("count", self.count, "a power of two for Sobol points")


def design_points(sampling: SamplingConfig, n_factors: int) -> list[list[float]]:
    """Draw the points of a sampled design in the unit cube.

    Args:
        sampling: How.
        n_factors: Dimension of the cube.

    Returns:
        Points, each with a number in [0, 1) for each factor.
    """
    from scipy.stats import qmc  # noqa: PLC0415 (takes seconds)

    engine: Any
    if sampling.method == "sobol":
        engine = qmc.Sobol(n_factors, scramble=True, rng=sampling.seed)
    else:
        engine = qmc.LatinHypercube(n_factors, rng=sampling.seed)
    points: list[list[float]] = engine.random(sampling.count).tolist()
    return points
