"""Studies that take no time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ballsim import cli
from ballsim.studies import command
from ballsim.studies.single_run import Task

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
Refuse = Callable[[str], str]


@pytest.fixture
def write_study(tmp_path: Path) -> WriteStudy:
    """Return what writes a study, the small one if no text is given."""

    def write(text: str = SMALL, name: str = "small.toml") -> Path:
        file = tmp_path / name
        file.write_text(text)
        return file

    return write


@pytest.fixture
def refuse(
    write_study: WriteStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> Refuse:
    """Return what runs a study that is not valid and returns the line that says why.

    Exit code 2, one line that begins with the file, nothing written.
    """

    def run(text: str) -> str:
        file, out = write_study(text), tmp_path / "out"
        words = ["study", str(file), "--out", str(out), "--workers", "1"]
        assert cli.main(words) == 2
        message = capsys.readouterr().err
        assert f"{file}: " in message
        assert message.count("\n") == 1
        assert not out.exists()
        return message

    return run


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[Task]:
    """Return the runs that studies have begun with, growing."""
    tasks: list[Task] = []
    execute = command.execute

    def note(some: list[Task], *more: Any) -> None:
        tasks.extend(some)
        execute(some, *more)

    monkeypatch.setattr(command, "execute", note)
    return tasks
