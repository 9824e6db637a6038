"""Where configurations come from and go to: TOML files, presets, overrides."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from ballsim.config import Config, suggest_duration
from ballsim.errors import ConfigError
from ballsim.sensor_presets import insert_preset
from ballsim.settings import read_table, table_keys, write_table
from ballsim.shipped_files import find_shipped, list_descriptions, parse_toml

__all__ = [
    "OPTION_KEYS",
    "ConfigSource",
    "LoadedConfig",
    "format_config",
    "list_scenarios",
    "load_config",
    "parse_config",
]

OPTION_KEYS = {
    "ball_radius": "ball.radius_m",
    "controller": "controller.name",
    "sensors": "sensors.preset",
    "seed": "seed",
    "duration": "duration_s",
}
"""Short names of options and the keys of the configuration that they change."""

_COMMAND_LINE = "command line"
_DEFAULT = "default value"
# Numbers as people type them, but not as TOML has them.
_SHORT_NUMBER = re.compile(r"[+-]?(\.\d+|\d+\.)([eE][+-]?\d+)?")
_FIRST_KEYS = ("sensors.preset", "controller.name")


@dataclass(frozen=True, slots=True)
class ConfigSource:
    """Where the values of a configuration stand.

    Attributes:
        file: The TOML file.
        overridden: Dotted keys whose values were given on the command line.
        given: Dotted keys that stand in the file.
    """

    file: str
    overridden: frozenset[str]
    given: frozenset[str]

    def locate(self, error: ConfigError) -> ConfigError:
        """Return the error with the place where its key was given."""
        if error.file is not None:
            return error
        if _holds(self.overridden, error.key):
            file = _COMMAND_LINE
        else:
            file = self.file if _holds(self.given, error.key) else _DEFAULT
        return ConfigError(error.key, error.value, error.valid, file)


@dataclass(frozen=True, slots=True)
class LoadedConfig:
    """A configuration and where it came from."""

    config: Config
    source: ConfigSource


def load_config(scenario: str | Path, overrides: Iterable[str] = ()) -> LoadedConfig:
    """Load a scenario and change single values of it.

    Args:
        scenario: Name of a shipped scenario or path of a TOML file.
        overrides: Texts ``key=value``: dotted keys (list items by number) or
            short names of the scenario's ``[parameters]``; values as in TOML,
            bare words as texts. ``sensors.preset`` replaces the whole
            ``[sensors]`` table, the name of another controller drops the
            settings of the present one; both act before all others.

    Returns:
        The configuration with its source.

    Raises:
        ConfigError: Any input is not valid.
    """
    file, table = _read_scenario(scenario)
    table.setdefault("scenario", Path(file).stem)
    pairs = [_split_override(text, table) for text in overrides]
    overridden = frozenset(key for key, _ in pairs)
    source = ConfigSource(file, overridden, frozenset(_dotted_keys(table)))
    try:
        for key, value in sorted(pairs, key=lambda pair: pair[0] not in _FIRST_KEYS):
            if key == "sensors.preset":
                table["sensors"] = {}
            elif key == "controller.name":
                _forget_settings_of_other(table, value)
            _assign(table, key, value)
        insert_preset(table)
        config = read_table(Config, table)
        if "duration_s" not in table:
            suggested = suggest_duration(config.command, config.ball.radius)
            config = dataclasses.replace(config, duration=suggested)
    except ConfigError as error:
        raise source.locate(error) from None
    return LoadedConfig(config, source)


def parse_config(text: str, file: str) -> Config:
    """Return the configuration that `format_config` has written.

    Args:
        text: The configuration as TOML.
        file: What messages call it.

    Raises:
        ConfigError: It is not valid.
    """
    try:
        return read_table(Config, parse_toml(text, file))
    except ConfigError as error:
        raise ConfigError(error.key, error.value, error.valid, file) from None


def format_config(config: Config) -> str:
    """Return a configuration as TOML with every default written out."""
    return tomli_w.dumps(write_table(config))


def list_scenarios() -> dict[str, str]:
    """Return the shipped scenarios: descriptions by name."""
    return list_descriptions("scenarios")


def _holds(keys: Iterable[str], key: str) -> bool:
    """Return True if the key, a part of it, or a table that it is in is there."""
    return any(
        key == other
        or key.startswith(f"{other}.")
        or other.startswith((f"{key}.", f"{key}_"))
        for other in keys
    )


def _dotted_keys(table: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    for name, value in table.items():
        if isinstance(value, Mapping) and value:
            yield from _dotted_keys(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}"


def _read_scenario(scenario: str | Path) -> tuple[str, dict[str, Any]]:
    shipped = find_shipped("scenarios")
    if str(scenario) in shipped:
        file = shipped[str(scenario)]
        return f"{scenario}.toml", parse_toml(file.read_text("utf-8"), file.name)
    path = Path(scenario)
    if not path.is_file():
        valid = f"one of {', '.join(sorted(shipped))}, or an existing TOML file"
        raise ConfigError("SCENARIO", str(scenario), valid, _COMMAND_LINE)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        valid = f"a readable TOML file ({error})"
        raise ConfigError("SCENARIO", str(scenario), valid, _COMMAND_LINE) from None
    return str(path), parse_toml(text, str(path))


def _split_override(text: str, table: Mapping[str, Any]) -> tuple[str, Any]:
    key, separator, value_text = text.partition("=")
    key = key.strip()
    if not separator or not all(key.split(".")):
        valid = "key=value with a dotted key, as in ball.radius_m=0.5"
        raise ConfigError("--set", text, valid, _COMMAND_LINE)
    parameters = table.get("parameters", {})
    known = table_keys(Config)
    if isinstance(parameters, Mapping) and key in parameters:
        key = str(parameters[key])
    elif key.split(".")[0] not in known:
        names = [*(parameters if isinstance(parameters, Mapping) else ()), *known]
        valid = f"no such key; the keys are {', '.join(names)}"
        raise ConfigError(key, _parse_value(value_text), valid, _COMMAND_LINE)
    return key, _parse_value(value_text)


def _parse_value(text: str) -> Any:
    if _SHORT_NUMBER.fullmatch(text.strip()):
        return float(text)
    try:
        table = tomllib.loads(f"value = {text.strip()}")
    except tomllib.TOMLDecodeError:
        return text.strip()
    return table["value"] if len(table) == 1 else text.strip()


def _assign(table: dict[str, Any], key: str, value: Any) -> None:
    *parents, last = key.split(".")
    here: Any = table
    for i, name in enumerate(parents):
        if isinstance(here, dict):
            here = here.setdefault(name, {})
        else:
            here = _item(here, name, ".".join(parents[:i]), key, value)
    if isinstance(here, dict):
        here[last] = value
    else:
        _item(here, last, ".".join(parents), key, value)
        here[int(last)] = value


def _item(here: Any, name: str, where: str, key: str, value: Any) -> Any:
    if not isinstance(here, list):
        raise ConfigError(key, value, f"{where} is a single value without keys")
    if not name.isdecimal() or int(name) >= len(here):
        count = len(here)
        raise ConfigError(key, value, f"{where} has {count} items, counted from 0")
    return here[int(name)]


def _forget_settings_of_other(table: dict[str, Any], name: Any) -> None:
    controller = table.get("controller")
    if isinstance(controller, dict) and controller.get("name", name) != name:
        table["controller"] = {}
