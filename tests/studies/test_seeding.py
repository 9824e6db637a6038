"""Which runs are done: all seeds, or as many as the rule asks for."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from ballsim.studies.design import Plan, load_plan
from ballsim.studies.seeding import Seeder
from ballsim.studies.single_run import FINISHED, Outcome, Task

WriteStudy = Callable[..., Path]

STOPPING = """
scenario = "stand"
seeds = 60
[stopping]
half_width = 0.15
min_seeds = 10
batch = 5
[[factors]]
key = "ball.radius_m"
values = [0.4, 0.5, 0.6]
"""


@pytest.fixture
def plan(write_study: WriteStudy) -> Plan:
    return load_plan(write_study(STOPPING))


def _outcome(task: Task) -> Outcome:
    """Cell 0 always survives, cell 1 every second seed, cell 2 gives no result."""
    cell, seed = task.cell, task.config.seed
    if cell == 2:
        return Outcome(cell, seed, "crashed", {})
    return Outcome(cell, seed, FINISHED, {"survived": cell == 0 or seed % 2 == 0})


def _drain(
    seeder: Seeder, generator: random.Random, stop: int = 10**6
) -> list[Outcome]:
    """Do the runs in a random order."""
    waiting, done = seeder.first_tasks(), []
    while waiting and len(done) < stop:
        task = waiting.pop(generator.randrange(len(waiting)))
        done.append(_outcome(task))
        waiting += seeder.next_tasks(done[-1])
    return done


def _keys(outcomes: list[Outcome]) -> list[tuple[int, int]]:
    return sorted((outcome.cell, outcome.seed) for outcome in outcomes)


def test_rule_stops_a_cell_when_its_interval_is_narrow(plan: Plan) -> None:
    """A sure cell stops at the minimum, an even one later, a lost one has all."""
    done = _keys(_drain(Seeder(plan), random.Random(0)))
    counts = [sum(cell == i for cell, _ in done) for i in range(3)]
    # 40 of 80 has a half-width of 0.107, 20 of 40 one of 0.148, 17 of 35 of 0.157.
    assert counts == [10, 40, 60]
    assert len(set(done)) == len(done)


def test_order_and_restarts_change_nothing(plan: Plan) -> None:
    """Any order, and any number of restarts, give the same runs."""
    expected = _keys(_drain(Seeder(plan), random.Random(0)))
    for seed in range(1, 6):
        generator, done = random.Random(seed), []
        for stop in (7, 20, 10**6):
            done += _drain(Seeder(plan, done), generator, stop)
        assert _keys(done) == expected


def test_without_rule_all_seeds_are_done(
    write_study: WriteStudy, tmp_path: Path
) -> None:
    """Every cell gets every seed; what is done is not done again."""
    text = STOPPING.replace("seeds = 60", "seeds = [3, 1]")
    head, _, tail = text.partition("[stopping]")
    plan = load_plan(write_study(head + tail[tail.index("[[") :]))
    tasks = Seeder(plan).first_tasks()
    found = [(task.cell, task.config.seed) for task in tasks]
    assert found == [(c, s) for s in (3, 1) for c in (0, 1, 2)]
    rest = Seeder(plan, map(_outcome, tasks[:4])).first_tasks()
    assert [(task.cell, task.config.seed) for task in rest] == found[4:]
