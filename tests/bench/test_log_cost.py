"""What the log costs: the arithmetic, and that it is the log that is measured."""

from __future__ import annotations

import pytest

from ballsim.bench.log_cost import LoggedLoop, compare_pairs, measure_log
from ballsim.bench.sections import _make_log
from ballsim.config_io import load_config


def _pair(without: float, logged: float) -> tuple[LoggedLoop, LoggedLoop]:
    return (
        LoggedLoop(without, 0.9 * without, 0.0, 0.0, 30.0),
        LoggedLoop(logged, 0.9 * logged, 0.5 * logged, 4.0, 30.0),
    )


def test_cost_is_what_comes_on_top() -> None:
    """One disturbed loop moves neither figure, whichever of the two it is."""
    quiet = [_pair(2.0, 2.1)] * 3
    for disturbed in (_pair(3.0, 2.1), _pair(2.0, 4.0)):
        numbers = compare_pairs([disturbed, *quiet])
        for kind in ("wall", "cpu"):
            expected = {"median": 0.05, "of_least": 0.05}
            assert numbers["cost"][kind] == pytest.approx(expected)
    assert numbers["process_cpu_s"] == pytest.approx(1.05)
    assert (numbers["recording_mb"], numbers["mb_per_minute"]) == (4.0, 8.0)
    load = {"load_before": 0.4, "load_after": 1.6}
    section = _make_log({"ball_radius": 0.5, **load, **numbers})
    assert "load 0.4 before, 1.6 after" in section.note
    assert section.rows[0] == ("loop, s of wall time", "2.00", "2.10", "5.0 (5.0)")
    assert section.rows[2][1:] == ("", "1.05", "58")
    assert all(len(row) == len(section.head) for row in section.rows)


def test_a_run_is_measured() -> None:
    """As many pairs as repeats; the recording has a size, and its process worked."""
    config = load_config("stand", ["duration_s=30"]).config
    numbers = measure_log(config, duration=0.5, repeats=2)
    assert numbers["simulated_time"] == pytest.approx(0.5)
    for times in (numbers["loop_s"], numbers["loop_cpu_s"]):
        assert {name: len(walls) for name, walls in times.items()} == {
            "without": 2,
            "with": 2,
        }
        assert min(*times["without"], *times["with"]) > 0.0
    assert numbers["process_cpu_s"] > 0.0
    assert numbers["recording_mb"] > 0.1
