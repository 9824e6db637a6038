"""Laws of the polar picture: the largest force that all runs bore, without gaps."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from ballsim.studies.push_figures import borne_forces, draw_pushes

DIRECTIONS = (0.0, 1.5708, 3.1416, 4.7124)


def verdict(direction: float, force: float, survived: int, radius: float = 0.5) -> Any:
    """Return what is looked at of the verdict on a cell of four runs."""
    push = SimpleNamespace(direction=direction, force=force)
    config = SimpleNamespace(
        scenario="push", pushes=(push,), ball=SimpleNamespace(radius=radius)
    )
    return SimpleNamespace(
        cell=SimpleNamespace(config=config),
        tally=SimpleNamespace(n_survived=survived, n_runs=4),
    )


def test_largest_force_without_a_gap() -> None:
    """A force counts only where all smaller ones were borne by all runs, too."""
    cells = [verdict(d, force, 4) for d in DIRECTIONS for force in (120.0, 60.0)]
    cells += [verdict(0.0, 90.0, 3), verdict(1.5708, 150.0, 0)]
    cells += [verdict(3.1416, 30.0, 0)]
    found = borne_forces(cells)
    assert list(found) == ["push"]
    forces = found["push"][0.5]
    assert list(forces.values()) == [60.0, 120.0, 0.0, 120.0]


def test_direction_counts_in_one_turn() -> None:
    """A push to the right is the same by either angle."""
    other_way = [d if d < 3.0 else d - 2.0 * math.pi for d in DIRECTIONS]
    one, other = (
        borne_forces([verdict(d, 60.0, 4) for d in directions])["push"][0.5]
        for directions in (DIRECTIONS, other_way)
    )
    assert list(other) == pytest.approx(list(one))


def test_few_directions_are_no_picture() -> None:
    """One or two directions, or no push at all: nothing to draw."""
    assert not borne_forces([verdict(0.0, 60.0, 4), verdict(1.0, 60.0, 4)])
    still = verdict(0.0, 60.0, 4)
    still.cell.config.pushes = ()
    assert not borne_forces([still])


def test_each_ball_is_a_closed_line() -> None:
    """The panel of a scenario has a line for each ball, closed over the full turn."""
    cells = [verdict(d, 60.0, 4, radius) for d in DIRECTIONS for radius in (0.5, 1.0)]
    (axes,) = draw_pushes(borne_forces(cells)).axes
    assert [line.get_label() for line in axes.lines] == ["0.5 m", "1 m"]
    for line in axes.lines:
        angles = line.get_xdata()
        assert angles[-1] - angles[0] == pytest.approx(6.2832, abs=1e-4)
