"""The tasks of the envelope, and how a panel shows each of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ballsim.run_result import RunResult
from ballsim.style import REFERENCE
from ballsim_controllers.messages import Array

__all__ = ["RADII", "TASKS", "Task"]

#: Radii of the balls, [m].
RADII = (0.25, 0.5, 0.75, 1.0)

Draw = Callable[[Axes, RunResult, Mapping[str, Any]], None]


@dataclass(frozen=True, slots=True)
class Task:
    """A panel of the page.

    Attributes:
        title: What is asked.
        scenario: Scenario that asks it.
        draw: Draws a run into the panel.
        variants: What is asked for; the balls get every one of them.
        by_ball: True where the balls take turns with the variants.
        base: What all runs have in common.
        labels: Labels of the axes.
        is_map: True for a view from above.
    """

    title: str
    scenario: str
    draw: Draw
    variants: tuple[Mapping[str, Any], ...] = ({},)
    by_ball: bool = False
    base: Mapping[str, Any] = field(default_factory=dict)
    labels: tuple[str, str] = ("time [s]", "ball angle [rad]")
    is_map: bool = False

    def list_runs(self) -> list[tuple[float, dict[str, Any]]]:
        """Return the radius of the ball and the values to change of each run."""
        pairs = [
            (radius, variant)
            for i, radius in enumerate(RADII)
            for j, variant in enumerate(self.variants)
            if not self.by_ball or j % len(RADII) == i
        ]
        return [(radius, {**self.base, **variant}) for radius, variant in pairs]


def _draw_angle(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    angle, asked = result["truth/ball/angle"], result["control/ball/angle"]
    ax.step(asked.time, asked["target"], where="post", **REFERENCE)
    ax.plot(angle.time, angle["forward"], **style)


def _draw_speed(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    rate = result["truth/ball/rate"]
    ax.plot(rate.time, rate["forward"], **style)


def _draw_distance(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    time, places = _find_places(result)
    ax.plot(time, 1e3 * np.hypot(*(places - places[0]).T), **style)


def _draw_push(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    """Draw how far the CoM is beside the ball's centre, from the push on."""
    com, push = result["truth/com/position"], result.config.pushes[0]
    _, places = _find_places(result)
    beside = 1e3 * (com["left"] - places[: len(com.time), 1])
    ax.plot(com.time - push.time, beside, **style)
    ax.set_xlim(-1.0, 6.0)


def _draw_map(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    """Draw the way of the ball from above, forwards to the right."""
    _, places = _find_places(result)
    for point in result.config.command.timeline:
        trace = point.path.trace()
        if trace is not None:
            ax.plot(*trace.points.T, **REFERENCE)
    ax.plot(*places.T, **style)


def _draw_heading(ax: Axes, result: RunResult, style: Mapping[str, Any]) -> None:
    attitude = result["truth/trunk/attitude"]
    yaw = np.unwrap(attitude["yaw"])
    ax.plot(attitude.time, np.degrees(yaw - yaw[0]), **style)


def _find_places(result: RunResult) -> tuple[Array, Array]:
    """Return times, (n,), [s], and the ball's places on the floor, (n, 2), [m]."""
    angle = result["truth/ball/angle"]
    turned = np.column_stack([angle["forward"], angle["left"]])
    return angle.time, result.config.ball.radius * turned


_EIGHT = tuple({"direction": 0.25 * np.pi * i} for i in range(8))
_PUSH = {"direction": 0.5 * np.pi, "force": 60.0}
_FLOOR = ("forwards [m]", "to the left [m]")
_BESIDE = ("time from the push on [s]", "CoM beside the ball [mm]")

#: The tasks, in the order of the page.
TASKS = (
    Task(
        "roll to 4 and -4 rad",
        "roll-to",
        _draw_angle,
        ({"target_angle": 4.0}, {"target_angle": -4.0}),
    ),
    Task(
        "change the target while walking",
        "change-target",
        _draw_angle,
        ({}, {"second": -0.3, "third": 0.5}),
    ),
    Task(
        "roll at 0.4 rad/s",
        "constant-velocity",
        _draw_speed,
        base={"duration": 30.0},
        labels=("time [s]", "ball speed [rad/s]"),
    ),
    Task(
        "stand",
        "stand",
        _draw_distance,
        base={"duration": 20.0},
        labels=("time [s]", "ball from its start [mm]"),
    ),
    Task(
        "push of 60 N from the right, standing",
        "push",
        _draw_push,
        base=_PUSH,
        labels=_BESIDE,
    ),
    Task(
        "the same, rolling at 0.3 rad/s",
        "push-rolling",
        _draw_push,
        base=_PUSH,
        labels=_BESIDE,
    ),
    Task(
        "roll 2 m, two directions each",
        "floor-target",
        _draw_map,
        _EIGHT,
        by_ball=True,
        labels=_FLOOR,
        is_map=True,
    ),
    Task(
        "turn by 90 degrees to either side",
        "heading",
        _draw_heading,
        ({"heading": 0.5 * np.pi}, {"heading": -0.5 * np.pi}),
        labels=("time [s]", "heading [degree]"),
    ),
    Task("circle of 1 m radius", "path", _draw_map, labels=_FLOOR, is_map=True),
    Task(
        "figure eight of 2 m by 1 m",
        "path",
        _draw_map,
        ({"curve": "figure-eight"},),
        labels=_FLOOR,
        is_map=True,
    ),
)
