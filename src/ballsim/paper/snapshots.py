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


def draw_posture(
    ax: Axes, run: PlanarRun, row: int, shift: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Draw ball, wheel, pendulum and both feet at one instant.

    Args:
        ax: Where to draw, both axes in [m].
        run: The run.
        row: Row of its time series.
        shift: Where the ball touches the floor, to the right and upwards, [m].
    """
    params, (th1, th2, th4) = run.params, run.outputs[row].tolist()
    r0, r1, contact = params.ball_radius, params.wheel_radius, th1 + th2
    centre = np.array([shift[0], shift[1] + r0])
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
        ax.plot(*ends, color=colour, lw=1.0 if is_swinging else 2.0)


def draw_snapshots(runs: Sequence[PlanarRun], times: Sequence[float] | Array) -> Figure:
    """Draw some instants side by side: Figs. 7 and 10.

    The balls are kept in place; the spoke shows how far each has rolled.

    Args:
        runs: The runs.
        times: Instants, [s]; those after a fall are left out.
    """
    radii = [run.params.ball_radius for run in runs]
    pitch = 2.2 * max(radii) + 0.3
    tops = np.cumsum([2.0 * radius + 1.3 for radius in radii])
    left = -0.5 * pitch - 0.6
    width, height = pitch * len(times) + 0.6, float(tops[-1]) + 0.3
    figure = Figure(figsize=(7.0, 7.0 * height / width), dpi=150, layout="constrained")
    ax = figure.subplots()
    for run, top in zip(runs, tops.tolist(), strict=True):
        radius, floor = run.params.ball_radius, -top
        ax.axhline(floor, color=_BALL, linewidth=0.8)
        ax.text(left, floor - 0.03, f"$r_0$ = {radius:g} m", va="top")
        for i, time in enumerate(times):
            row = round(float(time) / run.dt)
            if row < len(run.outputs):
                draw_posture(ax, run, row, (i * pitch, floor))
                ax.text(i * pitch, floor - 0.03, f"{time:g} s", ha="center", va="top")
    ax.set(aspect="equal", xlim=(left, left + width))
    ax.set(ylim=(-float(tops[-1]) - 0.3, 0.0), xticks=[], yticks=[])
    ax.spines[:].set_visible(False)
    ax.grid(visible=False)
    return figure
