"""Strict reading and writing of frozen dataclasses as TOML tables.

Every field of a table class is declared with `setting`, which names the TOML
key and the reader that checks its value. TOML keys carry their unit, the
fields do not (SI units throughout).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from ballsim.errors import ConfigError

__all__ = [
    "Choice",
    "Flag",
    "FreeTable",
    "Integer",
    "Key",
    "ListOf",
    "Number",
    "Points",
    "Reader",
    "TableOf",
    "Text",
    "check_table",
    "list_keys",
    "read_table",
    "setting",
    "table_keys",
    "write_table",
]

_METADATA_KEY = "setting"
_MAX_INTEGER = 2**63 - 1  # the largest in TOML
Table = TypeVar("Table")


class Reader(Protocol):
    """Turns a TOML value into the value of a field and back."""

    def read(self, value: object, key: str) -> Any:
        """Return the field's value or raise ConfigError naming the key."""
        ...

    def write(self, value: Any) -> Any:
        """Return the TOML value."""
        ...


@dataclass(frozen=True, slots=True)
class Number:
    """A finite number within a range, or one of a few words.

    Attributes:
        low: Least valid value.
        high: Greatest valid value.
        is_low_open: True if `low` itself is not valid.
        unit: Unit, for the message.
        words: Words that are valid too.
    """

    low: float = -math.inf
    high: float = math.inf
    is_low_open: bool = False
    unit: str = ""
    words: tuple[str, ...] = ()

    def read(self, value: object, key: str) -> float | str:
        """Return the number as a float, or the word."""
        if isinstance(value, str) and value in self.words:
            return value
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            number = float(value)
            is_above = number > self.low if self.is_low_open else number >= self.low
            if math.isfinite(number) and is_above and number <= self.high:
                return number
        raise ConfigError(key, value, self._valid())

    def write(self, value: float | str) -> float | str:
        """Return the value itself."""
        return value

    def _valid(self) -> str:
        text = "a finite number"
        unit = f" {self.unit}" if self.unit else ""
        if math.isfinite(self.low):
            text += ", above" if self.is_low_open else ", at least"
            text += f" {self.low:g}{unit}"
        if math.isfinite(self.high):
            text += f", at most {self.high:g}{unit}"
        return ", or ".join([text, *(repr(word) for word in self.words)])


@dataclass(frozen=True, slots=True)
class Integer:
    """A whole number within a range."""

    low: int = 0
    high: int = _MAX_INTEGER

    def read(self, value: object, key: str) -> int:
        """Return the whole number."""
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        if is_whole and self.low <= value <= self.high:  # type: ignore[operator]
            return int(value)  # type: ignore[call-overload,no-any-return]
        valid = f"a whole number of at least {self.low}"
        if self.high < _MAX_INTEGER:
            valid += f" and at most {self.high}"
        raise ConfigError(key, value, valid)

    def write(self, value: int) -> int:
        """Return the value itself."""
        return value


@dataclass(frozen=True, slots=True)
class Flag:
    """True or false."""

    def read(self, value: object, key: str) -> bool:
        """Return the flag."""
        if isinstance(value, bool):
            return value
        raise ConfigError(key, value, "true or false")

    def write(self, value: bool) -> bool:
        """Return the value itself."""
        return value


@dataclass(frozen=True, slots=True)
class Text:
    """A text that is not empty."""

    def read(self, value: object, key: str) -> str:
        """Return the text."""
        if isinstance(value, str) and value.strip():
            return value
        raise ConfigError(key, value, "a text that is not empty")

    def write(self, value: str) -> str:
        """Return the value itself."""
        return value


@dataclass(frozen=True, slots=True)
class Choice:
    """One of a few words."""

    options: tuple[str, ...]

    def read(self, value: object, key: str) -> str:
        """Return the word."""
        if isinstance(value, str) and value in self.options:
            return value
        raise ConfigError(key, value, "one of " + ", ".join(self.options))

    def write(self, value: str) -> str:
        """Return the value itself."""
        return value


@dataclass(frozen=True, slots=True)
class FreeTable:
    """A table whose keys are somebody else's business, such as a controller's.

    Attributes:
        is_text_only: True if every value must be a text.
    """

    is_text_only: bool = False

    def read(self, value: object, key: str) -> dict[str, Any]:
        """Return a copy of the table."""
        if not isinstance(value, Mapping):
            raise ConfigError(key, value, "a table")
        for name, item in value.items():
            _refuse_not_finite(item, f"{key}.{name}")
            if self.is_text_only and not isinstance(item, str):
                raise ConfigError(f"{key}.{name}", item, "a text")
        return dict(value)

    def write(self, value: Mapping[str, Any]) -> dict[str, Any]:
        """Return a copy of the table."""
        return dict(value)


@dataclass(frozen=True, slots=True)
class TableOf:
    """A table of a known class."""

    table_type: type[Any]

    def read(self, value: object, key: str) -> Any:
        """Return the instance."""
        if isinstance(value, self.table_type):
            return value
        if not isinstance(value, Mapping):
            raise ConfigError(key, value, "a table")
        return read_table(self.table_type, value, key)

    def write(self, value: Any) -> dict[str, Any]:
        """Return the table."""
        return write_table(value)


@dataclass(frozen=True, slots=True)
class ListOf:
    """A list of tables of a known class."""

    table_type: type[Any]

    def read(self, value: object, key: str) -> tuple[Any, ...]:
        """Return the instances."""
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise ConfigError(key, value, "a list of tables")
        reader = TableOf(self.table_type)
        return tuple(reader.read(item, f"{key}.{i}") for i, item in enumerate(value))

    def write(self, value: Sequence[Any]) -> list[dict[str, Any]]:
        """Return the tables."""
        return [write_table(item) for item in value]


@dataclass(frozen=True, slots=True)
class Points:
    """A list of places on the floor, [x, y] each.

    Attributes:
        unit: Unit, for the message.
    """

    unit: str = ""

    def read(self, value: object, key: str) -> tuple[tuple[float, float], ...]:
        """Return the places."""
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise ConfigError(key, value, "a list of places [x, y]")
        points, number = [], Number(unit=self.unit)
        for i, item in enumerate(value):
            is_pair = isinstance(item, Sequence) and not isinstance(item, str)
            if not is_pair or len(item) != 2:
                raise ConfigError(f"{key}.{i}", item, "a place [x, y]")
            x, y = (float(number.read(part, f"{key}.{i}")) for part in item)
            points.append((x, y))
        return tuple(points)

    def write(self, value: Sequence[Sequence[float]]) -> list[list[float]]:
        """Return the lists."""
        return [list(point) for point in value]


@dataclass(frozen=True, slots=True)
class _Setting:
    key: str
    reader: Reader


def setting(reader: Reader, default: Any, key: str) -> Any:
    """Declare a field of a table class.

    Args:
        reader: What checks the value.
        default: Default, or a callable without arguments that makes it.
        key: TOML key, with its unit where it has one.

    Returns:
        The dataclass field.
    """
    metadata = {_METADATA_KEY: _Setting(key, reader)}
    if callable(default):
        return dataclasses.field(default_factory=default, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a table, for documentation.

    Attributes:
        name: Name of the field.
        key: TOML key.
        reader: What checks the value.
        default: Default as TOML has it, None where there is none.
    """

    name: str
    key: str
    reader: Reader
    default: Any


def list_keys(table_type: type[Any]) -> list[Key]:
    """Return the keys of a table class, in order.

    Args:
        table_type: Class made of `setting` fields, all with defaults.
    """
    instance = table_type()
    return [
        Key(name, item.key, item.reader, item.reader.write(getattr(instance, name)))
        for name, item in _settings(table_type)
    ]


def table_keys(table_type: type[Any]) -> tuple[str, ...]:
    """Return the TOML keys of a table class, in order."""
    return tuple(item.key for _, item in _settings(table_type))


def read_table(
    table_type: type[Table], table: Mapping[str, Any], prefix: str = ""
) -> Table:
    """Read a TOML table strictly.

    Args:
        table_type: Class made of `setting` fields.
        table: The table.
        prefix: Dotted key of the table, for messages.

    Returns:
        The instance, with defaults for the keys that the table lacks.

    Raises:
        ConfigError: A key is unknown, or a value has the wrong type or range.
    """
    known = {item.key: (name, item.reader) for name, item in _settings(table_type)}
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in known:
            where = f"of [{prefix}]" if prefix else "at the top"
            valid = f"no such key; the keys {where} are {', '.join(known)}"
            raise ConfigError(_join(prefix, key), value, valid)
        name, reader = known[key]
        values[name] = reader.read(value, _join(prefix, key))
    try:
        return table_type(**values)
    except ConfigError as error:  # from __post_init__, which knows no prefix
        key = _join(prefix, error.key)
        raise ConfigError(key, error.value, error.valid) from None


def write_table(instance: Any) -> dict[str, Any]:
    """Return the TOML table of an instance, every default written out."""
    return {
        item.key: item.reader.write(getattr(instance, name))
        for name, item in _settings(type(instance))
    }


def check_table(instance: Any) -> None:
    """Check every field of an instance; for `__post_init__`.

    Raises:
        ConfigError: A field has a value that its reader refuses.
    """
    for name, item in _settings(type(instance)):
        item.reader.read(getattr(instance, name), item.key)


def _settings(table_type: type[Any]) -> list[tuple[str, _Setting]]:
    return [
        (item.name, item.metadata[_METADATA_KEY])
        for item in dataclasses.fields(table_type)
        if _METADATA_KEY in item.metadata
    ]


def _join(prefix: str, key: str) -> str:
    return f"{prefix}.{key}" if prefix else key


def _refuse_not_finite(value: object, key: str) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(key, value, "a finite number")
    if isinstance(value, Mapping):
        for name, item in value.items():
            _refuse_not_finite(item, f"{key}.{name}")
    elif isinstance(value, (list, tuple)):
        for i, item in enumerate(value):
            _refuse_not_finite(item, f"{key}.{i}")
