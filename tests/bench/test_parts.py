"""Parts of a tick: complete, once each, and without an effect on the run."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.bench import parts
from ballsim.bench.parts import PARTS, REST, check_parts, measure_parts
from ballsim.bench.timers import PartTimers, Target, patched
from ballsim.config import Config
from ballsim.config_io import load_config
from ballsim.errors import BallsimError
from ballsim.preparation import prepare
from ballsim.simulation import run_prepared


@pytest.fixture(scope="module")
def config() -> Config:
    """A run that steps almost from its start."""
    keys = ("duration_s=0.8", "command.timeline.0.time_s=0.1")
    start = "controller.gait.start_patience_s=0.0"
    return load_config("roll-to", (*keys, start)).config


def test_parts_make_up_the_tick(config: Config) -> None:
    """All parts but the recording add up to the tick; each name stands once."""
    report = measure_parts(config, repeats=1)
    rows = {row["part"]: row for row in report["rows"]}
    assert len(rows) == len(report["rows"])
    assert list(rows) == [*dict.fromkeys(t.part for t in PARTS), REST, "recording"]
    inside = [row for name, row in rows.items() if name != "recording"]
    assert sum(row["us_per_tick"] for row in inside) == pytest.approx(report["tick_us"])
    assert sum(row["share"] for row in inside) == pytest.approx(1.0)
    for name in ("physics", "sensors", "controller, rest", "fall detection"):
        assert rows[name]["calls_per_tick"] == 1.0
    assert rows["recording"]["us_per_tick"] > 0.0
    assert report["encoding_us"] > 0.0
    for row in inside[:-1]:
        assert row["us_per_call_median"] <= row["us_per_call_p99"]


def test_timers_change_no_bit(config: Config) -> None:
    """The trajectory under timers is that without them."""
    plain = run_prepared(prepare(config)).series.qpos
    with patched(PARTS, prepare(config), PartTimers().wrap):
        timed = run_prepared(prepare(config)).series.qpos
    assert np.array_equal(plain, timed)


def test_part_that_is_gone_is_noticed(
    config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A path that no longer exists is named before anything is measured."""
    monkeypatch.setattr(parts, "PARTS", (Target("gone", "plant.leap"),))
    with pytest.raises(BallsimError, match=r"plant\.leap.*gone"):
        check_parts(prepare(config))
