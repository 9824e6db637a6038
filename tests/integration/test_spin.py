"""What the filter of the heading relies on: the floor does not let the ball spin."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.preparation import prepare
from ballsim.simulation import run
from ballsim.truth import compute_state_truth

_TURNS = ("heading", "duration_s=12")
_PUSHED = ("push", "duration_s=10", "force=60", "direction=0.7854")
_ROLLS = ("constant-velocity", "duration_s=20")


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize("way", [_TURNS, _PUSHED, _ROLLS], ids=lambda way: way[0])
def test_floor_keeps_the_ball_from_spinning(radius: float, way: tuple[str]) -> None:
    """A robot that turns, steps after a push or rolls spins it by 2 mrad at most."""
    scenario, *given = way
    config = load_config(scenario, [*given, f"ball.radius_m={radius}"]).config
    series, prepared = run(config).series, prepare(config)
    truth = compute_state_truth(
        prepared.plant.model, prepared.ids, prepared.world, series.qpos, series.qvel
    )
    rates = truth.angular_velocity_ball_in_world[:, 2]
    spin = np.cumsum(rates) * config.simulation.control_period
    assert np.abs(spin).max() < 2e-3
    assert np.abs(rates).max() > 5e-3  # it does turn to and fro
