"""The paper's controller on the full-physics robot, beside ``wheeled-lip``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ballsim.config_io import load_config
from ballsim.controller_registry import list_controllers
from ballsim.simulation import KeptRun, run
from ballsim.style import COLOURS, STYLE, make_figure

__all__ = ["draw_cop", "draw_survival", "run_controller", "run_standing"]

MENDED = "controller.feedback.is_commanded_cop_in_output=true"
"""Override for the controller ``paper``: the commanded CoP in y."""


def run_controller(
    scenario: str, controller: str, ball_radius: float, duration: float, *overrides: str
) -> KeptRun:
    """Run a scenario in full physics, without any files.

    Args:
        scenario: Name of the scenario.
        controller: Registered name of the controller.
        ball_radius: r0, [m].
        duration: Time to simulate, [s].
        overrides: More texts ``key=value``.

    Raises:
        ConfigError: An input is not valid, or the controller is not registered.
    """
    given = (
        f"controller.name={controller}",
        f"ball.radius_m={ball_radius}",
        f"duration_s={duration}",
    )
    return run(load_config(scenario, [*given, *overrides]).config)


def run_standing(
    ball_radii: Sequence[float], duration: float
) -> dict[str, list[KeptRun]]:
    """Let the controller ``paper`` stand on some balls, as printed and mended.

    An installation may be older than the controller's entry point. Then
    ``wheeled-lip`` stands in its place.

    Args:
        ball_radii: Radii r0, [m].
        duration: Time to simulate, [s].

    Returns:
        Runs by the controller's name, one for each ball.
    """
    variants: dict[str, tuple[str, ...]] = {"wheeled-lip": ("wheeled-lip",)}
    if "paper" in list_controllers():
        variants = {"paper": ("paper",), "paper, commanded CoP in y": ("paper", MENDED)}
    return {
        name: [
            run_controller("stand", controller, radius, duration, *overrides)
            for radius in ball_radii
        ]
        for name, (controller, *overrides) in variants.items()
    }


def draw_survival(runs: Mapping[str, Sequence[KeptRun]]) -> Figure:
    """Draw how long the robot stood, for each controller and ball.

    Args:
        runs: Runs by the controller's name, on the same balls each.
    """
    with matplotlib.rc_context(STYLE):
        figure, ((ax,),) = make_figure(2.6)
        width = 0.8 / max(1, len(runs))
        for i, (name, results) in enumerate(runs.items()):
            places = np.arange(len(results)) + (i + 0.5) * width - 0.4
            times = [result.simulated_time for result in results]
            bars = ax.bar(places, times, 0.9 * width, color=COLOURS[i], label=name)
            texts = [_survival_text(result) for result in results]
            ax.bar_label(bars, texts, fontsize=7)
            radii = [result.config.ball.radius for result in results]
            ax.set_xticks(np.arange(len(radii)), [f"{radius:g} m" for radius in radii])
        ax.set(xlabel="radius of the ball", ylabel="time on the ball [s]")
        ax.margins(y=0.25)
        ax.legend(ncols=len(runs))
        return figure


def _survival_text(result: KeptRun) -> str:
    time = result.simulated_time
    return "still up" if result.is_upright else f"{time:.2f} s"


def draw_cop(runs: Mapping[str, KeptRun]) -> Figure:
    """Draw ideal and measured CoP along the heading, relative to the ball.

    Args:
        runs: Runs by the title of their panel.
    """
    with matplotlib.rc_context(STYLE):
        figure, grid = make_figure(2.1 * len(runs), len(runs), 1)
        for (ax,), (title, result) in zip(grid, runs.items(), strict=True):
            series = result.series
            n, told = series.n_ticks, series.telemetry
            time, ball = series.time[:n], told.position_ball_in_world[:n, 0]
            ideal, measured = told.ideal_cop[:n, 0], told.cop_in_world[:n, 0]
            ax.plot(time, 1e3 * (ideal - ball), "--", color=COLOURS[1], label="ideal")
            line: dict[str, Any] = {"color": COLOURS[0], "label": "measured"}
            ax.plot(time, 1e3 * (measured - ball), **line)
            ax.set(title=title, ylabel="CoP $-$ ball [mm]", ylim=(-250.0, 250.0))
        grid[-1][0].set_xlabel("time [s]")
        grid[0][0].legend()
        return figure
