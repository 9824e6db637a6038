"""Processes: which numbers are tried, the arithmetic, the same results."""

from __future__ import annotations

import pytest

from ballsim.bench.scaling import choose_counts, measure_scaling, tabulate_scaling
from ballsim.config_io import load_config


@pytest.mark.parametrize(
    ("most", "counts"), [(1, (1,)), (2, (1, 2)), (3, (1, 2, 3)), (16, (1, 2, 16))]
)
def test_one_two_and_all_processes_are_tried(most: int, counts: tuple[int]) -> None:
    """Never more than asked for, none twice."""
    assert choose_counts(most) == counts


def test_efficiency_is_against_one_process() -> None:
    """Twice the work in the same time is all that two processes can do."""
    rows = tabulate_scaling((1, 2, 4), [2.0, 2.0, 4.0], [10.0, 20.0, 40.0])
    assert [row["throughput"] for row in rows] == [5.0, 10.0, 10.0]
    assert [row["efficiency"] for row in rows] == [1.0, 1.0, 0.5]


def test_runs_do_not_depend_on_the_number_of_processes() -> None:
    """Else this raises; a row for each number."""
    rows = measure_scaling(load_config("stand", ["duration_s=0.1"]).config, (1, 2), 1)
    assert [row["workers"] for row in rows] == [1, 2]
    assert rows[0]["efficiency"] == 1.0
