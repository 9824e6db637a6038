"""Snapshots of ball, wheel, pendulum and feet, as in Figs. 6, 7 and 10."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from ballsim.paper.planar_simulation import PlanarRun
from ballsim_controllers.footsteps.conditions import foot_rotation
from ballsim_controllers.messages import Array

__all__ = ["draw_posture", "draw_snapshots"]

_BALL = "#999999"
_BODY = "#000000"
_FEET = ("#0072B2", "#D55E00")
_LIFT = 0.06
"""How far a swinging foot is drawn off the ball, [m]."""


def _radial(angle: float) -> Array:
    """Return the direction at an angle from the vertical, clockwise."""
    return np.array([np.sin(angle), np.cos(angle)])


def draw_posture(ax: Axes, run: PlanarRun, row: int, shift: float = 0.0) -> None:
    """Draw ball, wheel, pendulum and both feet at one instant.

    Args:
        ax: Where to draw, both axes in [m].
        run: The run.
        row: Row of its time series.
        shift: Displacement to the right, [m].
    """
    params, (th1, th2, th4) = run.params, run.outputs[row].tolist()
    r0, r1, contact = params.ball_radius, params.wheel_radius, th1 + th2
    centre = np.array([shift + r0 * th1, r0])
    wheel = centre + (r0 + r1) * _radial(contact)
    swing = th1 + params.wheel_ratio * th2 + th4
    com = wheel + params.pendulum_length * _radial(swing)
    ax.add_patch(Circle(tuple(centre), r0, fill=False, edgecolor=_BALL))
    ax.plot(*np.column_stack((centre, centre + r0 * _radial(th1))), color=_BALL, lw=0.8)
    ax.add_patch(Circle(tuple(wheel), r1, fill=False, edgecolor=_BODY, lw=0.6))
    ax.plot(*np.column_stack((wheel, com)), color=_BODY)
    ax.plot(*com, "o", color=_BODY, markersize=4)
    half = run.footsteps.half_length
    for foot, colour in enumerate(_FEET):
        place = float(run.feet[row, foot])
        is_swinging = run.swing_feet[row] == foot
        roll = 0.0
        if not is_swinging:
            roll = foot_rotation(th2, place, run.footsteps.half_angle)
        # A sole that rolls by theta_d touches at theta_c + theta_d, and its centre
        # lies r0 theta_d behind that point.
        direction = th1 + place + roll
        touch = centre + (r0 + (_LIFT if is_swinging else 0.0)) * _radial(direction)
        along = _radial(direction + np.pi / 2.0)
        middle = touch - r0 * roll * along
        ends = np.column_stack((middle - half * along, middle + half * along))
        ax.plot(*ends, color=colour, lw=2.0, ls=":" if is_swinging else "-")


def draw_snapshots(runs: Sequence[PlanarRun], times: Sequence[float] | Array) -> Figure:
    """Draw some instants side by side, a row for each run: Figs. 7 and 10.

    Args:
        runs: The runs.
        times: Instants, [s]; those after a fall are left out.
    """
    heights = [2.0 * run.params.ball_radius + 1.2 for run in runs]
    size = (7.0, 0.8 * sum(heights))
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    grid = figure.subplots(len(runs), 1, squeeze=False, height_ratios=heights)
    for ax, run, height in zip(grid[:, 0], runs, heights, strict=True):
        pitch, shown = 2.2 * run.params.ball_radius + 0.3, 0
        for i, time in enumerate(times):
            row = round(float(time) / run.dt)
            if row < len(run.outputs):
                draw_posture(ax, run, row, i * pitch)
                place = i * pitch + run.params.ball_radius * run.outputs[row, 0]
                ax.text(place, -0.03, f"{time:g} s", ha="center", va="top", fontsize=7)
                shown += 1
        ax.axhline(0.0, color=_BALL, linewidth=0.8)
        ax.set(aspect="equal", ylim=(-0.25, height), yticks=[], xticks=[])
        ax.set_title(f"$r_0$ = {run.params.ball_radius:g} m", loc="left")
        ax.spines[:].set_visible(False)
        ax.grid(visible=False)
    return figure
