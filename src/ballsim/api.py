"""What ``import ballsim`` offers: run, load, study."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from ballsim.config_io import OPTION_KEYS, load_config
from ballsim.errors import ConfigError
from ballsim.metrics import run_and_summarise
from ballsim.outcome import KeptRun, RunOutcome
from ballsim.preparation import prepare
from ballsim.recording.recorder import SeriesKeeper
from ballsim.run_files import run_with_files
from ballsim.run_result import RunResult, load

__all__ = ["RunResult", "StudyResult", "load", "run", "study"]


@dataclass(frozen=True, slots=True)
class StudyResult:
    """A Monte-Carlo study that is done.

    Attributes:
        numbers: What stands in ``report.json``: runs, survival, intervals.
        folder: Folder of the files; ``report.md`` is to be read first.
    """

    numbers: Mapping[str, Any]
    folder: Path

    def __repr__(self) -> str:
        """Return what came out, on one line."""
        numbers = self.numbers
        return (
            f"<StudyResult {numbers['study']}: {numbers['runs']} runs, "
            f"{numbers['fell']} fell; in {self.folder}>"
        )

    def frame(self) -> Any:
        """Return a pandas DataFrame with a row for each run."""
        import pandas as pd  # noqa: PLC0415 - slow

        return pd.read_parquet(self.folder / "results.parquet")


def run(
    scenario: str | Path, *, out: str | Path | None = None, **changes: object
) -> RunResult:
    """Run a scenario, and keep its course.

    Args:
        scenario: Name of a shipped scenario, or path of a TOML file.
        out: Folder for the files of the run, the recording among them; nothing is
            written without it.
        changes: Values to change, as with ``ballsim run``: ``ball_radius``,
            ``controller``, ``sensors``, ``seed``, ``duration``, parameters of the
            scenario, and dotted keys of the configuration in a dictionary:
            ``**{"controller.gait.lift_m": 0.04}``.

    Returns:
        The run, with its time series in double precision.

    Raises:
        ConfigError: An input is not valid; nothing is written then.
        PhysicsError: The physics failed.

    Examples:
        Three lines to a first result:

        >>> import ballsim
        >>> run = ballsim.run("stand", duration=0.5, ball_radius=0.25)
        >>> bool(abs(run["truth/ball/angle"]["forward"]).max() < 0.1)
        True
    """
    overrides = [
        f"{OPTION_KEYS.get(name, name)}={_format(value)}"
        for name, value in changes.items()
    ]
    loaded = load_config(scenario, overrides)
    try:
        prepared = prepare(loaded.config)
    except ConfigError as error:
        raise loaded.source.locate(error) from None
    words = ["ballsim", "run", str(scenario)]
    words += [word for override in overrides for word in ("--set", override)]
    command, keeper = shlex.join(words), SeriesKeeper()
    outcome: RunOutcome
    if out is None:
        outcome, summary = run_and_summarise(prepared, command, [keeper])
        folder = None
    else:
        folder = Path(out)
        finished = run_with_files(prepared, folder, command=command, recorders=[keeper])
        outcome, summary = finished.outcome, finished.summary
    # What a file cannot hold, the summary does not hold either.
    summary = json.loads(json.dumps(summary))
    return RunResult.of(KeptRun.of(outcome, keeper.series), summary, folder)


def study(
    definition: str | Path, *, out: str | Path | None = None, workers: int | None = None
) -> StudyResult:
    """Run a Monte-Carlo study, or what is left of it.

    Args:
        definition: The study, a TOML file.
        out: Folder of the files, ``runs/study-<name>`` if None.
        workers: Number of processes, one for each core if None.

    Raises:
        ConfigError: An input is not valid; nothing is written then.
        StudyError: The workers cannot work; what is done is kept.
    """
    from ballsim.studies.command import choose_workers, run_study  # noqa: PLC0415

    n_workers = choose_workers(None if workers is None else str(workers))
    folder = None if out is None else Path(out)
    finished = run_study(Path(definition), folder, n_workers)
    return StudyResult(finished.numbers, finished.folder)


def _format(value: object) -> str:
    """Return a value as TOML has it."""
    if hasattr(value, "item"):  # a NumPy scalar
        value = value.item()
    if isinstance(value, Path):
        value = str(value)
    return tomli_w.dumps({"value": value}).removeprefix("value =").strip()
