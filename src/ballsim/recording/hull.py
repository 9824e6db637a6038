"""The support polygon."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.messages import Array

__all__ = ["find_hull"]

Point = tuple[float, float]


def find_hull(points: Array) -> Array:
    """Return the convex hull of some points, counter-clockwise and closed.

    Andrew's monotone chain (1979). SciPy has a hull, but takes longer to import than
    the recording takes in all.

    Args:
        points: Shape (n, 2), none or at least three.

    Returns:
        Shape (m, 2), its last row equal to its first; no rows for no points.
    """
    ordered: list[Point] = sorted((x, y) for x, y in points.tolist())
    if not ordered:
        return np.empty((0, 2))
    lower, upper = _walk(ordered), _walk(ordered[::-1])
    return np.array([*lower[:-1], *upper])


def _walk(points: list[Point]) -> list[Point]:
    """Return the points at which the way turns left only."""
    chain: list[Point] = []
    for x, y in points:
        while len(chain) >= 2:
            (x0, y0), (x1, y1) = chain[-2:]
            if (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) > 0.0:
                break
            chain.pop()
        chain.append((x, y))
    return chain
