"""Where the soles are that carry the robot."""

from __future__ import annotations

import numpy as np

from ballsim.paths import robot_description_path
from ballsim.run_result import RunResult
from ballsim_controllers.messages import Array
from ballsim_controllers.robot import load_robot_description

__all__ = ["compute_support", "find_landings"]

_MIN_LOAD = 20.0  # of a foot that counts as support, [N]
_FEET = ("left", "right")


def compute_support(run: RunResult, axis: str) -> tuple[Array, Array, Array]:
    """Return the edges of the support region over time.

    The soles are taken as level and as straight ahead, which they nearly are.

    Args:
        run: The run.
        axis: ``forward`` or ``left``.

    Returns:
        Times, shape (n,), [s]; lower and upper edge from the ball's centre, [m], NaN
        where nothing carries.
    """
    soles, forces = run["truth/soles"], run["truth/foot_forces"]
    half = _half_sizes(run)[0 if axis == "forward" else 1]
    loads = forces.at(soles.time)
    centres = np.column_stack([soles[f"{foot}_{axis}"] for foot in _FEET])
    is_carrying = loads > _MIN_LOAD
    low = np.where(is_carrying, centres - half, np.inf).min(axis=1)
    high = np.where(is_carrying, centres + half, -np.inf).max(axis=1)
    is_empty = ~is_carrying.any(axis=1)
    low[is_empty] = high[is_empty] = np.nan
    return soles.time, low, high


def find_landings(run: RunResult) -> list[tuple[str, Array]]:
    """Return the footprints on the unrolled ball, that at the start first.

    Args:
        run: The run.

    Returns:
        Foot and corners of its sole, shape (4, 2), forwards and to the left along
        the surface from the place below the feet at the start, [m].
    """
    soles, angle = run["truth/soles"], run["truth/ball/angle"]
    half_length, half_width = _half_sizes(run)
    box = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (half_length, half_width)
    moments = [(foot, 0.0) for foot in _FEET]
    for event in run.events:
        for foot in _FEET:
            if event.text.startswith(f"{foot} foot lands"):
                moments.append((foot, event.time))
    footprints = []
    for foot, time in moments:
        values = dict(zip(soles.columns, soles.at(np.array([time]))[0], strict=True))
        rolled = angle.at(np.array([time]))[0] * run.config.ball.radius
        centre = np.array([values[f"{foot}_forward"], values[f"{foot}_left"]]) - rolled
        footprints.append((foot, centre + box))
    return footprints


def _half_sizes(run: RunResult) -> tuple[float, float]:
    robot = load_robot_description(robot_description_path(run.config.robot.name))
    return robot.sole_half_length, robot.sole_half_width
