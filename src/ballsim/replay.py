"""Repeats a run from its folder and compares the trajectories bit for bit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ballsim.config_io import load_config
from ballsim.errors import ConfigError, ReplayMismatchError
from ballsim.metrics import TrajectoryDigest, collect_versions
from ballsim.preparation import prepare
from ballsim.run_files import CONFIG_FILE, SUMMARY_FILE
from ballsim.simulation import simulate

__all__ = ["replay"]


def replay(folder: Path) -> str:
    """Repeat a run and compare its trajectory with the recorded one.

    Args:
        folder: Folder of the run.

    Returns:
        The digest of both trajectories.

    Raises:
        ConfigError: The folder does not hold a finished run.
        ReplayMismatchError: The trajectories differ.
    """
    summary = _read_summary(folder)
    loaded = load_config(folder / CONFIG_FILE)
    try:
        prepared = prepare(loaded.config)
    except ConfigError as error:
        raise loaded.source.locate(error) from None
    trajectory = TrajectoryDigest()
    simulate(prepared, [trajectory])
    digest = trajectory.hexdigest()
    recorded = summary["trajectory_sha256"]
    if digest != recorded:
        raise ReplayMismatchError(_describe(summary, recorded, digest))
    return digest


def _read_summary(folder: Path) -> dict[str, Any]:
    for name in (CONFIG_FILE, SUMMARY_FILE):
        if not (folder / name).is_file():
            valid = f"the folder of a finished run, with {name}"
            raise ConfigError("DIR", str(folder), valid, "command line")
    file = folder / SUMMARY_FILE
    try:
        summary = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise ConfigError("JSON", str(error), "a summary of a run", file) from None
    if not isinstance(summary, dict) or not summary.get("trajectory_sha256"):
        raise ConfigError("trajectory_sha256", None, "the digest of the run", file)
    return summary


def _describe(summary: dict[str, Any], recorded: str, digest: str) -> list[str]:
    differences = [f"trajectory_sha256 is {digest}, was {recorded}"]
    before, now = summary.get("versions", {}), collect_versions()
    differences += [
        f"{name} is {now.get(name)}, was {before.get(name)}"
        for name in sorted({*before, *now})
        if before.get(name) != now.get(name)
    ]
    return differences
