"""What a run gives: summary, configuration, and everything over time."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ballsim.config import Config
from ballsim.config_io import parse_config
from ballsim.errors import ConfigError
from ballsim.outcome import KeptRun
from ballsim.recording.collected import collect_events, collect_signals
from ballsim.recording.events import FALL, Event
from ballsim.run_files import CONFIG_FILE, RECORDING_FILE, SUMMARY_FILE
from ballsim.time_series import TimeSeries

__all__ = ["RunResult", "load"]


@dataclass(frozen=True, slots=True)
class RunResult:
    """A run: what it was asked, what came out, and its course.

    Attributes:
        config: The configuration, every default written out.
        summary: What stands in ``summary.json``; empty where a run was killed.
        signals: All time series by path: ``truth/...`` what happened, ``estimate/...``
            what the robot believed, ``control/...`` what it wanted, ``sensors/...``
            what it was given, ``limits/...``, ``performance/...``.
        events: What happened, in words: gait, commands, pushes, the fall.
        folder: Folder of the files, or None if there are none.

    Examples:
        >>> import ballsim
        >>> run = ballsim.run("stand", duration=0.4)
        >>> run
        <RunResult stand with wheeled-lip, ball 0.5 m, sensors ideal, seed 0: up at \
0.4 s; 34 series, 1 event>
        >>> run["truth/ball/angle"].unit
        'rad'
        >>> run["truth/ball/angle"]["forward"].shape
        (20,)
        >>> run.survived
        True
    """

    config: Config
    summary: Mapping[str, Any]
    signals: Mapping[str, TimeSeries]
    events: tuple[Event, ...]
    folder: Path | None = None

    @classmethod
    def of(
        cls, kept: KeptRun, summary: Mapping[str, Any], folder: Path | None = None
    ) -> RunResult:
        """Return the result of a run whose rows have been kept in memory.

        Args:
            kept: The run.
            summary: Its summary.
            folder: Folder of its files, if there are any.
        """
        context, series = kept.context, kept.series
        signals = collect_signals(context, series)
        events = collect_events(context, series)
        return cls(kept.config, summary, signals, events, folder)

    @property
    def survived(self) -> bool:
        """Return True unless the robot fell."""
        return all(event.kind != FALL for event in self.events)

    def __repr__(self) -> str:
        """Return what was run and how it ended, on one line."""
        config = self.config
        falls = [event for event in self.events if event.kind == FALL]
        last = self.summary.get("simulated_time", self["truth/cop"].time[-1])
        ended = (
            f"{falls[0].text} at {falls[0].time:g} s" if falls else f"up at {last:g} s"
        )
        n_events = len(self.events)
        events = "1 event" if n_events == 1 else f"{n_events} events"
        where = "" if self.folder is None else f"; in {self.folder}"
        return (
            f"<RunResult {config.scenario} with {config.controller.name}, ball "
            f"{config.ball.radius:g} m, sensors {config.sensors.preset}, seed "
            f"{config.seed}: {ended}; {len(self.signals)} series, {events}{where}>"
        )

    def __getitem__(self, path: str) -> TimeSeries:
        """Return a time series by its path.

        Raises:
            KeyError: There is no such series; the message names those there are.
        """
        try:
            return self.signals[path.strip("/")]
        except KeyError:
            names = ", ".join(self.signals)
            raise KeyError(f"{path!r}; the series are {names}") from None

    def frame(self, *paths: str) -> Any:
        """Return time series side by side in a pandas DataFrame.

        Args:
            paths: Which ones; if none is given all, without ``limits`` and
                ``performance``.

        Returns:
            Time as index, [s], and columns ``path/component``. The rows are those
            of the series that has fewest; the others have a row at each of them.
        """
        import pandas as pd  # noqa: PLC0415 - slow

        chosen = [self[path] for path in paths] or [
            series
            for series in self.signals.values()
            if not series.path.startswith(("limits/", "performance/"))
        ]
        time = min((series.time for series in chosen), key=len)
        columns: dict[str, Any] = {}
        for series in chosen:
            rows = np.searchsorted(series.time, time - 1e-9)
            for name, column in zip(series.columns, series.values.T, strict=True):
                columns[f"{series.path}/{name}"] = column[rows]
        return pd.DataFrame(columns, index=pd.Index(time, name="time_s"))

    def describe(self) -> str:
        """Return a line for each time series: path, unit, components, what it is."""
        width = max(map(len, self.signals), default=0)
        return "\n".join(
            f"{path:<{width}}  [{series.unit}]  {', '.join(series.columns)}: "
            f"{series.description}"
            for path, series in self.signals.items()
        )


def load(path: str | Path) -> RunResult:
    """Read a run back from its recording.

    Args:
        path: Folder of a run, or an ``.rrd`` file of one.

    Returns:
        The run. Values are in single precision: that of the recording. A recording
        without its folder has no summary.

    Raises:
        ConfigError: There is no recording, or it is none of a run.

    Examples:
        >>> import ballsim, tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     _ = ballsim.run("stand", duration=0.5, out=folder)
        ...     run = ballsim.load(folder)
        >>> run.config.scenario, len(run["truth/cop"])
        ('stand', 100)
    """
    from ballsim.recording.reader import read_recording  # noqa: PLC0415 - slow

    path = Path(path)
    folder = path if path.is_dir() else None
    file = path / RECORDING_FILE if folder is not None else path
    if not file.is_file():
        valid = f"the folder of a run with {RECORDING_FILE}, or an .rrd file"
        raise ConfigError("DIR", str(path), valid, "command line")
    recording = read_recording(file)
    summary: dict[str, Any] = {}
    text, source = recording.config_text, str(file)
    if folder is not None:
        if (folder / SUMMARY_FILE).is_file():
            summary = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))
        if (folder / CONFIG_FILE).is_file():
            text = (folder / CONFIG_FILE).read_text(encoding="utf-8")
            source = str(folder / CONFIG_FILE)
    config = parse_config(text, source)
    return RunResult(config, summary, recording.signals, recording.events, folder)
