"""The picture of a study with cases: who met what was required."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ballsim.studies.design import Cell, Plan
from ballsim.studies.factor_figures import format_level
from ballsim.studies.factors import Factor, Value
from ballsim.studies.verdicts import Verdict, tally
from ballsim.style import make_figure

__all__ = ["draw_cases", "pick_columns"]

_ROW_HEIGHT = 0.26  # of a case, [inch]
_DARK = 0.5  # share below which the field is dark


def pick_columns(plan: Plan) -> Factor | None:
    """Return the factor whose values are the columns: the axis, else the largest grid.

    Args:
        plan: A study with cases.
    """
    gridded = [factor for factor in plan.study.factors if not factor.is_sampled]
    for factor in gridded:
        if factor.key == plan.study.axis:
            return factor
    return max(gridded, key=lambda factor: len(factor.levels), default=None)


def draw_cases(plan: Plan, verdicts: Sequence[Verdict]) -> Figure:
    """Draw a matrix, a row for each case: the share of runs that met everything.

    With variants there is a row for each of them, which has all of its cases.

    Args:
        plan: A study with cases.
        verdicts: Its verdicts.
    """
    factor = pick_columns(plan)
    levels: Sequence[Value] = ("all",) if factor is None else factor.levels
    groups = plan.variants or [
        (case.name, range(i, i + 1)) for i, case in enumerate(plan.cases)
    ]
    figure, [[axes]] = make_figure(1.3 + _ROW_HEIGHT * len(groups))
    axes.grid(visible=False)
    shares = np.full((len(groups), len(levels)), np.nan)
    for row, (_, cases) in enumerate(groups):
        for column, level in enumerate(levels):

            def is_here(cell: Cell, own: range = cases, level: Value = level) -> bool:
                is_level = factor is None or cell.values[factor.key] == level
                return cell.case in own and is_level

            counts = tally(verdicts, is_here)
            if counts is None:
                continue
            shares[row, column] = share = counts.n_met / counts.n_runs
            style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 7}
            style["color"] = "white" if share < _DARK else "black"
            style["fontweight"] = "bold" if counts.is_met else "normal"
            axes.text(column, row, f"{counts.n_met}/{counts.n_runs}", **style)
    marks = axes.imshow(shares, aspect="auto", cmap="cividis", vmin=0, vmax=1)
    axes.set_xticks(range(len(levels)), [format_level(level) for level in levels])
    axes.set_yticks(range(len(groups)), [name for name, _ in groups])
    axes.tick_params(length=0)
    axes.set_xlabel("" if factor is None else factor.name)
    figure.colorbar(marks, ax=axes, label="share of runs that met all")
    return figure
