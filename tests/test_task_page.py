"""The page of tasks: what is run for it, and what its panels show."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import ballsim
from ballsim.config_io import OPTION_KEYS, load_config
from ballsim.inspection.tasks import TASKS, Task
from ballsim.task_page import draw_tasks

RADII = [0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.title)
def test_every_ball_gets_the_task(task: Task) -> None:
    """All runs are valid, on each of the four balls as many."""
    runs = task.list_runs()
    radii = [radius for radius, _ in runs]
    assert sorted(set(radii)) == RADII
    assert {radii.count(radius) for radius in RADII} == {len(runs) // 4}
    for radius, changes in runs:
        given = [f"{OPTION_KEYS.get(key, key)}={v!r}" for key, v in changes.items()]
        given = [text.replace("'", '"') for text in given]
        config = load_config(task.scenario, [*given, f"ball.radius_m={radius}"]).config
        assert config.sensors.preset == "ideal"


def test_balls_take_turns_with_eight_directions() -> None:
    """Each direction once, two for each ball, opposite ones."""
    (task,) = [task for task in TASKS if task.by_ball]
    runs = task.list_runs()
    assert sorted(changes["direction"] for _, changes in runs) == [
        variant["direction"] for variant in task.variants
    ]
    for radius in RADII:
        first, second = (c["direction"] for own, c in runs if own == radius)
        assert second - first == pytest.approx(np.pi)


def test_panels_show_the_runs() -> None:
    """The way of the ball and the path that is asked, the heading from its start."""
    tasks = [
        dataclasses.replace(task, by_ball=False)
        for task in TASKS
        if task.title.startswith(("circle", "turn"))
    ]
    results = [[ballsim.run(task.scenario, duration=0.3)] for task in tasks]
    turn, circle = draw_tasks(tasks, results).axes
    asked, way = (line.get_xydata() for line in circle.lines)
    assert np.ptp(asked[:, 0]) == pytest.approx(2.0, rel=1e-3)  # of 1 m radius
    angle = results[1][0]["truth/ball/angle"]
    places = 0.5 * np.column_stack([angle["forward"], angle["left"]])
    np.testing.assert_array_equal(way, places)
    assert turn.lines[0].get_ydata()[0] == 0.0
    assert turn.get_ylabel() == "heading [degree]"
    assert circle.get_aspect() == 1.0
