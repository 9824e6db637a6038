"""NEES and NIS of whole runs: the estimate errs as the sensors' figures say."""

from __future__ import annotations

import pytest

from ballsim.consistency import check_runs, main


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.25, 0.5, 1.0])
def test_standing_estimate_is_consistent(radius: float) -> None:
    """With `mid`, once the start is over, all squares are in their bands."""
    given = ["sensors.preset=mid", f"ball.radius_m={radius}", "duration_s=30"]
    outside = [
        row for row in check_runs("stand", given, range(5), 12.0) if not row.is_inside
    ]
    assert not outside


@pytest.mark.slow
def test_steps_are_as_exact_as_required() -> None:
    """With `mid`: CoP and CoM within 5 mm, velocities within 0.03 m/s rms."""
    given = ["sensors.preset=mid", "duration_s=20"]
    rows = {row.name: row for row in check_runs("step", given, range(4), 5.0)}
    assert rows["cop_to_ball_m"].rms < 0.005
    assert rows["com_to_ball_m"].rms < 0.005
    assert rows["com_velocity_m_s"].rms < 0.03
    assert rows["ball_velocity_m_s"].rms < 0.03
    # What scale and axes of the sensors do to a motion is not predicted: it is inside
    # for the tilt, and adds less than half to the CoM's place.
    assert rows["trunk_tilt_rad"].is_inside
    assert rows["com_to_ball_m"].rms < 1.5 * rows["com_to_ball_m"].sensors
    assert rows["com_velocity_m_s"].rms < 0.010


def test_bad_input_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2: no noise to compare with, no time left to compare."""
    assert main(["--sensors", "ideal", "--duration", "0.5", "--start", "0.1"]) == 2
    assert "noise in all sensors" in capsys.readouterr().err
    assert main(["--duration", "5", "--start", "5"]) == 2
    assert "--start" in capsys.readouterr().err
