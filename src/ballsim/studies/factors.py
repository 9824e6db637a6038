"""Factors of a study: keys of the configuration and the values that they take."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ballsim.errors import ConfigError
from ballsim.settings import Choice, Integer, Reader, Text, check_table, setting

__all__ = [
    "Factor",
    "Maybe",
    "Seeds",
    "Value",
    "ValueList",
    "describe",
    "flatten_table",
    "is_number",
]

Value = bool | int | float | str

_KINDS = {
    "values": "values",
    "linspace": "linspace",
    "logspace": "logspace",
    "range": "span",
}


def flatten_table(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return the single values and lists of nested tables, by dotted key."""
    items: list[tuple[str, Any]] = []
    for name, value in table.items():
        if isinstance(value, Mapping):
            items += flatten_table(value, f"{prefix}{name}.")
        else:
            items.append((f"{prefix}{name}", value))
    return items


def is_number(value: object) -> bool:
    """Return True for a number that is not a flag."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


@dataclass(frozen=True, slots=True)
class Maybe:
    """A value of another reader, or nothing.

    Attributes:
        reader: Reads the value if there is one.
    """

    reader: Reader

    def read(self, value: object, key: str) -> Any:
        """Return the value, None if there is none."""
        return None if value is None else self.reader.read(value, key)

    def write(self, value: Any) -> Any:
        """Return the TOML value, None if there is none."""
        return None if value is None else self.reader.write(value)


@dataclass(frozen=True, slots=True)
class ValueList:
    """Different single values, at least one."""

    def read(self, value: object, key: str) -> tuple[Value, ...]:
        """Return the values."""
        if not isinstance(value, Sequence) or isinstance(value, str) or not value:
            raise ConfigError(key, value, "a list of at least one value")
        for item in value:
            is_finite = not isinstance(item, float) or math.isfinite(item)
            if not isinstance(item, (bool, int, float, str)) or not is_finite:
                raise ConfigError(key, item, "a finite number, a text, true or false")
        if len(set(value)) < len(value):
            raise ConfigError(key, list(value), "values that all differ")
        return tuple(value)

    def write(self, value: Sequence[Value]) -> list[Value]:
        """Return the values."""
        return list(value)


@dataclass(frozen=True, slots=True)
class Seeds:
    """A number of seeds, counted from 0, or a list of them."""

    def read(self, value: object, key: str) -> tuple[int, ...]:
        """Return the seeds."""
        if isinstance(value, int) and not isinstance(value, bool) and value > 0:
            return tuple(range(value))
        valid = "a number of seeds, at least 1, or a list of different seeds"
        if not isinstance(value, Sequence) or isinstance(value, str) or not value:
            raise ConfigError(key, value, valid)
        reader = Integer()
        seeds = tuple(reader.read(item, f"{key}.{i}") for i, item in enumerate(value))
        if len(set(seeds)) < len(seeds):
            raise ConfigError(key, list(seeds), valid)
        return seeds

    def write(self, value: Sequence[int]) -> list[int]:
        """Return the list."""
        return list(value)


@dataclass(frozen=True, slots=True)
class _Spread:
    """Two ends, low before high, and how many values from one to the other."""

    has_count: bool
    is_log: bool = False

    def read(self, value: object, key: str) -> tuple[float, ...]:
        """Return low, high and, if asked for, the count."""
        words = "two numbers [low, high]"
        if self.has_count:
            words = "[low, high, count], as in [0.0, 2.0, 5] for 0, 0.5, 1, 1.5, 2"
        n = 3 if self.has_count else 2
        if (
            not isinstance(value, Sequence)
            or isinstance(value, str)
            or len(value) != n
            or not all(is_number(item) and math.isfinite(item) for item in value)
        ):
            raise ConfigError(key, value, words)
        if value[0] >= value[1]:
            raise ConfigError(key, list(value), f"{words}, low less than high")
        if self.is_log and value[0] <= 0:
            raise ConfigError(key, list(value), f"{words}, low above 0")
        if self.has_count and (not isinstance(value[2], int) or value[2] < 2):
            raise ConfigError(key, list(value), f"{words}, count at least 2")
        return tuple(value)

    def write(self, value: Sequence[float]) -> list[float]:
        """Return the numbers."""
        return list(value)


@dataclass(frozen=True, slots=True)
class Factor:
    """One thing that a study varies.

    Attributes:
        key: Dotted key of the configuration, or a parameter of the scenario.
        label: Name for people; the key if None.
        values: Values of a grid, or None.
        linspace: Low, high and count of evenly spaced values, or None.
        logspace: Low, high and count of values with a constant ratio, or None.
        span: Low and high of a range (key ``range``) to draw from, or None.
        scale: ``log`` or ``linear``, for axes, fits and samples.
        harder: Which end makes it harder to stay up, ``high`` or ``low``, or None
            if neither does; only with one is survival fitted along the factor.
    """

    key: str = setting(Text(), "", "key")
    label: str | None = setting(Maybe(Text()), None, "label")
    values: tuple[Value, ...] | None = setting(Maybe(ValueList()), None, "values")
    linspace: tuple[float, ...] | None = setting(Maybe(_Spread(True)), None, "linspace")
    logspace: tuple[float, ...] | None = setting(
        Maybe(_Spread(True, is_log=True)), None, "logspace"
    )
    span: tuple[float, ...] | None = setting(Maybe(_Spread(False)), None, "range")
    scale: str | None = setting(Maybe(Choice(("linear", "log"))), None, "scale")
    harder: str | None = setting(Maybe(Choice(("high", "low"))), None, "harder")

    def __post_init__(self) -> None:
        """Check the fields, and that one kind of values is given."""
        check_table(self)
        given = [k for k, name in _KINDS.items() if getattr(self, name) is not None]
        if len(given) != 1:
            valid = f"exactly one of {', '.join(_KINDS)}, here {' and '.join(given)}"
            if not given:
                valid = f"a factor with one of {', '.join(_KINDS)}"
            raise ConfigError("key", self.key, valid)
        if self.is_log and not all(is_number(v) and v > 0 for v in self.levels):  # type: ignore[operator]
            raise ConfigError("scale", self.scale, "'linear' unless all values are > 0")

    @property
    def name(self) -> str:
        """Return the name for people."""
        return self.label or self.key

    @property
    def is_sampled(self) -> bool:
        """Return True if values are drawn from a range."""
        return self.span is not None

    @property
    def is_log(self) -> bool:
        """Return True if ratios count, not differences."""
        if self.scale is None:
            return self.logspace is not None
        return self.scale == "log"

    @property
    def is_numeric(self) -> bool:
        """Return True if all values are numbers."""
        return all(is_number(value) for value in self.levels)

    @property
    def levels(self) -> tuple[Value, ...]:
        """Return the values of the grid, the two ends of a range."""
        if self.values is not None:
            return self.values
        if self.span is not None:
            return self.span
        low, high, count = self.linspace or self.logspace or (0.0, 0.0, 1)
        shares = [i / (int(count) - 1) for i in range(int(count))]
        if self.linspace is not None:
            numbers = [low + share * (high - low) for share in shares]
        else:
            numbers = [low * (high / low) ** share for share in shares]
        numbers[-1] = high
        if isinstance(low, int) and all(number == int(number) for number in numbers):
            return tuple(int(number) for number in numbers)
        return tuple(float(f"{number:.12g}") for number in numbers)

    def place(self, share: float) -> float:
        """Return the value at a share of a range, 0 its low and 1 its high end."""
        low, high = self.span or (0.0, 0.0)
        if self.is_log:
            return float(low * (high / low) ** share)
        return float(low + share * (high - low))


def describe(settings: Mapping[str, Value]) -> str:
    """Return values by key as words for people."""
    return ", ".join(
        f"{key} = {value:g}" if isinstance(value, float) else f"{key} = {value}"
        for key, value in settings.items()
    )
