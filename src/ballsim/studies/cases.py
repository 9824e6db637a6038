"""Cases of a study: scenarios with their parameters, and what a run has to keep."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ballsim.errors import ConfigError
from ballsim.settings import FreeTable, Number, Text, check_table, setting
from ballsim.studies.factors import (
    Maybe,
    Seeds,
    Value,
    ValueList,
    describe,
    flatten_table,
    is_number,
)

__all__ = ["Case", "Requirement", "Variant"]

_EXPRESSION = re.compile(r"([\w.]+)(?:\s*([*/])\s*([\w.]+))?")


@dataclass(frozen=True, slots=True)
class Requirement:
    """Where a number of the summary has to lie.

    Attributes:
        text: What is limited: the name of a number of the summary, or the product
            or quotient of two, as in ``ball_angle_overshoot * ball_radius``.
        low: Least value; None if the size is limited.
        high: Greatest value; greatest size if `low` is None.
    """

    text: str
    low: float | None
    high: float

    @property
    def names(self) -> tuple[str, ...]:
        """Return the numbers of the summary that it needs."""
        first, _, second = self._parts()
        return (first,) if second is None else (first, second)

    def evaluate(self, row: Mapping[str, Any]) -> float | None:
        """Return the limited number of a run, None where it is not defined.

        Args:
            row: The run's numbers by name.
        """
        _, operator, second = self._parts()
        values = [row.get(name) for name in self.names]
        if not all(is_number(value) for value in values):
            return None
        numbers = [float(value) for value in values if value is not None]
        if second is None:
            return numbers[0]
        if operator == "*":
            return numbers[0] * numbers[1]
        return numbers[0] / numbers[1] if numbers[1] else None

    def is_kept(self, value: float | None) -> bool:
        """Return True if a value is within the limits; None is not."""
        if value is None:
            return False
        if self.low is None:
            return abs(value) <= self.high
        return self.low <= value <= self.high

    def _parts(self) -> tuple[str, str | None, str | None]:
        match = _EXPRESSION.fullmatch(self.text)
        assert match is not None
        first, operator, second = match.groups()
        return first, operator, second


@dataclass(frozen=True, slots=True)
class _Requirements:
    """A table of limits: the greatest size, or ``[low, high]``."""

    def read(self, value: object, key: str) -> tuple[Requirement, ...]:
        """Return the requirements."""
        if isinstance(value, tuple) and all(isinstance(r, Requirement) for r in value):
            return value
        if not isinstance(value, Mapping):
            raise ConfigError(key, value, "a table")
        return tuple(
            _read_requirement(text, limit, f"{key}.{text}")
            for text, limit in flatten_table(value)
        )

    def write(self, value: Sequence[Requirement]) -> dict[str, Any]:
        """Return the table."""
        return {r.text: r.high if r.low is None else [r.low, r.high] for r in value}


def _read_requirement(text: str, limit: object, key: str) -> Requirement:
    if not _EXPRESSION.fullmatch(text):
        valid = "a number of the summary, or 'a * b' or 'a / b' of two such"
        raise ConfigError(key, limit, valid)
    if isinstance(limit, Sequence) and not isinstance(limit, str):
        ends = [float(Number().read(end, key)) for end in limit]
        if len(ends) != 2 or ends[0] > ends[1]:
            valid = "[low, high], two numbers, low not above high"
            raise ConfigError(key, list(limit), valid)
        return Requirement(text, *ends)
    if not is_number(limit):
        valid = "a number of at least 0, the greatest size; or a range [low, high]"
        raise ConfigError(key, limit, valid)
    return Requirement(text, None, float(Number(0.0).read(limit, key)))


@dataclass(frozen=True, slots=True)
class _ValueTable:
    """Lists of values by dotted key."""

    def read(self, value: object, key: str) -> dict[str, tuple[Value, ...]]:
        """Return the lists."""
        if not isinstance(value, Mapping):
            raise ConfigError(key, value, "a table")
        reader = ValueList()
        return {
            name: reader.read(item, f"{key}.{name}")
            for name, item in flatten_table(value)
        }

    def write(self, value: Mapping[str, Sequence[Value]]) -> dict[str, Any]:
        """Return the table."""
        return {name: list(items) for name, items in value.items()}


@dataclass(frozen=True, slots=True)
class Case:
    """One scenario of a study that has several.

    Attributes:
        name: Name; no two cases have the same.
        scenario: Name of a shipped scenario, or a TOML file beside the study.
        duration: Simulated time of each run, [s]; the study's if None.
        seeds: Seeds of each cell; the study's if None.
        base: Values that differ from the scenario, by dotted key; they win over
            the study's.
        each: Lists of values by dotted key: one case for each combination.
        only: The values of factors that this case takes, by key; all of those that
            are not named.
        requirements: What a run has to keep besides staying up.
    """

    name: str = setting(Text(), "", "name")
    scenario: str = setting(Text(), "", "scenario")
    duration: float | None = setting(
        Maybe(Number(0.0, 3600.0, is_low_open=True, unit="s")), None, "duration_s"
    )
    seeds: tuple[int, ...] | None = setting(Maybe(Seeds()), None, "seeds")
    base: Mapping[str, Any] = setting(FreeTable(), dict, "base")
    each: Mapping[str, tuple[Value, ...]] = setting(_ValueTable(), dict, "each")
    only: Mapping[str, tuple[Value, ...]] = setting(_ValueTable(), dict, "only")
    requirements: tuple[Requirement, ...] = setting(_Requirements(), tuple, "require")

    def __post_init__(self) -> None:
        """Check the fields, and that no key is set twice."""
        check_table(self)
        for key, values in self.each.items():
            if key in self.base_values:
                valid = f"nothing: base.{key} is set"
                raise ConfigError(f"each.{key}", list(values), valid)

    @property
    def base_values(self) -> dict[str, Any]:
        """Return the values that differ from the scenario, by dotted key."""
        return dict(flatten_table(self.base))

    def expand(self) -> list[Case]:
        """Return the cases that `each` makes of this one, itself if it is empty."""
        if not self.each:
            return [self]
        combinations = itertools.product(*self.each.values())
        settings = [dict(zip(self.each, c, strict=True)) for c in combinations]
        return [
            replace(
                self,
                name=f"{self.name}, {describe(values)}",
                base={**self.base_values, **values},
                each={},
            )
            for values in settings
        ]

    def vary(self, variant: Variant) -> Case:
        """Return this case with the values of a variant besides its own.

        Args:
            variant: The variant; it sets no key that the case sets.
        """
        base = {**self.base_values, **variant.base_values}
        return replace(self, name=f"{variant.name}: {self.name}", base=base)


@dataclass(frozen=True, slots=True)
class Variant:
    """What is different, in every case of a study that has several such.

    Attributes:
        name: Name; no two variants have the same.
        base: Values that differ, by dotted key.
    """

    name: str = setting(Text(), "", "name")
    base: Mapping[str, Any] = setting(FreeTable(), dict, "base")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)

    @property
    def base_values(self) -> dict[str, Any]:
        """Return the values that differ, by dotted key."""
        return dict(flatten_table(self.base))
