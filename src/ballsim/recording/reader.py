"""Reads a recording back: the signals, the events, the configuration."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

from ballsim.errors import ConfigError
from ballsim.recording.events import KIND_OF_LEVEL, Event
from ballsim.recording.paths import CONFIG_PATH, EVENTS_PATH
from ballsim.recording.tracks import TIMELINE
from ballsim.time_series import TimeSeries
from ballsim_controllers.messages import Array

__all__ = ["ReadRecording", "read_recording"]

_SCALARS = "Scalars:scalars"
_TEXT, _LEVEL = "TextLog:text", "TextLog:level"
_DOCUMENT = "TextDocument:text"
_FENCE = "```toml\n"


@dataclass(frozen=True, slots=True)
class ReadRecording:
    """What a recording holds.

    Attributes:
        signals: All time series by path.
        events: What happened, in the order of the times.
        config_text: The configuration as TOML.
    """

    signals: dict[str, TimeSeries]
    events: tuple[Event, ...]
    config_text: str


@dataclass(slots=True)
class _Entity:
    """What has been read of an entity."""

    fixed: dict[str, list[Any]] = field(default_factory=dict)
    times: list[Array] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    levels: list[str] = field(default_factory=list)


def read_recording(file: Path) -> ReadRecording:
    """Read a recording, that of a killed run too.

    Args:
        file: The ``.rrd`` file.

    Raises:
        ConfigError: It is no recording of a run.
    """
    entities: dict[str, _Entity] = {}
    valid = "the recording of a run, run.rrd"
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="RRD file has no footer")
        try:
            for chunk in RrdReader(file).stream():
                path = str(chunk.entity_path)
                _read_batch(entities.setdefault(path, _Entity()), chunk)
        except (OSError, RuntimeError, ValueError) as error:
            raise ConfigError("DIR", str(file), f"{valid} ({error})") from None
    signals = {
        path[1:]: _make_series(path[1:], entity)
        for path, entity in sorted(entities.items())
        if "columns" in entity.fixed
    }
    config = entities.get(CONFIG_PATH, _Entity()).fixed.get(_DOCUMENT)
    if not signals or config is None:
        raise ConfigError("DIR", str(file), valid)
    text = str(config[0]).removeprefix(_FENCE).removesuffix("```")
    return ReadRecording(signals, _make_events(entities.get(EVENTS_PATH)), text)


def _read_batch(entity: _Entity, chunk: Any) -> None:
    batch = chunk.to_record_batch()
    names = batch.schema.names
    if TIMELINE not in names:
        for name in names:
            values = batch.column(name).to_pylist()
            if values and values[-1] is not None:
                entity.fixed[name] = values[-1]
        return
    times = batch.column(TIMELINE).cast("int64").to_numpy() / 1e9
    if _SCALARS in names:
        flat = batch.column(_SCALARS).flatten().to_numpy(zero_copy_only=False)
        values = flat.reshape(len(times), -1).astype(np.float64)
        entity.times.append(times)
        entity.values.append(values)
    elif _TEXT in names:
        entity.times.append(times)
        entity.texts.extend(row[0] for row in batch.column(_TEXT).to_pylist())
        entity.levels.extend(row[0] for row in batch.column(_LEVEL).to_pylist())


def _make_series(path: str, entity: _Entity) -> TimeSeries:
    columns = tuple(entity.fixed["columns"])
    times = np.concatenate([*entity.times, np.empty(0)])
    values = np.concatenate([*entity.values, np.empty((0, len(columns)))])
    order = np.argsort(times, kind="stable")
    unit, description = entity.fixed["unit"][0], entity.fixed["description"][0]
    return TimeSeries(path, unit, description, columns, times[order], values[order])


def _make_events(entity: _Entity | None) -> tuple[Event, ...]:
    if entity is None or not entity.times:
        return ()
    times = np.concatenate(entity.times)
    events = [
        Event(float(time), KIND_OF_LEVEL[level], text)
        for time, level, text in zip(times, entity.levels, entity.texts, strict=True)
    ]
    return tuple(sorted(events, key=lambda event: event.time))
