"""The definition of a study: one TOML file, read strictly."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ballsim.errors import ConfigError
from ballsim.settings import (
    Choice,
    FreeTable,
    Integer,
    ListOf,
    Number,
    TableOf,
    Text,
    check_table,
    read_table,
    setting,
)
from ballsim.studies.cases import Case, Variant
from ballsim.studies.factors import Factor, Maybe, Seeds, flatten_table
from ballsim.studies.sampling import SALTELLI, SamplingConfig

__all__ = ["DEFAULT_METRICS", "StoppingConfig", "Study", "read_study"]

DEFAULT_METRICS = ("ball_angle_error", "cop_deviation_rms")
_DEFAULT_SEEDS = tuple(range(10))
_STAND = "stand"


@dataclass(frozen=True, slots=True)
class _Texts:
    """Different texts."""

    def read(self, value: object, key: str) -> tuple[str, ...]:
        """Return the texts."""
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise ConfigError(key, value, "a list of texts")
        texts = tuple(Text().read(item, f"{key}.{i}") for i, item in enumerate(value))
        if len(set(texts)) < len(texts):
            raise ConfigError(key, list(texts), "texts that all differ")
        return texts

    def write(self, value: Sequence[str]) -> list[str]:
        """Return the texts."""
        return list(value)


@dataclass(frozen=True, slots=True)
class StoppingConfig:
    """When a cell gets no more seeds.

    A cell stops after the first batch at whose end the Wilson interval of its
    survival is narrow enough. Only its own runs count, in the order of the seeds,
    so that the number of runs is the same for any number of workers.

    Attributes:
        half_width: Half of the interval's width that is narrow enough.
        min_seeds: Runs of a cell before the first decision.
        batch: Runs between two decisions.
    """

    half_width: float = setting(Number(0.0, 0.5, is_low_open=True), 0.1, "half_width")
    min_seeds: int = setting(Integer(1), 10, "min_seeds")
    batch: int = setting(Integer(1), 10, "batch")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class Study:
    """All that the file says.

    Attributes:
        name: Name; that of the file if None.
        description: One line about it.
        scenario: Name of a shipped scenario, or a TOML file beside the study; None
            for ``stand``, or if there are cases.
        duration: Simulated time of each run, [s]; the scenario's if None.
        seeds: Seeds of each cell whose case has none of its own.
        metrics: Numbers of the summary that the report compares.
        axis: Key of the factor along which survival is drawn; if None a numeric
            one, preferably one with a hard end, then the one with the most levels.
        run_limit: Wall-clock time that a run may take, [s].
        keep_recordings: ``none`` or ``falls``: the last 5 s of fallen runs.
        base: Values that differ from the scenario in every run, by dotted key.
        cases: Scenarios with their parameters; none if there is one scenario only.
        variants: What is different in every case, one after the other; none if the
            cases stand for themselves.
        factors: What is varied.
        sampling: How points within ranges are chosen, if there are ranges.
        stopping: When a cell gets no more seeds, or None: all seeds.
    """

    name: str | None = setting(Maybe(Text()), None, "name")
    description: str = setting(Text(), "no description", "description")
    scenario: str | None = setting(Maybe(Text()), None, "scenario")
    duration: float | None = setting(
        Maybe(Number(0.0, 3600.0, is_low_open=True, unit="s")), None, "duration_s"
    )
    seeds: tuple[int, ...] = setting(Seeds(), _DEFAULT_SEEDS, "seeds")
    metrics: tuple[str, ...] = setting(_Texts(), DEFAULT_METRICS, "metrics")
    axis: str | None = setting(Maybe(Text()), None, "axis")
    run_limit: float = setting(
        Number(0.0, 1e6, is_low_open=True, unit="s"), 600.0, "run_limit_s"
    )
    keep_recordings: str = setting(Choice(("none", "falls")), "none", "keep_recordings")
    base: Mapping[str, Any] = setting(FreeTable(), dict, "base")
    cases: tuple[Case, ...] = setting(ListOf(Case), tuple, "cases")
    variants: tuple[Variant, ...] = setting(ListOf(Variant), tuple, "variants")
    factors: tuple[Factor, ...] = setting(ListOf(Factor), tuple, "factors")
    sampling: SamplingConfig | None = setting(
        Maybe(TableOf(SamplingConfig)), None, "sampling"
    )
    stopping: StoppingConfig | None = setting(
        Maybe(TableOf(StoppingConfig)), None, "stopping"
    )

    def __post_init__(self) -> None:
        """Check the fields and that they fit together."""
        check_table(self)
        keys = [factor.key for factor in self.factors]
        for i, factor in enumerate(self.factors):
            where = f"factors.{i}.key"
            if not all(factor.key.split(".")) or factor.key == "seed":
                valid = "a dotted key as in ball.radius_m; seeds are set by `seeds`"
                raise ConfigError(where, factor.key, valid)
            if factor.key == "duration_s" and self.duration is not None:
                raise ConfigError("duration_s", self.duration, "nothing: a factor is")
        is_sampled = any(factor.is_sampled for factor in self.factors)
        if is_sampled != (self.sampling is not None):
            valid = "given if, and only if, a factor has a range"
            raise ConfigError("sampling", self._sampling_name(), valid)
        self._check_saltelli()
        if self.axis is not None and self.axis not in keys:
            valid = f"the key of a factor: {', '.join(keys) or 'there is none'}"
            raise ConfigError("axis", self.axis, valid)
        self._check_variants()
        self._check_cases()

    @property
    def base_values(self) -> dict[str, Any]:
        """Return the values of all runs by dotted key."""
        return dict(flatten_table(self.base))

    @property
    def expanded_cases(self) -> list[tuple[str, Case]]:
        """Return all cases, each with the dotted key of its table.

        A study without cases has one, made of its scenario; its key is empty. With
        variants, the first one has all cases, then the second one, and so on.
        """
        if not self.cases:
            return [
                ("", Case(name=self.name or "all", scenario=self.scenario or _STAND))
            ]
        cases = [
            (f"cases.{i}", case)
            for i, given in enumerate(self.cases)
            for case in given.expand()
        ]
        if not self.variants:
            return cases
        return [(w, case.vary(v)) for v in self.variants for w, case in cases]

    def _check_saltelli(self) -> None:
        """Check that a design for Sobol indices has nothing but ranges."""
        if self.sampling is None or self.sampling.method != SALTELLI:
            return
        is_pure = all(factor.is_sampled for factor in self.factors)
        if not is_pure or len(self.factors) < 2 or self.cases:
            valid = "another one unless two factors or more, all with ranges, no cases"
            raise ConfigError("sampling.method", SALTELLI, valid)

    def _check_cases(self) -> None:
        """Check that the cases differ and fit the factors."""
        if self.cases and self.scenario is not None:
            valid = "nothing: each case has a scenario of its own"
            raise ConfigError("scenario", self.scenario, valid)
        factors = {factor.key: factor for factor in self.factors}
        gridded = {k: f.levels for k, f in factors.items() if not f.is_sampled}
        for i, case in enumerate(self.cases):
            if "duration_s" in factors and case.duration is not None:
                valid = "nothing: a factor is"
                raise ConfigError(f"cases.{i}.duration_s", case.duration, valid)
            for key, values in case.only.items():
                where = f"cases.{i}.only.{key}"
                if key not in gridded:
                    known = ", ".join(gridded) or "there is none"
                    valid = f"the key of a factor with single values: {known}"
                    raise ConfigError(where, list(values), valid)
                for value in values:
                    if value not in gridded[key]:
                        levels = ", ".join(map(repr, gridded[key]))
                        raise ConfigError(where, value, f"some of {levels}")
        names: set[str] = set()
        for where, case in self.expanded_cases:
            if case.name in names:
                valid = "a name that no other case has"
                raise ConfigError(f"{where}.name", case.name, valid)
            names.add(case.name)

    def _check_variants(self) -> None:
        """Check that variants differ, and set what no case sets."""
        if self.variants and not self.cases:
            valid = "nothing: variants are of cases, and there are none"
            raise ConfigError("variants", [v.name for v in self.variants], valid)
        names: set[str] = set()
        taken = {
            key: f"cases.{i}"
            for i, case in enumerate(self.cases)
            for key in (*case.base_values, *case.each)
        }
        for i, variant in enumerate(self.variants):
            where = f"variants.{i}"
            if variant.name in names:
                valid = "a name that no other variant has"
                raise ConfigError(f"{where}.name", variant.name, valid)
            names.add(variant.name)
            for key, value in variant.base_values.items():
                if key in taken:
                    valid = f"nothing: {taken[key]} sets it"
                    raise ConfigError(f"{where}.base.{key}", value, valid)

    def _sampling_name(self) -> str | None:
        return None if self.sampling is None else self.sampling.method


def read_study(file: Path) -> tuple[Study, str]:
    """Read the definition of a study.

    Args:
        file: The TOML file.

    Returns:
        The study, its name filled in, and the text of the file.

    Raises:
        ConfigError: The file cannot be read, or something in it is not valid.
    """
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        valid = f"a readable TOML file ({getattr(error, 'strerror', None) or error})"
        raise ConfigError("STUDY", str(file), valid, "command line") from None
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError("TOML", str(error), "a TOML document", file) from None
    table.setdefault("name", file.stem)
    try:
        return read_table(Study, table), text
    except ConfigError as error:
        raise ConfigError(error.key, error.value, error.valid, file) from None
