"""One line for each of the paper's balls, the same in every figure."""

from __future__ import annotations

from typing import Any

from ballsim.style import COLOURS

__all__ = ["BALL_LINES"]

BALL_LINES: dict[float, dict[str, Any]] = {
    0.25: {"color": COLOURS[0], "linestyle": "-"},
    0.5: {"color": COLOURS[1], "linestyle": "--"},
    0.75: {"color": COLOURS[2], "linestyle": "-."},
    1.0: {"color": COLOURS[3], "linestyle": (0, (1, 1))},
}
"""By radius in [m]."""
