"""What the robot must be able to do, on every ball and from several starts."""

from __future__ import annotations

import math
from typing import Any

import pytest

from ballsim.config_io import load_config
from ballsim.metrics import summarise
from ballsim.simulation import run

RADII = (0.25, 0.5, 0.75, 1.0)
SEEDS = (0, 1, 2)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.parametrize("seed", SEEDS),
    pytest.mark.parametrize("radius", RADII),
]


def summary_of(scenario: str, radius: float, seed: int, *more: str) -> dict[str, Any]:
    """Return the summary of a run, without its files."""
    overrides = (f"ball.radius_m={radius}", f"seed={seed}", *more)
    return summarise(run(load_config(scenario, overrides).config), "pytest")


def test_robot_stands_for_a_minute(radius: float, seed: int) -> None:
    """From a perturbed start the robot is up after 60 s, the ball within 0.1 m."""
    summary = summary_of("stand", radius, seed)
    assert summary["survived"], summary["fall_reason"]
    assert summary["simulated_time"] == pytest.approx(60.0)
    assert summary["ball_lateral_drift"] < 0.1
    assert abs(summary["final_ball_angle"]) * radius < 0.1


def test_robot_steps_in_place_for_half_a_minute(radius: float, seed: int) -> None:
    """In 30 s it makes at least 60 steps, sways little and keeps the ball in place."""
    summary = summary_of("step", radius, seed)
    assert summary["survived"], summary["fall_reason"]
    assert summary["simulated_time"] == pytest.approx(30.0)
    assert summary["step_count"] >= 60
    assert summary["ball_lateral_drift"] < 0.06
    assert summary["ball_angle_overshoot"] * radius < 0.1


@pytest.mark.parametrize("target", [1.0, 4.0])
def test_robot_rolls_the_ball_to_a_target(
    radius: float, seed: int, target: float
) -> None:
    """The ball comes to rest within 0.05 rad, with a tenth of overshoot at most."""
    summary = summary_of("roll-to", radius, seed, f"target_angle={target}")
    assert summary["survived"], summary["fall_reason"]
    assert abs(summary["ball_angle_error"]) <= 0.05
    assert summary["ball_angle_overshoot"] <= 0.1 * target
    assert summary["step_count"] > 4


@pytest.mark.parametrize("eighth", range(8))
def test_robot_rolls_the_ball_to_a_place(radius: float, seed: int, eighth: int) -> None:
    """Two metres in any direction, without turning, within 5 cm."""
    direction = f"direction={eighth * math.pi / 4.0}"
    summary = summary_of("floor-target", radius, seed, direction)
    assert summary["survived"], summary["fall_reason"]
    assert summary["floor_target_error"] <= 0.05


@pytest.mark.parametrize("curve", ["circle", "figure-eight"])
def test_robot_rolls_the_ball_along_a_curve(
    radius: float, seed: int, curve: str
) -> None:
    """A circle of 1 m and a figure eight of 2 m by 1 m, to their ends."""
    summary = summary_of("path", radius, seed, f"curve={curve}")
    assert summary["survived"], summary["fall_reason"]
    assert summary["cross_track_rms"] <= 0.05
    assert summary["cross_track_max"] <= 0.15
    assert summary["floor_target_error"] <= 0.05


@pytest.mark.parametrize("heading", [math.pi / 2.0, -math.pi / 2.0])
def test_robot_turns_in_place(radius: float, seed: int, heading: float) -> None:
    """A quarter turn either way within 2 degrees, the ball within 0.2 m of it."""
    summary = summary_of("heading", radius, seed, f"heading={heading}")
    assert summary["survived"], summary["fall_reason"]
    assert abs(summary["heading_error"]) <= math.radians(2.0)
    assert summary["ball_angle_overshoot"] * radius <= 0.2
    assert summary["ball_lateral_drift"] <= 0.2
    assert summary["floor_target_error"] <= 0.05


@pytest.mark.parametrize("curve", ["circle", "figure-eight"])
def test_robot_faces_along_a_curve(radius: float, seed: int, curve: str) -> None:
    """It walks forwards all the way, and faces the end's direction."""
    more = (f"curve={curve}", "facing=tangent")
    summary = summary_of("path", radius, seed, *more)
    assert summary["survived"], summary["fall_reason"]
    assert summary["cross_track_rms"] <= 0.06
    assert abs(summary["heading_error"]) <= math.radians(2.0)
    assert summary["floor_target_error"] <= 0.05


def test_robot_keeps_a_constant_speed(radius: float, seed: int) -> None:
    """0.4 rad/s for a minute, within 1 % on the mean, the ball straight ahead."""
    summary = summary_of("constant-velocity", radius, seed)
    assert summary["survived"], summary["fall_reason"]
    assert summary["ball_speed_mean"] == pytest.approx(0.4, rel=0.01)
    # The light ball is a little less even: every other stride is the faster one.
    assert summary["ball_speed_stride_std"] < (0.04 if radius < 0.3 else 0.03)
    assert summary["ball_lateral_drift"] < 0.1


def test_robot_rolls_fast(radius: float, seed: int) -> None:
    """A minute at more than is asked of it, the reference's own limit lifted."""
    speed = {0.25: 0.9, 0.5: 1.0, 0.75: 0.8, 1.0: 0.65}[radius]
    lifted = [
        f"controller.reference.max_cruise_{unit}=2.0" for unit in ("rad_s", "m_s")
    ]
    summary = summary_of("constant-velocity", radius, seed, f"speed={speed}", *lifted)
    assert summary["survived"], summary["fall_reason"]
    assert summary["ball_speed_mean"] == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize("targets", [(0.5, 1.0, 0.2), (0.5, -0.3, 0.5)])
def test_robot_follows_a_target_that_changes(
    radius: float, seed: int, targets: tuple[float, ...]
) -> None:
    """While it steps on, the ball is within 0.03 rad of each target in the end."""
    names = ("first", "second", "third")
    words = [f"{name}={target}" for name, target in zip(names, targets, strict=True)]
    summary = summary_of("change-target", radius, seed, *words)
    assert summary["survived"], summary["fall_reason"]
    assert len(summary["hold_errors"]) == 3
    assert summary["hold_error_max"] <= 0.03


@pytest.mark.parametrize("eighth", range(8))
def test_standing_robot_takes_a_push(radius: float, seed: int, eighth: int) -> None:
    """60 N for 0.1 s from any side on the trunk, 30 N on the small ball."""
    force = 30.0 if radius < 0.3 else 60.0
    more = (f"force={force}", f"direction={eighth * math.pi / 4.0}")
    summary = summary_of("push", radius, seed, *more)
    assert summary["survived"], summary["fall_reason"]


@pytest.mark.parametrize("scenario", ["push", "push-stepping", "push-rolling"])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_robot_takes_a_push_from_the_side(
    radius: float, seed: int, scenario: str, side: float
) -> None:
    """120 N straight from a side in any phase of the gait, 60 N on the small ball."""
    force = 60.0 if radius < 0.3 else 120.0
    more = (f"force={force}", f"direction={side * math.pi / 2.0}")
    summary = summary_of(scenario, radius, seed, *more)
    assert summary["survived"], summary["fall_reason"]


def test_speed_may_jump_in_stages(radius: float, seed: int) -> None:
    """The paper's way to 0.4 rad/s, Section VI-D: no ramp between the set-points."""
    summary = summary_of("staged-velocity", radius, seed)
    assert summary["survived"], summary["fall_reason"]
    assert summary["ball_speed_mean"] == pytest.approx(0.4, rel=0.01)
