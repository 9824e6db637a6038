"""The panels of the page of figures: each draws one thing of a run into axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from ballsim.inspection.scaling import add_legend, find_walk_end, limit_to_walk
from ballsim.inspection.support import compute_support, find_landings
from ballsim.run_result import RunResult
from ballsim.style import COLOURS, REFERENCE

__all__ = [
    "draw_ball_angle",
    "draw_ball_speed",
    "draw_cop",
    "draw_cop_deviation",
    "draw_estimate_errors",
    "draw_foot_forces",
    "draw_footsteps",
    "draw_joint_torques",
]

_FEET: tuple[tuple[str, dict[str, Any]], ...] = (
    ("left", {"color": COLOURS[0], "linestyle": "-"}),
    ("right", {"color": COLOURS[1], "linestyle": "--"}),
)
_TRUTH: dict[str, Any] = {"color": COLOURS[3], "linestyle": "-"}
_ESTIMATE: dict[str, Any] = {"color": COLOURS[0], "linestyle": "--"}
_IDEAL: dict[str, Any] = {"color": COLOURS[1], "linestyle": "--"}
_ASKED: dict[str, Any] = {"color": COLOURS[2], "linestyle": "-."}
_SUPPORT = "#D0D0D0"
_MOST_SUPPORT = 150.0  # of it that is shown on each side of the CoP, [mm]
_LEG_JOINTS = ("hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll", "hip_yaw")
_LINES = ("-", "--", "-.", (0, (1, 1)), (0, (5, 1, 1, 1)), (0, (3, 1, 1, 1, 1, 1)))


def draw_ball_angle(ax: Axes, run: RunResult) -> None:
    """Draw the ball angle, what was asked for, and the swings: Figs. 8 and 11."""
    true, asked = run["truth/ball/angle"], run["control/ball/angle"]
    believed = run["estimate/ball/angle"]
    ax.plot(true.time, true["forward"], label="ball", **_TRUTH)
    ax.plot(believed.time, believed["forward"], label="estimate", **_ESTIMATE)
    ax.plot(asked.time, asked["reference"], label="reference", **_ASKED)
    ax.step(asked.time, asked["target"], where="post", label="target", **REFERENCE)
    _mark_swings(ax, run)
    ax.set(title="ball angle and swinging foot", ylabel="angle [rad]")
    add_legend(ax)


def draw_ball_speed(ax: Axes, run: RunResult) -> None:
    """Draw the speed of the ball along both axes: Fig. 12."""
    _draw_pair(ax, run, "truth/ball/rate", ("forward", "left"))
    ax.set(title="ball speed", ylabel="speed [rad/s]")


def draw_cop(ax: Axes, run: RunResult, axis: str) -> None:
    """Draw ideal and actual CoP within the support region, as in Fig. 5.

    Args:
        ax: Where to draw.
        run: The run.
        axis: ``forward`` or ``left``.
    """
    actual, wanted = run["truth/cop"], run["control/cop"]
    time, low, high = compute_support(run, axis)
    ax.fill_between(
        time,
        1e3 * low,
        1e3 * high,
        color=_SUPPORT,
        linewidth=0.0,
        label="support",
        step="post",
    )
    ax.plot(actual.time, 1e3 * actual[axis], label="actual", **_TRUTH)
    ax.plot(wanted.time, 1e3 * wanted[f"ideal_{axis}"], label="ideal", **_IDEAL)
    cop = 1e3 * actual[axis]
    walked = cop[(actual.time < find_walk_end(run)) & np.isfinite(cop)]
    # A foot that stumbles spreads the support far beyond what the CoP makes use of.
    least = walked.min(initial=0.0) - _MOST_SUPPORT
    most = walked.max(initial=0.0) + _MOST_SUPPORT
    edges = ((time, 1e3 * low), (time, 1e3 * high), (actual.time, cop))
    limit_to_walk(ax, [(run, t, np.clip(values, least, most)) for t, values in edges])
    ax.set(title=f"centre of pressure, {axis}", ylabel="from the ball [mm]")
    add_legend(ax, 3)


def draw_cop_deviation(ax: Axes, run: RunResult) -> None:
    """Draw actual minus ideal CoP along both axes: Fig. 13."""
    actual, wanted = run["truth/cop"], run["control/cop"]
    curves = []
    for axis, (_, line) in zip(("forward", "left"), _FEET, strict=True):
        deviation = 1e3 * (actual[axis] - wanted[f"ideal_{axis}"])
        ax.plot(actual.time, deviation, label=axis, **line)
        curves.append((run, actual.time, deviation))
    limit_to_walk(ax, curves)
    ax.set(title=r"CoP, actual $-$ ideal", ylabel="deviation [mm]")
    add_legend(ax)


def draw_foot_forces(ax: Axes, run: RunResult) -> None:
    """Draw the normal force on each foot."""
    _draw_pair(ax, run, "truth/foot_forces", ("left", "right"))
    ax.set(title="force of the ball on each foot", ylabel="normal force [N]")


def draw_joint_torques(ax: Axes, run: RunResult, side: str) -> None:
    """Draw the torques of a leg as parts of their limits.

    Args:
        ax: Where to draw.
        run: The run.
        side: ``left`` or ``right``.
    """
    torques, limits = run["truth/joints/torque"], run["limits/joints/torque"]
    names = [name for name in torques.columns if name.startswith(f"{side}_")]
    legs = [name for name in names if any(joint in name for joint in _LEG_JOINTS)]
    colours = (*COLOURS, "#CC79A7", "#E69F00")
    for name, colour, line in zip(legs, colours, _LINES, strict=False):
        part = torques[name] / limits[f"{name}_high"][0]
        label = name.removeprefix(f"{side}_").replace("_", " ")
        ax.plot(torques.time, part, color=colour, linestyle=line, label=label)
    for limit in (-1.0, 1.0):
        ax.axhline(limit, **REFERENCE)
    ax.set(title=f"joint torques, {side} leg", ylabel="part of the limit")
    ax.set_ylim(-1.1, 1.1)
    add_legend(ax, 3)


def draw_estimate_errors(ax: Axes, run: RunResult) -> None:
    """Draw estimate minus truth: ball angle and attitude [mrad], CoM [mm]."""
    angles, com = run["estimate/error/angles"], run["estimate/error/com"]
    shown = (
        (angles, "ball_forward", "ball angle [mrad]"),
        (angles, "pitch", "trunk pitch [mrad]"),
        (angles, "roll", "trunk roll [mrad]"),
        (com, "forward", "CoM forward [mm]"),
        (com, "left", "CoM left [mm]"),
    )
    colours = (*COLOURS, "#CC79A7")
    curves = []
    for (series, column, label), colour, line in zip(
        shown, colours, _LINES, strict=False
    ):
        values = 1e3 * series[column]
        ax.plot(series.time, values, color=colour, linestyle=line, label=label)
        curves.append((run, series.time, values))
    limit_to_walk(ax, curves)
    ax.set(title=r"estimate $-$ truth", ylabel="error")
    add_legend(ax)


def draw_footsteps(ax: Axes, run: RunResult) -> None:
    """Draw the footprints on the unrolled ball, and the way of the actual CoP."""
    angle, actual = run["truth/ball/angle"], run["truth/cop"]
    radius = run.config.ball.radius
    rolled = angle.at(actual.time) * radius
    # The ball rolls away beneath the feet: its surface moves against its centre.
    path = np.column_stack([actual["forward"], actual["left"]]) - rolled
    path = path[actual.time < find_walk_end(run)]
    ax.plot(path[:, 0], path[:, 1], color="#777777", linewidth=0.6, label="CoP")
    for foot, corners in find_landings(run):
        style = dict(_FEET)[foot]
        patch = Polygon(corners, fill=False, edgecolor=style["color"], linewidth=0.8)
        patch.set_linestyle(style["linestyle"])
        ax.add_patch(patch)
    for foot, line in _FEET:
        ax.plot([], [], label=foot, **line)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set(
        title="footprints on the unrolled ball",
        xlabel="forward [m]",
        ylabel="left [m]",
    )
    ax.legend(ncols=3, loc="upper center")


def _draw_pair(ax: Axes, run: RunResult, path: str, columns: tuple[str, str]) -> None:
    """Draw two components of a series."""
    series = run[path]
    for column, (_, line) in zip(columns, _FEET, strict=True):
        ax.plot(series.time, series[column], label=column, **line)
    limit_to_walk(ax, [(run, series.time, series[column]) for column in columns])
    add_legend(ax)


def _mark_swings(ax: Axes, run: RunResult) -> None:
    """Draw at the foot of the axes which foot swings."""
    forces = run["truth/foot_forces"]
    low, high = ax.get_ylim()
    height = 0.04 * (high - low)
    for i, (foot, line) in enumerate(_FEET):
        is_up = forces[foot] < 1.0
        base = low - (i + 1) * 1.5 * height
        ax.fill_between(
            forces.time,
            base,
            base + height,
            where=is_up,
            color=line["color"],
            linewidth=0.0,
            label=f"{foot} swings",
        )
