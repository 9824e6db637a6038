"""Laws of what landings teach about the height of the ball."""

from __future__ import annotations

import pytest

from ballsim_controllers.footsteps.gait import LEFT, RIGHT
from ballsim_controllers.footsteps.touchdown import TouchdownMemory

SPEED, TOLERANCE, LIMIT = 0.1, 0.02, 0.01


def make_memory() -> TouchdownMemory:
    """Return one that has seen nothing."""
    return TouchdownMemory(SPEED, TOLERANCE, LIMIT)


@pytest.mark.parametrize("height", [0.0, 0.001, 0.004, 0.009])
def test_landings_come_in_time(height: float) -> None:
    """A ball that lies lower than it seems is met in time from the second step on."""
    memory = make_memory()
    memory.learn(LEFT, height / SPEED)
    for _ in range(5):
        lateness = (height - memory.depth(LEFT)) / SPEED
        assert abs(lateness) <= TOLERANCE
        memory.learn(LEFT, lateness)
    assert (memory.depth(LEFT) > 0.0) is (height > SPEED * TOLERANCE)


def test_what_no_longer_holds_is_unlearned() -> None:
    """Landings that come too early lead back to the ball as it seems."""
    memory = make_memory()
    memory.learn(RIGHT, 0.06)
    memory.learn(RIGHT, -0.03)
    assert memory.depth(RIGHT) == pytest.approx(0.003)
    memory.learn(RIGHT, -0.08)
    assert memory.depth(RIGHT) == 0.0


def test_depth_is_limited() -> None:
    """However late a foot lands, it aims no deeper than the limit."""
    memory = make_memory()
    for _ in range(5):
        memory.learn(LEFT, 0.15)
    assert memory.depth(LEFT) == LIMIT


def test_each_foot_has_its_own() -> None:
    """What one foot learns does not move the other one."""
    memory = make_memory()
    memory.learn(LEFT, 0.05)
    assert memory.depth(LEFT) > 0.0
    assert memory.depth(RIGHT) == 0.0
