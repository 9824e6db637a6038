"""What landings teach a robot whose feet are not where its encoders say."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.simulation import run
from ballsim_controllers.footsteps.gait import GaitPhase, time_gait
from ballsim_controllers.settings import WheeledLipSettings, load_settings

_GAIT = load_settings(WheeledLipSettings, "wheeled-lip", {})
_SWINGS = (GaitPhase.LEFT_SUPPORT, GaitPhase.RIGHT_SUPPORT)


def count_late_landings(seed: int, *given: str) -> int:
    """Return how many swings last too long, from the fourth second on."""
    words = ["ball.radius_m=1.0", "duration_s=12", "sensors.preset=low", f"seed={seed}"]
    config = load_config("step", [*words, *given]).config
    series = run(config).series
    period = config.simulation.control_period
    assert series.telemetry is not None
    phases = series.telemetry.rows["phase"].ravel()[round(3.0 / period) :]
    swings = np.split(phases, np.flatnonzero(np.diff(phases)) + 1)[1:-1]
    lengths = [len(swing) * period for swing in swings if swing[0] in _SWINGS]
    assert len(lengths) > 20
    gait = _GAIT.gait
    planned = time_gait(gait, 1.0, _GAIT.rates.preview_period_s).single_support
    return sum(length > planned + gait.touchdown_tolerance_s for length in lengths)


# Draws that hold a foot above its path.
@pytest.mark.parametrize("seed", [7, 30, 44, 55])
def test_late_landings_teach(seed: int) -> None:
    """With `low`, feet that land late land in time once that has taught them."""
    plain = count_late_landings(seed, "controller.gait.touchdown_depth_m=0.0")
    assert plain >= 3
    assert count_late_landings(seed) <= plain // 3


def test_perfect_sensors_have_nothing_to_teach() -> None:
    """Without errors of sensors the setting changes no bit."""
    hashes = set()
    for depth in ("0.0", "0.01"):
        words = ["duration_s=4", "seed=3", "controller.gait.touchdown_tolerance_s=0.0"]
        given = [*words, f"controller.gait.touchdown_depth_m={depth}"]
        series = run(load_config("step", given).config).series
        hashes.add(series.qpos.tobytes())
    assert len(hashes) == 1
