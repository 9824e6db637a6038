"""Presets (sensors of a whole robot) and parts (one product) behind the figures.

A part's figures stand below those of the preset that names it, and those below what
the user gives. A part that the user names replaces all that the preset says of the
sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ballsim.errors import ConfigError
from ballsim.sensor_config import SENSORS
from ballsim.shipped_files import find_shipped, list_descriptions, parse_toml

__all__ = ["insert_preset", "list_sensor_parts", "list_sensor_presets"]

_NO_PART = "none"


def list_sensor_presets() -> dict[str, str]:
    """Return the shipped sensor presets: descriptions by name."""
    return list_descriptions("presets")


def list_sensor_parts() -> dict[str, str]:
    """Return the parts whose figures are shipped: descriptions by name."""
    return list_descriptions("parts")


def insert_preset(table: dict[str, Any]) -> None:
    """Put the figures of preset and parts below those that a table gives itself.

    Args:
        table: A configuration, changed in place.

    Raises:
        ConfigError: A preset or a part is not known.
    """
    given = table.setdefault("sensors", {})
    if not isinstance(given, dict):
        return  # the strict reader says so
    preset = given.setdefault("preset", "ideal")
    shipped = find_shipped("presets")
    if preset not in shipped:
        valid = f"one of {', '.join(sorted(shipped))}"
        raise ConfigError("sensors.preset", preset, valid)
    figures = parse_toml(shipped[preset].read_text("utf-8"), f"{preset}.toml")
    for sensor in SENSORS:
        own, below = given.get(sensor, {}), figures.get(sensor, {})
        if not isinstance(own, dict):
            continue  # the strict reader says so
        if own.get("part", _NO_PART) != _NO_PART:
            below = {}
        part = {**below, **own}.get("part", _NO_PART)
        given[sensor] = {**_find_part(sensor, part), **below, **own}


def _find_part(sensor: str, part: object) -> Mapping[str, Any]:
    """Return what a part says of a sensor."""
    if part == _NO_PART:
        return {}
    kind = "gyro" if sensor == "ball_gyro" else sensor
    tables = {
        name: parse_toml(file.read_text("utf-8"), file.name)
        for name, file in find_shipped("parts").items()
    }
    fitting = sorted(name for name, figures in tables.items() if kind in figures)
    if part not in fitting:
        valid = f"one of {', '.join([_NO_PART, *fitting])}"
        raise ConfigError(f"sensors.{sensor}.part", part, valid)
    figures: Mapping[str, Any] = tables[str(part)][kind]
    return figures
