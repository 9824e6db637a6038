"""Studies that take no time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

SMALL = """
description = "two frictions, two seeds"
scenario = "stand"
duration_s = 0.1
seeds = 2
metrics = ["ball_angle_error", "estimate_rms.com_to_ball_m"]

[[factors]]
key = "scene.sole_friction"
values = [0.5, 1.0]
harder = "low"
"""

WriteStudy = Callable[..., Path]


@pytest.fixture
def write_study(tmp_path: Path) -> WriteStudy:
    """Return what writes a study, the small one if no text is given."""

    def write(text: str = SMALL, name: str = "small.toml") -> Path:
        file = tmp_path / name
        file.write_text(text)
        return file

    return write
