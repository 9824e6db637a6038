"""The cells of a study: every combination of values, as a checked configuration."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from ballsim.config import Config
from ballsim.config_io import format_config, load_config
from ballsim.errors import ConfigError
from ballsim.studies.definition import Study, read_study
from ballsim.studies.factors import Value, is_number
from ballsim.studies.sampling import design_points

__all__ = ["Cell", "Plan", "extreme_cells", "load_plan", "locate"]

_MAX_RUNS = 10_000_000
_PLACES = ("command line", "default value")  # where `load_config` sees our values


@dataclass(frozen=True, slots=True)
class Cell:
    """One combination of values; its runs differ in their seeds.

    Attributes:
        index: Number of the cell, from 0.
        values: Value of each factor, by key.
        config: The configuration, with a seed that does not matter.
    """

    index: int
    values: Mapping[str, Value]
    config: Config


@dataclass(frozen=True, slots=True)
class Plan:
    """A study whose cells are built and checked.

    Attributes:
        study: The definition.
        file: Its file.
        text: What stands in the file.
        base: Configuration of all runs, without the factors.
        cells: The cells.
        digest: SHA-256 of all that the rows depend on: whatever else changes in
            the file, such as a description, leaves the study the same.
    """

    study: Study
    file: Path
    text: str
    base: Config
    cells: tuple[Cell, ...]
    digest: str

    @property
    def name(self) -> str:
        """Return the name of the study."""
        return self.study.name or self.file.stem

    @property
    def n_runs(self) -> int:
        """Return the number of runs, the largest possible with a stopping rule."""
        return len(self.cells) * len(self.study.seeds)


def load_plan(file: Path) -> Plan:
    """Read a study and build the configuration of every cell.

    Args:
        file: The TOML file.

    Raises:
        ConfigError: Something in the file is not valid.
    """
    study, text = read_study(file)
    scenario = _find_scenario(study.scenario, file)
    base_values = dict(study.base_values)
    if study.duration is not None:
        base_values["duration_s"] = study.duration
    base = _load(scenario, base_values, file)
    _check_keys(study, base, file)
    n_runs = _count_cells(study) * len(study.seeds)
    if n_runs > _MAX_RUNS:
        raise ConfigError("seeds", n_runs, f"at most {_MAX_RUNS} runs in all", file)
    cells = tuple(
        Cell(i, values, _load(scenario, {**base_values, **values}, file))
        for i, values in enumerate(_combinations(study))
    )
    return Plan(study, file, text, base, cells, _digest(study, cells))


def extreme_cells(plan: Plan) -> list[Cell]:
    """Return cells that hold the extremes of every factor.

    These are the first and the last cell, for each numeric factor a cell with its
    least and one with its greatest value, and one for each value of another factor.
    """
    chosen = {0: plan.cells[0], len(plan.cells) - 1: plan.cells[-1]}
    for factor in plan.study.factors:
        first: dict[Value, Cell] = {}
        for cell in plan.cells:
            first.setdefault(cell.values[factor.key], cell)
        wanted = set(first)
        if all(is_number(value) for value in wanted):
            wanted = {min(wanted), max(wanted)}
        chosen |= {cell.index: cell for v, cell in first.items() if v in wanted}
    return [chosen[index] for index in sorted(chosen)]


def locate(error: ConfigError, file: Path) -> ConfigError:
    """Return an error of a configuration with the study as its file.

    Args:
        error: The error.
        file: File of the study.
    """
    if error.file is not None and error.file not in _PLACES:
        return error
    return ConfigError(error.key, error.value, error.valid, file)


def _find_scenario(scenario: str, file: Path) -> str | Path:
    """Return a file beside the study's, if there is one, else the name itself."""
    beside = file.parent / scenario
    return beside if scenario.endswith(".toml") and beside.is_file() else scenario


def _check_keys(study: Study, base: Config, file: Path) -> None:
    """Check that no key is set twice, be it by a short name of the scenario."""
    used = {base.parameters.get(key, key): key for key in study.base_values}
    if "seed" in used:
        raise ConfigError(f"base.{used['seed']}", base.seed, "set by `seeds`", file)
    for i, factor in enumerate(study.factors):
        key = base.parameters.get(factor.key, factor.key)
        if key in used:
            valid = f"a key that is set once, not by {used[key]} too"
            raise ConfigError(f"factors.{i}.key", factor.key, valid, file)
        used[key] = factor.key


def _load(scenario: str | Path, values: Mapping[str, Any], file: Path) -> Config:
    texts = [
        f"{key}={tomli_w.dumps({'value': value}).partition('=')[2].strip()}"
        for key, value in values.items()
    ]
    try:
        return load_config(scenario, texts).config
    except ConfigError as error:
        key = "scenario" if error.key == "SCENARIO" else error.key
        raise locate(
            ConfigError(key, error.value, error.valid, error.file), file
        ) from None


def _count_cells(study: Study) -> int:
    count = study.sampling.count if study.sampling else 1
    for factor in study.factors:
        count *= 1 if factor.is_sampled else len(factor.levels)
    return count


def _combinations(study: Study) -> Iterator[dict[str, Value]]:
    """Yield the values of each cell, keys in the order of the factors."""
    keys = [factor.key for factor in study.factors]
    gridded = [factor for factor in study.factors if not factor.is_sampled]
    sampled = [factor for factor in study.factors if factor.is_sampled]
    points: list[list[float]] = [[]]
    if study.sampling is not None:
        points = design_points(study.sampling, len(sampled))
    for levels in itertools.product(*(factor.levels for factor in gridded)):
        fixed = dict(zip((f.key for f in gridded), levels, strict=True))
        for point in points:
            drawn = {f.key: f.place(p) for f, p in zip(sampled, point, strict=True)}
            values = {**fixed, **drawn}
            yield {key: values[key] for key in keys}


def _digest(study: Study, cells: tuple[Cell, ...]) -> str:
    """Return the digest of all that rows depend on."""
    content = {
        "seeds": study.seeds,
        "stopping": dataclasses.asdict(study.stopping) if study.stopping else None,
        "recordings": study.keep_recordings,
        "factors": [list(cell.values.items()) for cell in cells],
    }
    digest = hashlib.sha256(json.dumps(content).encode())
    for cell in cells:
        digest.update(format_config(cell.config).encode())
    return digest.hexdigest()
