"""What is left of the heading's drift in full physics, with errors of every sensor."""

from __future__ import annotations

from typing import Any

import pytest

from ballsim.config_io import load_config
from ballsim.studies.single_run import summarise_config


def walk(radius: float, seed: int) -> dict[str, Any]:
    """Return the summary of a minute at 0.4 rad/s with the sensors of `mid`."""
    given = [f"ball.radius_m={radius}", f"seed={seed}", "sensors.preset=mid"]
    summary = summarise_config(load_config("constant-velocity", given).config)
    assert summary["survived"]
    return dict(summary)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3])
@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
def test_gyro_of_a_robot_that_walks_does_not_turn_it_away(
    radius: float, seed: int
) -> None:
    """A minute of walking on, the heading is off by the ball's axes, not more."""
    # Without what the ball's rolling tells it is 0.022 with seed 0.
    assert walk(radius, seed)["estimate_rms"]["trunk_yaw_rad"] < 0.01


@pytest.mark.slow
def test_hips_that_are_off_do_not_lead_astray() -> None:
    """Zero positions of both hips by 2 mrad: the largest drift of the first draws."""
    assert walk(1.0, 12)["ball_lateral_drift"] < 0.15
