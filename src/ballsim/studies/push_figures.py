"""Polar picture of pushes: how hard one may be, by direction."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from ballsim.studies.design import Cell
from ballsim.studies.verdicts import Verdict
from ballsim.style import COLOURS

__all__ = ["borne_forces", "draw_pushes"]

Forces = dict[str, dict[float, dict[float, float]]]
_LINES = ("-", "--", "-.", ":")
_MARKS = "osD^"


def borne_forces(verdicts: Sequence[Verdict]) -> Forces:
    """Return the largest force that every run bore, by scenario, ball and direction.

    A force counts if all runs survived it and all smaller ones that were tried.

    Args:
        verdicts: Verdicts of a study; cells without a single push are left out.

    Returns:
        Scenario, radius [m] and direction [rad] to force [N]; 0 where some run fell at
        the least force.
    """
    tried: dict[tuple[str, float, float], list[tuple[float, bool]]] = {}
    for verdict in verdicts:
        place = _find_push(verdict.cell)
        if place is not None:
            *where, force = place
            counts = verdict.tally
            is_borne = counts.n_survived == counts.n_runs
            tried.setdefault(tuple(where), []).append((force, is_borne))  # type: ignore[arg-type]
    found: Forces = {}
    for (scenario, radius, direction), results in tried.items():
        largest = 0.0
        for force, is_borne in sorted(results):
            if not is_borne:
                break
            largest = force
        found.setdefault(scenario, {}).setdefault(radius, {})[direction] = largest
    return {
        scenario: balls
        for scenario, balls in found.items()
        if any(len(directions) > 2 for directions in balls.values())
    }


def draw_pushes(forces: Forces) -> Figure:
    """Draw a polar panel for each scenario: forwards is up, left is left.

    Args:
        forces: See `borne_forces`, at least one scenario.
    """
    figure = Figure(figsize=(7.0, 3.1), dpi=150, layout="constrained")
    panels = figure.subplots(
        1, len(forces), squeeze=False, subplot_kw={"projection": "polar"}
    )
    for axes, (scenario, balls) in zip(panels[0], forces.items(), strict=True):
        assert isinstance(axes, PolarAxes)
        axes.set_theta_zero_location("N")
        for i, (radius, directions) in enumerate(sorted(balls.items())):
            angles = sorted(directions)
            values = [directions[angle] for angle in angles]
            axes.plot(
                [*angles, angles[0] + 2.0 * math.pi],
                [*values, values[0]],
                color=COLOURS[i % len(COLOURS)],
                linestyle=_LINES[i % len(_LINES)],
                marker=_MARKS[i % len(_MARKS)],
                markersize=3,
                label=f"{radius:g} m",
            )
        axes.set_title(f"{scenario} [N]")
        axes.set_ylim(bottom=0.0)
        axes.tick_params(labelsize=6)
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _find_push(cell: Cell) -> tuple[str, float, float, float] | None:
    """Return scenario, radius, direction and force of a cell with a single push."""
    config = cell.config
    if len(config.pushes) != 1:
        return None
    push = config.pushes[0]
    direction = push.direction % (2.0 * math.pi)
    return config.scenario, config.ball.radius, direction, push.force
