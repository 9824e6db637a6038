"""TOML files that come with the package: scenarios, sensor presets, sensor parts."""

from __future__ import annotations

import tomllib
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

from ballsim.errors import ConfigError

__all__ = ["find_shipped", "list_descriptions", "parse_toml"]


def find_shipped(folder: str) -> dict[str, Traversable]:
    """Return the TOML files of a folder of the package, by name."""
    files = resources.files("ballsim").joinpath(folder).iterdir()
    return {f.name[: -len(".toml")]: f for f in files if f.name.endswith(".toml")}


def list_descriptions(folder: str) -> dict[str, str]:
    """Return the descriptions in the TOML files of a folder, by name, sorted."""
    descriptions = {}
    for name, file in sorted(find_shipped(folder).items()):
        table = parse_toml(file.read_text(encoding="utf-8"), file.name)
        descriptions[name] = str(table.get("description", "no description"))
    return descriptions


def parse_toml(text: str, file: str) -> dict[str, Any]:
    """Return a TOML document as a table.

    Args:
        text: The document.
        file: Name of its file, for the message.

    Raises:
        ConfigError: It is none.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError("TOML", str(error), "a TOML document", file) from None
