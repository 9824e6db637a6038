"""The pictures of a study."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from ballsim.studies.analysis import (
    SURVIVED,
    Analysis,
    Group,
    Point,
)
from ballsim.studies.case_figures import draw_cases
from ballsim.studies.definition import Study
from ballsim.studies.design import Plan
from ballsim.studies.factor_figures import (
    draw_indices,
    draw_map,
    draw_sensitivities,
    format_level,
    list_pairs,
)
from ballsim.studies.factors import Value
from ballsim.studies.push_figures import borne_forces, draw_pushes
from ballsim.studies.survival import estimate_survival_curve
from ballsim.studies.verdicts import Verdict
from ballsim.style import COLOURS, STYLE, make_figure

__all__ = ["render", "render_cases"]

_MORE_COLOURS = ("#CC79A7", "#E69F00", "#56B4E9", "#888888")
_LINES: tuple[dict[str, Any], ...] = tuple(
    {"color": colour, "linestyle": line, "marker": marker}
    for colour, line, marker in zip(
        (*COLOURS, *_MORE_COLOURS),
        ("-", "--", "-.", (0, (1, 1)), (0, (5, 1, 1, 1, 1, 1)), "-", "--", "-."),
        "osD^vPX*",
        strict=True,
    )
)
_MAX_CURVES = 8  # of a panel
_MAX_PANELS = 6
_MAX_BANDS = 4  # of a panel; more would hide each other
_MARGIN = 0.05  # of an axis
_TICK_GAP = 0.06  # least part of an axis between two of its ticks
_MARK_DISTANCE = 4.0  # between the marks of two groups at one level, [pt]


def render(study: Study, analysis: Analysis) -> Iterator[tuple[str, bytes]]:
    """Yield the names and contents of the PNG files.

    Args:
        study: The study.
        analysis: Its numbers.
    """
    with mpl.rc_context(STYLE):
        yield "survival.png", _png(_draw_survival(analysis))
        if any(not row[SURVIVED] for row in analysis.rows):
            yield "time_to_fall.png", _png(_draw_times(analysis))
        if study.metrics and any(row[SURVIVED] for row in analysis.rows):
            yield "metrics.png", _png(_draw_metrics(study, analysis))
        for i, pair in enumerate(list_pairs(study, analysis)):
            yield f"map_{i + 1}.png", _png(draw_map(analysis, *pair))
        if analysis.sensitivities:
            yield "sensitivity.png", _png(draw_sensitivities(study, analysis))
        if analysis.indices:
            yield "indices.png", _png(draw_indices(study, analysis))


def render_cases(
    plan: Plan, verdicts: Sequence[Verdict]
) -> Iterator[tuple[str, bytes]]:
    """Yield the names and contents of the PNG files of a study with cases.

    Args:
        plan: The study.
        verdicts: Its verdicts.
    """
    with mpl.rc_context(STYLE):
        yield "cases.png", _png(draw_cases(plan, verdicts))
        forces = borne_forces(verdicts)
        if forces:
            yield "pushes.png", _png(draw_pushes(forces))


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _axis_positions(analysis: Analysis) -> dict[Value, float]:
    """Return where each level stands: itself if a number, else its rank."""
    levels = [point.level for group in analysis.groups for point in group.points]
    if analysis.axis is not None and analysis.axis.is_numeric:
        return {level: float(level) for level in levels}
    return {level: float(i) for i, level in enumerate(dict.fromkeys(levels))}


def _finish_axis(axes: Axes, analysis: Analysis, positions: dict[Value, float]) -> None:
    factor = analysis.axis
    axes.set_xlabel("" if factor is None else factor.name)
    if factor is None or not factor.is_numeric:
        axes.set_xticks(list(positions.values()), [str(level) for level in positions])
        axes.set_xlim(-0.5, len(positions) - 0.5)
        return
    axes.set_xscale("log" if factor.is_log else "linear")
    if not factor.is_sampled:
        _tick_levels(axes, sorted(positions.values()), factor.is_log)
    # The marks stand beside their places, which hides them from automatic limits.
    low, high = min(positions.values()), max(positions.values())
    if factor.is_log:
        margin = max(1.01, (high / low) ** _MARGIN)
        axes.set_xlim(low / margin, high * margin)
    else:
        margin = _MARGIN * (high - low) or 0.5
        axes.set_xlim(low - margin, high + margin)


def _tick_levels(axes: Axes, levels: list[float], is_log: bool) -> None:
    """Put the ticks at the levels, if these are few and not too close."""
    x = np.log(levels) if is_log else np.array(levels)
    if len(x) < 2 or np.diff(x).min() < _TICK_GAP * np.ptp(x):
        return
    axes.set_xticks(levels, [format_level(level) for level in levels])
    axes.set_xticks([], minor=True)


def _beside(axes: Axes, analysis: Analysis, i: int) -> Any:
    """Return a transformation that puts a group's marks beside those of the others."""
    distance = _MARK_DISTANCE * (i - (len(analysis.groups) - 1) / 2.0)
    figure = axes.get_figure(root=True)
    assert figure is not None
    shift = ScaledTranslation(distance / 72.0, 0.0, figure.dpi_scale_trans)
    return axes.transData + shift


def _draw_survival(analysis: Analysis) -> Figure:
    figure, [[axes]] = make_figure(3.2)
    positions = _axis_positions(analysis)
    for i, (group, line) in enumerate(zip(analysis.groups, _LINES, strict=False)):
        x = np.array([positions[p.level] for p in group.points])
        share = np.array([point.share for point in group.points])
        low, high = np.array([point.interval for point in group.points]).T
        style = line | {"transform": _beside(axes, analysis, i)}
        is_numeric = analysis.axis is not None and analysis.axis.is_numeric
        if group.fit is not None or not is_numeric:
            style["linestyle"] = "none"
        bars = [np.maximum(0.0, share - low), np.maximum(0.0, high - share)]
        label = group.label or None
        axes.errorbar(
            x,
            share,
            bars,
            capsize=2,
            markersize=4,
            elinewidth=0.8,
            label=label,
            **style,
        )
        if group.fit is not None:
            _draw_fit(axes, group, x, line)
    axes.set_ylim(-0.03, 1.03)
    axes.set_ylabel("share still up at the end")
    _finish_axis(axes, analysis, positions)
    if any(group.label for group in analysis.groups):
        axes.legend()
    return figure


def _draw_fit(axes: Axes, group: Group, x: Any, line: dict[str, Any]) -> None:
    assert group.fit is not None
    space = np.geomspace if group.fit.is_log else np.linspace
    dense = space(x.min(), x.max(), 200)
    style = {key: line[key] for key in ("color", "linestyle")}
    axes.plot(dense, group.fit.probability(dense), **style)


def _draw_times(analysis: Analysis) -> Figure:
    groups = list(analysis.groups)[:_MAX_PANELS]
    columns = min(2, len(groups))
    rows = math.ceil(len(groups) / columns)
    figure, grid = make_figure(2.6 * rows + 0.4, rows, columns)
    panels = [axes for line in grid for axes in line]
    for axes, group in zip(panels, groups, strict=False):
        chosen = _spread(group.points, _MAX_CURVES)
        for point, line in zip(chosen, _LINES, strict=False):
            _draw_curve(axes, point, line, len(chosen) <= _MAX_BANDS)
        axes.set_title(group.label)
        axes.set_ylim(-0.03, 1.03)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("share still up")
        name = "" if analysis.axis is None else analysis.axis.name
        axes.legend(title=name, title_fontsize=7)
    for axes in panels[len(groups) :]:
        axes.set_axis_off()
    return figure


def _draw_curve(axes: Axes, point: Point, line: dict[str, Any], has_band: bool) -> None:
    ends = [row["simulated_time"] for row in point.rows]
    curve = estimate_survival_curve(ends, [not row[SURVIVED] for row in point.rows])
    times = np.append(curve.times, max(ends))
    shares, low, high = (
        np.append(values, values[-1])
        for values in (curve.shares, curve.low, curve.high)
    )
    style = {key: line[key] for key in ("color", "linestyle")}
    axes.step(times, shares, where="post", label=format_level(point.level), **style)
    if not has_band:
        return
    shade = {"color": line["color"], "alpha": 0.1, "linewidth": 0}
    axes.fill_between(times, low, high, step="post", **shade)


def _draw_metrics(study: Study, analysis: Analysis) -> Figure:
    columns = min(2, len(study.metrics))
    rows = math.ceil(len(study.metrics) / columns)
    figure, grid = make_figure(2.4 * rows + 0.4, rows, columns)
    panels = [axes for line in grid for axes in line]
    positions = _axis_positions(analysis)
    for axes, metric in zip(panels, study.metrics, strict=False):
        highest = 0.0
        for i, (group, line) in enumerate(zip(analysis.groups, _LINES, strict=False)):
            points = [p for p in group.points if p.quartiles[metric] is not None]
            if not points:
                continue
            x = [positions[point.level] for point in points]
            low, middle, high = np.array([p.quartiles[metric] for p in points]).T
            style = line | {"transform": _beside(axes, analysis, i)}
            if analysis.axis is None or not analysis.axis.is_numeric:
                style["linestyle"] = "none"
            bars = [middle - low, high - middle]
            highest = max(highest, float(high.max()))
            label = group.label or None
            axes.errorbar(
                x, middle, bars, capsize=2, markersize=4, label=label, **style
            )
        axes.set_title(metric)
        axes.set_ylim(0.0, 1.08 * highest if highest > 0.0 else 1.0)
        _finish_axis(axes, analysis, positions)
    for axes in panels[len(study.metrics) :]:
        axes.set_axis_off()
    if any(group.label for group in analysis.groups):
        panels[0].legend()
    return figure


def _spread(points: Sequence[Point], n: int) -> list[Point]:
    """Return at most n points, evenly spread, both ends among them."""
    if len(points) <= n:
        return list(points)
    return [points[round(i * (len(points) - 1) / (n - 1))] for i in range(n)]
