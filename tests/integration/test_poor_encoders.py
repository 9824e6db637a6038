"""The robot whose feet and CoM are not where its encoders say."""

from __future__ import annotations

import pytest

from ballsim.config_io import load_config
from ballsim.metrics import summarise
from ballsim.simulation import run

pytestmark = pytest.mark.slow


# Draws that bring the feet nearer to each other, or the CoM off the foot.
@pytest.mark.parametrize("seed", [20, 40, 44, 52, 72, 91, 94])
def test_robot_walks_on_misjudged_feet(seed: int) -> None:
    """With `low` on the largest ball, where it has the most to lose, it stays up."""
    given = ["sensors.preset=low", "ball.radius_m=1.0", "duration_s=25", f"seed={seed}"]
    summary = summarise(run(load_config("constant-velocity", given).config), "pytest")
    assert summary["survived"], summary["fall_reason"]
    assert summary["step_count"] > 60


def test_ball_rests_where_it_should() -> None:
    """A CoM that seems to be off keeps the ball off until the reference is shifted."""
    given = ["sensors.preset=mid", "ball.radius_m=0.25", "duration_s=40", "seed=6"]
    config = load_config("roll-to", ["target_angle=1.0", *given]).config
    summary = summarise(run(config), "pytest")
    assert summary["survived"], summary["fall_reason"]
    assert abs(summary["ball_angle_error"]) < 0.05  # 0.074 where the shift is let go
