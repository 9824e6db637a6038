"""The reference part of the documentation, made from the code itself."""

from __future__ import annotations

import argparse
import functools
import inspect
import os
import re
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

from ballsim.cli import make_parser
from ballsim.config import Config
from ballsim.config_io import load_config
from ballsim.live.instructions import INSTRUCTIONS
from ballsim.live.keys import KEYS
from ballsim.preparation import prepare
from ballsim.recording.bounds import BOUNDS
from ballsim.recording.catalogue import make_signals
from ballsim.recording.limits import find_limits
from ballsim.recording.recorder import RunContext
from ballsim.settings import (
    Choice,
    Flag,
    Integer,
    Key,
    ListOf,
    Number,
    Reader,
    TableOf,
    list_keys,
)

__all__ = [
    "PARTS",
    "format_commands",
    "format_instructions",
    "format_keys",
    "format_settings",
    "format_signals",
]

_WIDTH = "88"
_ATTRIBUTE = re.compile(r"^    (\w+): (.*)$")
_CONTROLLERS = ("wheeled-lip", "paper")


def format_settings() -> str:
    """Return every key of ``config.toml``: unit and range, default, meaning."""
    lines = list(_format_table(Config, ""))
    for name in _CONTROLLERS:
        config = load_config("stand", [f"controller.name={name}"]).config
        table = prepare(config).config.controller.settings
        lines += [f"\n## `[controller]` of `{name}`\n", "| key | default |"]
        lines.append("| --- | --- |")
        for key, value in _flatten(table):
            lines.append(f"| `controller.{key}` | {_show(value)} |")
    return "\n".join(lines) + "\n"


def format_commands() -> str:
    """Return the help of every command."""
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = _WIDTH
    try:
        parser = make_parser()
        parts = ["```text", parser.format_help().rstrip(), "```"]
        for name, command in _list_commands(parser):
            help_text = command.format_help().rstrip()
            parts += [f"\n## `ballsim {name}`\n", "```text", help_text, "```"]
    finally:
        if before is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = before
    return "\n".join(parts) + "\n"


def format_signals() -> str:
    """Return every time series of a recording: path, unit, rows, components."""
    context = _make_context()
    lines = ["| path | unit | a row each | components | is |"]
    lines.append("| --- | --- | --- | --- | --- |")
    joints = tuple(context.ids.joint_names)
    for signal in make_signals(context):
        rows = "20 ms" if signal.is_slow else "control tick"
        columns = ", ".join(signal.columns)
        if signal.columns == joints:
            columns = "the joints by name"
        lines.append(
            f"| `{signal.path[1:]}` | {signal.unit} | {rows} | {columns} "
            f"| {signal.description} |"
        )
    for limits in find_limits(context):
        columns = "`<joint>_low`, `<joint>_high`"
        lines.append(
            f"| `{limits.path[1:]}` | {limits.unit} | start, end | {columns} "
            f"| {limits.description} |"
        )
    for bounds in BOUNDS:
        columns = "`<component>_low`, `<component>_high`"
        lines.append(
            f"| `{bounds.path[1:]}` | {bounds.unit} | 0.3 s, closer at the start "
            f"| {columns} | {bounds.description} |"
        )
    return "\n".join(lines) + "\n"


def format_instructions() -> str:
    """Return what can be said to a live run."""
    lines = ["| line | does |", "| --- | --- |"]
    for usage, text in INSTRUCTIONS.items():
        lines.append("| `{}` | {} |".format(usage.replace("|", "\\|"), text))
    return "\n".join(lines) + "\n"


def format_keys() -> str:
    """Return what the keys of a terminal do in a live run."""
    lines = ["| key | is short for |", "| --- | --- |"]
    lines += [f"| {key.name} | `{key.line}` |" for key in KEYS]
    return "\n".join(lines) + "\n"


PARTS = {
    "settings": format_settings,
    "commands": format_commands,
    "signals": format_signals,
    "instructions": format_instructions,
    "keys": format_keys,
}
"""What makes each generated part of a page, by the name in its mark."""


@functools.cache
def _make_context() -> RunContext:
    prepared = prepare(load_config("stand").config)
    return RunContext(
        config=prepared.config,
        robot=prepared.robot,
        scene_xml=prepared.scene_xml,
        model=mujoco.MjModel.from_xml_string(prepared.scene_xml),
        ids=prepared.ids,
        world=prepared.world,
        encoder_zeros=prepared.sensors.encoder_zeros,
    )


def _list_commands(
    parser: argparse.ArgumentParser,
) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.items()


def _format_table(table_type: type[Any], prefix: str, mark: str = "") -> Iterator[str]:
    """Yield the section of a table, then those of the tables in it."""
    keys, texts = list_keys(table_type), _read_attributes(table_type)
    inner = [key for key in keys if isinstance(key.reader, (TableOf, ListOf))]
    title = f"`{mark or f'[{prefix}]'}`" if prefix else "The top of the file"
    summary = (inspect.getdoc(table_type) or "").splitlines()[0]
    yield f"\n## {title}\n\n{summary}\n"
    yield "| key | valid | default | is |"
    yield "| --- | --- | --- | --- |"
    for key in keys:
        if key in inner or key.key == "controller":
            continue
        name = f"{prefix}.{key.key}" if prefix else key.key
        text = texts.get(key.name, "")
        yield f"| `{name}` | {_valid(key.reader)} | {_show(key.default)} | {text} |"
    for key in inner:
        yield from _format_inner(key, prefix)


def _format_inner(key: Key, prefix: str) -> Iterator[str]:
    name = f"{prefix}.{key.key}" if prefix else key.key
    reader = key.reader
    if isinstance(reader, ListOf):
        yield from _format_table(reader.table_type, name, f"[[{name}]]")
    elif isinstance(reader, TableOf):
        yield from _format_table(reader.table_type, name)


def _valid(reader: Reader) -> str:
    """Return what values a reader accepts, with the unit."""
    if isinstance(reader, Number):
        unit = f" {reader.unit}" if reader.unit else ""
        low = "(" if reader.is_low_open else "["
        ends = [_end(reader.low, "-"), _end(reader.high, "+")]
        text = f"{low}{ends[0]}, {ends[1]}]{unit}"
        return ", or ".join([text, *(f"`{word}`" for word in reader.words)])
    if isinstance(reader, Integer):
        top = "" if reader.high > 2**62 else f", at most {reader.high}"
        return f"whole, at least {reader.low}{top}"
    if isinstance(reader, Flag):
        return "`true`, `false`"
    if isinstance(reader, Choice):
        return ", ".join(f"`{option}`" for option in reader.options)
    kind = type(reader).__name__
    return {"Text": "text", "FreeTable": "table"}.get(kind, "")


def _end(value: float, sign: str) -> str:
    return f"{value:g}" if np.isfinite(value) else f"{sign}inf"


def _show(value: Any) -> str:
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_show(item) for item in value) + "]"
    if isinstance(value, Mapping):
        return ""
    return f"`{value}`" if isinstance(value, str) else str(value)


def _read_attributes(table_type: type[Any]) -> dict[str, str]:
    """Return the text of each attribute in a class's docstring."""
    texts: dict[str, str] = {}
    name, is_inside = "", False
    for line in (inspect.getdoc(table_type) or "").splitlines():
        if line.strip() == "Attributes:":
            is_inside = True
        elif is_inside and (match := _ATTRIBUTE.match(line)):
            name, texts[match[1]] = match[1], match[2]
        elif is_inside and name and line.startswith("     "):
            texts[name] += f" {line.strip()}"
    return {
        key: text.replace("|", "\\|").replace("``", "`") for key, text in texts.items()
    }


def _flatten(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
