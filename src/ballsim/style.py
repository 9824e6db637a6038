"""Style of all figures: readable in print and by the colour-blind.

Colours are those of Okabe and Ito; line styles tell the same lines apart.
"""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

__all__ = ["COLOURS", "REFERENCE", "STYLE", "make_figure"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#000000")

STYLE: Any = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9,
    "font.size": 8,
    "grid.alpha": 0.3,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "lines.linewidth": 1.1,
    "svg.hashsalt": "ballsim",
}
"""For `matplotlib.rc_context`."""

REFERENCE: dict[str, Any] = {"color": "#777777", "linewidth": 0.8}


def make_figure(
    height: float, rows: int = 1, columns: int = 1
) -> tuple[Figure, list[list[Axes]]]:
    """Return a figure of a page's width and its axes, row by row.

    Args:
        height: Height, [inch].
        rows: Rows of axes.
        columns: Columns of axes.
    """
    figure = Figure(figsize=(7.0, height), dpi=150, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    return figure, axes.tolist()
