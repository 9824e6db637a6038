"""Bare physics repeat the run bit for bit, and the arithmetic of the factors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ballsim.bench.headline import compare_times, measure_ball, replay_bare
from ballsim.config_io import load_config
from ballsim.errors import ReplayMismatchError
from ballsim.simulation import KeptRun, run


@pytest.fixture(scope="module")
def result() -> KeptRun:
    """A run that already steps."""
    keys = ("duration_s=0.6", "command.timeline.0.time_s=0.1")
    return run(load_config("roll-to", keys).config)


def test_bare_physics_do_the_same_work(result: KeptRun) -> None:
    """The replay comes to the run's last state, else it would raise."""
    assert replay_bare(result) > 0.0


@pytest.mark.parametrize("name", ["ctrl", "qpos"])
def test_other_work_is_noticed(name: str, result: KeptRun) -> None:
    """The last bit of one input or of the last state makes another run."""
    rows = getattr(result.series, name)
    row = 10 if name == "ctrl" else -1
    kept = rows[row].copy()
    rows[row] = np.nextafter(kept, np.inf)
    try:
        with pytest.raises(ReplayMismatchError, match="bare mj_step"):
            replay_bare(result)
    finally:
        rows[row] = kept


def test_wrenches_are_replayed(result: KeptRun) -> None:
    """A push is part of the work: with it the replay ends elsewhere."""
    series, model = result.series, result.model
    series.wrenches = np.zeros((series.n_ticks, model.nbody, 6))
    try:
        replay_bare(result)
        series.wrenches[5, result.ids.body_trunk, 0] = 1.0
        with pytest.raises(ReplayMismatchError):
            replay_bare(result)
    finally:
        series.wrenches = None


def test_factors_and_ratios() -> None:
    """Factors are simulated over wall time; ratios are taken within a repeat."""
    numbers = compare_times(10.0, [2.0, 4.0, 5.0], [4.0, 8.0, 8.0], [1.0, 3.0, 2.0])
    factors, of_bare = numbers["realtime_factor"], numbers["of_bare"]
    assert factors["closed"] == {"best": 5.0, "median": 2.5}
    assert factors["bare"] == {"best": 10.0, "median": 5.0}
    assert of_bare["closed"] == {"median": 0.5, "of_best": 0.5}
    assert of_bare["recorded"] == {"median": 0.25, "of_best": 0.25}


def test_disturbed_bare_physics_do_not_flatter_the_loop() -> None:
    """One slow repeat of bare physics changes neither of the two ratios."""
    quiet = compare_times(1.0, [4.0] * 3, [5.0] * 3, [2.0, 2.0, 2.0])["of_bare"]
    busy = compare_times(1.0, [4.0] * 3, [5.0] * 3, [2.0, 9.0, 2.0])["of_bare"]
    assert (
        busy
        == quiet
        == {
            "closed": {"median": 0.5, "of_best": 0.5},
            "recorded": {"median": 0.4, "of_best": 0.4},
        }
    )


def test_a_ball_is_measured(result: KeptRun) -> None:
    """As many times as repeats, of runs with and without a recording."""
    config = dataclasses.replace(result.config, duration=0.2)
    numbers = measure_ball(config, repeats=2)
    assert numbers["simulated_time"] == pytest.approx(0.2)
    assert {name: len(times) for name, times in numbers["loop_s"].items()} == {
        "closed": 2,
        "recorded": 2,
        "bare": 2,
    }
    assert numbers["of_bare"]["closed"]["median"] < 1.0
