"""Pictures of several factors at once: maps and the ranking."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ballsim.studies.analysis import Analysis, count_survival
from ballsim.studies.definition import Study
from ballsim.studies.factors import Factor, Value, is_number
from ballsim.style import COLOURS, REFERENCE, make_figure

__all__ = [
    "draw_indices",
    "draw_map",
    "draw_sensitivities",
    "format_level",
    "list_pairs",
]

_MAX_MAPS = 4
_MAX_RANKINGS = 4


def list_pairs(study: Study, analysis: Analysis) -> list[tuple[Factor, Factor]]:
    """Return the pairs of factors that get a map: the axis with each other one."""
    axis = analysis.axis
    if axis is None or not axis.is_numeric:
        return []
    return [
        (axis, other)
        for other in study.factors
        if other is not axis
        and other.is_numeric
        and other.is_sampled == axis.is_sampled
        and len(other.levels) > 1
    ][:_MAX_MAPS]


def draw_map(analysis: Analysis, across: Factor, up: Factor) -> Figure:
    """Draw survival over two factors: a field for each pair of levels, or points."""
    counts = count_survival(analysis.rows, [across.key, up.key])
    figure, [[axes]] = make_figure(3.4)
    axes.grid(visible=False)
    marks: Any
    if across.is_sampled:
        x, y = np.array(list(counts), dtype=float).T
        shares = [survived / n for survived, n in counts.values()]
        marks = axes.scatter(
            x,
            y,
            c=shares,
            cmap="cividis",
            vmin=0,
            vmax=1,
            edgecolors="k",
            linewidths=0.4,
        )
        axes.set_xscale("log" if across.is_log else "linear")
        axes.set_yscale("log" if up.is_log else "linear")
    else:
        xs, ys = sorted({key[0] for key in counts}), sorted({key[1] for key in counts})
        grid = np.full((len(ys), len(xs)), np.nan)
        for (x_value, y_value), (survived, n) in counts.items():
            row, column = ys.index(y_value), xs.index(x_value)
            grid[row, column] = survived / n
            colour = "white" if survived < 0.5 * n else "black"
            text = f"{survived}/{n}"
            style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6}
            if len(xs) <= 14:
                axes.text(column, row, text, color=colour, **style)
        marks = axes.imshow(
            grid, origin="lower", aspect="auto", cmap="cividis", vmin=0, vmax=1
        )
        axes.set_xticks(range(len(xs)), [format_level(value) for value in xs])
        axes.set_yticks(range(len(ys)), [format_level(value) for value in ys])
    axes.set_xlabel(across.name)
    axes.set_ylabel(up.name)
    figure.colorbar(marks, ax=axes, label="share still up at the end")
    return figure


def draw_sensitivities(study: Study, analysis: Analysis) -> Figure:
    """Draw the rank regression, one panel for each quantity."""
    found = dict(list(analysis.sensitivities.items())[:_MAX_RANKINGS])
    names = {factor.key: factor.name for factor in study.factors}
    n_factors = len(next(iter(found.values())).coefficients)
    figure, [panels] = make_figure(0.9 + 0.3 * n_factors, 1, len(found))
    # The same order in all panels, the most important for survival on top.
    first = next(iter(found.values())).coefficients
    keys = sorted(first, key=lambda key: abs(first[key]))
    for axes, (name, result) in zip(panels, found.items(), strict=True):
        values = np.array([result.coefficients[key] for key in keys])
        low = np.array([result.low[key] for key in keys])
        high = np.array([result.high[key] for key in keys])
        bars = [np.maximum(0.0, values - low), np.maximum(0.0, high - values)]
        places = np.arange(len(keys))
        axes.barh(places, values, xerr=bars, color=COLOURS[0], alpha=0.7, capsize=2)
        is_first = axes is panels[0]
        axes.set_yticks(places, [names[key] if is_first else "" for key in keys])
        axes.axvline(0.0, **REFERENCE)
        axes.set_xlim(-1.1, 1.1)
        axes.set_title(f"{name}\nexplained {result.explained:.0%}")
    return figure


def draw_indices(study: Study, analysis: Analysis) -> Figure:
    """Draw the Sobol indices, one panel for each quantity."""
    found = dict(list(analysis.indices.items())[:_MAX_RANKINGS])
    names = {factor.key: factor.name for factor in study.factors}
    figure, [panels] = make_figure(0.9 + 0.4 * len(names), 1, len(found))
    # The same order in all panels, the most important for the first on top.
    total = next(iter(found.values())).total
    keys = sorted(total, key=lambda key: total[key].value)
    places = np.arange(len(keys))
    for axes, (name, result) in zip(panels, found.items(), strict=True):
        for label, indices, shift, colour, hatch in (
            ("first order", result.first, 0.2, COLOURS[0], ""),
            ("total", result.total, -0.2, COLOURS[1], "//"),
        ):
            values = np.array([indices[key].value for key in keys])
            low = np.array([indices[key].low for key in keys])
            high = np.array([indices[key].high for key in keys])
            bars = [np.maximum(0.0, values - low), np.maximum(0.0, high - values)]
            style: dict[str, Any] = {"color": colour, "alpha": 0.7, "hatch": hatch}
            style |= {"height": 0.36, "capsize": 2, "label": label}
            axes.barh(places + shift, values, xerr=bars, **style)
        is_first = axes is panels[0]
        axes.set_yticks(places, [names[key] if is_first else "" for key in keys])
        axes.axvline(0.0, **REFERENCE)
        axes.set_xlim(-0.3, 1.3)
        axes.set_xlabel("share of the variance")
        axes.set_title(name)
    panels[-1].legend(loc="lower right")
    return figure


def format_level(value: Value) -> str:
    """Return a value for a tick or a legend."""
    return f"{value:.3g}" if is_number(value) else str(value)
