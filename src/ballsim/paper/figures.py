"""The figures of Section VI, in the manner of the paper's, from our runs."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ballsim.paper.experiments import Experiment
from ballsim.paper.planar_simulation import NO_FOOT, PlanarRun
from ballsim.paper.snapshots import draw_snapshots
from ballsim.paper.style import BALL_LINES
from ballsim.style import COLOURS, REFERENCE, STYLE, make_figure

__all__ = [
    "FORMATS",
    "PAPER_FIGURES",
    "draw_deviations",
    "draw_outputs",
    "draw_target_changes",
    "draw_velocities",
    "render",
]

FORMATS = ("png", "svg")

_ANGLES: tuple[dict[str, Any], ...] = (
    {"color": COLOURS[0], "linestyle": "-", "label": r"$\theta_1$"},
    {"color": COLOURS[1], "linestyle": "--", "label": r"$\theta_2$"},
    {"color": COLOURS[3], "linestyle": ":", "label": r"$\theta_4\, r_1/r_0$"},
)
_SWING_COLOUR = COLOURS[2]
Drawing = Callable[[Sequence[Experiment]], Figure]


def _label(experiment: Experiment) -> str:
    fall = experiment.run.fall_time
    suffix = "" if fall is None else f" (falls at {fall:.1f} s)"
    return f"$r_0$ = {experiment.ball_radius:g} m{suffix}"


def _swing_mark(run: PlanarRun, size: float) -> np.ndarray:
    """Return 0 in double support, one of two levels for the foot that swings."""
    levels = np.array([0.5, 1.0, 0.0]) * size
    mark: np.ndarray = levels[np.where(run.swing_feet == NO_FOOT, 2, run.swing_feet)]
    return mark


def draw_outputs(experiments: Sequence[Experiment], last: float = 12.0) -> Figure:
    """Draw the measured output and the footsteps of each run: Figs. 8 and 11.

    Args:
        experiments: Runs, one panel for each.
        last: End of the time axis, [s].
    """
    with matplotlib.rc_context(STYLE):
        columns = min(2, len(experiments))
        rows = -(-len(experiments) // columns)
        figure, grid = make_figure(2.3 * rows, rows, columns)
        axes = [ax for row in grid for ax in row]
        for ax, experiment in zip(axes, experiments, strict=False):
            run = experiment.run
            shown = run.time <= last
            time, ratio = run.time[shown], run.params.wheel_ratio - 1.0
            outputs = run.outputs[shown] / (1.0, 1.0, ratio)
            for values, line in zip(outputs.T, _ANGLES, strict=True):
                ax.plot(time, values, **line)
            size = 0.25 * float(np.abs(outputs).max())
            mark = _swing_mark(run, size)[shown]
            ax.step(time, mark, color=_SWING_COLOUR, linewidth=0.8, label="swing foot")
            for switch in experiment.switches:
                ax.axvline(switch.time, linestyle=":", **REFERENCE)
            ax.set(title=_label(experiment), xlabel="time [s]", ylabel="angle [rad]")
        axes[0].legend(ncols=2)
        return figure


def draw_target_changes(experiments: Sequence[Experiment]) -> Figure:
    """Draw theta_1 on each ball while its target changes: Fig. 9.

    Args:
        experiments: Runs, a panel for each name.
    """
    with matplotlib.rc_context(STYLE):
        names = list(dict.fromkeys(experiment.name for experiment in experiments))
        figure, grid = make_figure(2.6, 1, len(names))
        for ax, name in zip(grid[0], names, strict=True):
            chosen = [e for e in experiments if e.name == name]
            run = chosen[0].run
            ax.step(run.time, run.targets, label=r"$\theta_1^*$", **REFERENCE)
            for item in chosen:
                values = item.run.outputs[:, 0]
                ax.plot(item.run.time, values, label=_label(item), **_line(item))
            ax.set(xlabel="time [s]", ylabel=r"$\theta_1$ [rad]", xlim=(0.0, 16.0))
        grid[0][0].legend()
        return figure


def draw_velocities(experiments: Sequence[Experiment]) -> Figure:
    """Draw theta_1' over the whole run and at its end: Fig. 12.

    Args:
        experiments: Runs at constant velocity, a row for each parameter set.
    """
    return _draw_rows(
        experiments,
        lambda run: run.ball_rates,
        r"$\dot\theta_1$ [rad/s]",
        ((-0.15, 0.55), (0.35, 0.45)),
    )


def draw_deviations(experiments: Sequence[Experiment]) -> Figure:
    """Draw actual minus ideal theta_2, and an enlarged view: Fig. 13.

    Args:
        experiments: Runs at constant velocity, a row for each parameter set.
    """
    return _draw_rows(
        experiments,
        lambda run: 1e3 * run.deviations,
        r"actual $-$ ideal $\theta_2$ [mrad]",
        ((-15.0, 15.0), (-5.0, 5.0)),
    )


def _draw_rows(
    experiments: Sequence[Experiment],
    values_of: Callable[[PlanarRun], np.ndarray],
    label: str,
    limits: tuple[tuple[float, float], tuple[float, float]],
) -> Figure:
    """Draw a row for each parameter set: the whole run, its last ten seconds."""
    with matplotlib.rc_context(STYLE):
        names = list(dict.fromkeys(e.choices.name for e in experiments))
        figure, grid = make_figure(2.4 * len(names), len(names), 2)
        for (whole, end), name in zip(grid, names, strict=True):
            chosen = [e for e in experiments if e.choices.name == name]
            last = max(float(item.run.time[-1]) for item in chosen)
            for item in chosen:
                time, values = item.run.time, values_of(item.run)
                whole.plot(time, values, label=_label(item), **_line(item))
                shown = time >= last - 10.0
                end.plot(time[shown], values[shown], **_line(item))
            whole.set(title=f"set {name}", xlabel="time [s]", ylabel=label)
            end.set(title="enlarged: last 10 s", xlabel="time [s]")
            for ax, limit in zip((whole, end), limits, strict=True):
                ax.set_ylim(*limit)
            whole.legend(ncols=2)
        return figure


def _line(experiment: Experiment) -> dict[str, Any]:
    return BALL_LINES.get(experiment.ball_radius, {})


def _draw_constant_snapshots(experiments: Sequence[Experiment]) -> Figure:
    with matplotlib.rc_context(STYLE):
        return draw_snapshots([e.run for e in experiments], (0.0, 1.0, 2.0, 3.0, 5.0))


def _draw_velocity_snapshots(experiments: Sequence[Experiment]) -> Figure:
    with matplotlib.rc_context(STYLE):
        return draw_snapshots([e.run for e in experiments], np.arange(0.0, 9.0, 1.5))


PAPER_FIGURES: Mapping[str, tuple[str, tuple[str, ...], Drawing]] = {
    "fig07_snapshots": ("constant", ("S2",), _draw_constant_snapshots),
    "fig08_output": ("constant", ("S2",), draw_outputs),
    "fig08_output_s1": ("constant", ("S1",), draw_outputs),
    "fig09_target_changes": ("change", ("S2",), draw_target_changes),
    "fig10_snapshots": ("velocity", ("KNV2",), _draw_velocity_snapshots),
    "fig11_output": ("velocity", ("KNV2",), draw_outputs),
    "fig12_velocity": ("velocity", ("S1", "KNV20", "KNV5"), draw_velocities),
    "fig13_cop_deviation": ("velocity", ("S1", "KNV20", "KNV5"), draw_deviations),
}
"""Figures by the name of their files: beginning of the experiments' name,
parameter sets, function."""


def render(experiments: Iterable[Experiment]) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the contents of every figure's files.

    Args:
        experiments: All runs; a figure that has none is left out.
    """
    runs = list(experiments)
    for stem, (name, sets, draw) in PAPER_FIGURES.items():
        chosen = [e for e in runs if e.name.startswith(name) and e.choices.name in sets]
        if not chosen:
            continue
        figure = draw(chosen)
        for suffix in FORMATS:
            buffer = io.BytesIO()
            metadata = {"Date": None} if suffix == "svg" else None
            with matplotlib.rc_context(STYLE):
                figure.savefig(buffer, format=suffix, metadata=metadata)
            yield f"{stem}.{suffix}", buffer.getvalue()
