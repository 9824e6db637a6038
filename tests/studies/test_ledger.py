"""The ledger: what is written is there, and nobody else's is touched."""

from __future__ import annotations

from pathlib import Path

import pytest

from ballsim.errors import ConfigError
from ballsim.studies.ledger import LEDGER_FILE, open_ledger
from ballsim.studies.single_run import FINISHED, Outcome


def _outcome(cell: int, seed: int) -> Outcome:
    return Outcome(
        cell=cell,
        seed=seed,
        status=FINISHED,
        summary={"survived": True, "x": 0.1 + 0.2, "rms": {"a_m": None}},
        wall_time=1.5,
        realtime_factor=3.0,
        attempts=2,
        provenance={"mujoco": f"4.{cell}"},
    )


def _open(folder: Path, digest: str, name: str) -> None:
    with open_ledger(folder, digest, name):
        pass


def test_runs_come_back_sorted_and_exact(tmp_path: Path) -> None:
    """What is read equals what was written, to the last bit of its numbers."""
    with open_ledger(tmp_path, "d", "name") as ledger:
        for cell, seed in ((1, 0), (0, 5), (0, 2)):
            ledger.write(_outcome(cell, seed))
    with open_ledger(tmp_path, "d", "name") as ledger:
        found = ledger.read()
        assert ledger.read_versions() == {"mujoco": "4.0 or 4.1"}
    assert [(o.cell, o.seed) for o in found] == [(0, 2), (0, 5), (1, 0)]
    assert found[0].summary == _outcome(0, 2).summary
    assert (found[0].attempts, found[0].wall_time) == (2, 1.5)


def test_ledger_of_another_study_is_refused(tmp_path: Path) -> None:
    """The other study's name stands in the line; its ledger is left alone."""
    with open_ledger(tmp_path, "d", "first") as ledger:
        ledger.write(_outcome(0, 0))
    before = (tmp_path / LEDGER_FILE).read_bytes()
    with pytest.raises(ConfigError, match="another study, 'first'"):
        _open(tmp_path, "e", "second")
    with pytest.raises(ConfigError, match="was another study"):
        _open(tmp_path, "e", "first")
    assert (tmp_path / LEDGER_FILE).read_bytes() == before


def test_two_cannot_write_into_one_ledger(tmp_path: Path) -> None:
    """The second one is refused as long as the first one is there."""
    with (
        open_ledger(tmp_path, "d", "name"),
        pytest.raises(ConfigError, match="no other study is writing"),
    ):
        _open(tmp_path, "d", "name")
    _open(tmp_path, "d", "name")


def test_what_is_no_ledger_is_refused(tmp_path: Path) -> None:
    """A file of that name with other content: one line."""
    (tmp_path / LEDGER_FILE).write_text("some text, long enough to be a data base" * 99)
    with pytest.raises(ConfigError, match="is a ledger"):
        _open(tmp_path, "d", "name")
