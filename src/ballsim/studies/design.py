"""The cells of a study: every combination of values, as a checked configuration."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from ballsim.config import Config
from ballsim.config_io import format_config, load_config
from ballsim.errors import ConfigError
from ballsim.studies.cases import Case
from ballsim.studies.definition import Study, read_study
from ballsim.studies.factors import Factor, Value, flatten_table, is_number
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
        case: Number of its case, from 0.
    """

    index: int
    values: Mapping[str, Value]
    config: Config
    case: int = 0


@dataclass(frozen=True, slots=True)
class Plan:
    """A study whose cells are built and checked.

    Attributes:
        study: The definition.
        file: Its file.
        text: What stands in the file.
        cases: The cases, those of lists written out; one if the study has none.
        bases: Configuration of all runs of each case, without the factors.
        cells: The cells.
        digest: SHA-256 of all that the rows depend on: whatever else changes in
            the file, such as a description, leaves the study the same.
    """

    study: Study
    file: Path
    text: str
    cases: tuple[Case, ...]
    bases: tuple[Config, ...]
    cells: tuple[Cell, ...]
    digest: str

    @property
    def name(self) -> str:
        """Return the name of the study."""
        return self.study.name or self.file.stem

    @property
    def n_runs(self) -> int:
        """Return the number of runs, the largest possible with a stopping rule."""
        return sum(len(self.seeds_of(cell)) for cell in self.cells)

    @property
    def variants(self) -> list[tuple[str, range]]:
        """Return the name of each variant and the numbers of its cases."""
        names = [variant.name for variant in self.study.variants]
        n_each = len(self.cases) // max(len(names), 1)
        return [(n, range(i * n_each, (i + 1) * n_each)) for i, n in enumerate(names)]

    def seeds_of(self, cell: Cell) -> tuple[int, ...]:
        """Return the seeds of a cell, all that a stopping rule may take."""
        return self.cases[cell.case].seeds or self.study.seeds


def load_plan(file: Path) -> Plan:
    """Read a study and build the configuration of every cell.

    Args:
        file: The TOML file.

    Raises:
        ConfigError: Something in the file is not valid.
    """
    study, text = read_study(file)
    cases, bases, cells = list[Case](), list[Config](), list[Cell]()
    n_runs = 0
    for where, case in study.expanded_cases:
        name = case.name if study.cases else None
        scenario = _find_scenario(case.scenario, file)
        try:
            values = _base_values(study, case, scenario)
            base = _load(scenario, values)
        except ConfigError as error:
            if error.key == "SCENARIO":
                key = f"{where}.scenario" if where else "scenario"
                error = ConfigError(key, error.value, error.valid, error.file)
            raise locate(error, file, name) from None
        _check_keys(study, case, where, base, file)
        n_runs += _count_cells(study, case) * len(case.seeds or study.seeds)
        if n_runs > _MAX_RUNS:
            raise ConfigError("seeds", n_runs, f"at most {_MAX_RUNS} runs in all", file)
        for own in _combinations(study, case):
            try:
                config = _load(scenario, {**values, **own})
            except ConfigError as error:
                raise locate(error, file, name) from None
            cells.append(Cell(len(cells), own, config, len(cases)))
        cases.append(case)
        bases.append(base)
    digest = _digest(study, cases, cells)
    return Plan(study, file, text, tuple(cases), tuple(bases), tuple(cells), digest)


def extreme_cells(plan: Plan) -> list[Cell]:
    """Return cells that hold the extremes of every factor, in each case.

    These are the first and the last cell, for each numeric factor a cell with its
    least and one with its greatest value, and one for each value of another factor.
    """
    chosen: dict[int, Cell] = {}
    for _, group in itertools.groupby(plan.cells, key=lambda cell: cell.case):
        cells = list(group)
        chosen |= {cell.index: cell for cell in (cells[0], cells[-1])}
        for factor in plan.study.factors:
            first: dict[Value, Cell] = {}
            for cell in cells:
                first.setdefault(cell.values[factor.key], cell)
            wanted = set(first)
            if all(is_number(value) for value in wanted):
                wanted = {min(wanted), max(wanted)}
            chosen |= {cell.index: cell for v, cell in first.items() if v in wanted}
    return [chosen[index] for index in sorted(chosen)]


def locate(error: ConfigError, file: Path, case: str | None = None) -> ConfigError:
    """Return an error of a configuration with the study as its file.

    Args:
        error: The error.
        file: File of the study.
        case: Name of the case, if the study has several.
    """
    place = file if error.file is None or error.file in _PLACES else error.file
    valid = error.valid if case is None else f"{error.valid} (case {case!r})"
    return ConfigError(error.key, error.value, valid, place)


def _find_scenario(scenario: str, file: Path) -> str | Path:
    """Return a file beside the study's, if there is one, else the name itself."""
    beside = file.parent / scenario
    return beside if scenario.endswith(".toml") and beside.is_file() else scenario


def _base_values(study: Study, case: Case, scenario: str | Path) -> dict[str, Any]:
    """Return the values of all runs of a case; its own win over the study's."""
    values = study.base_values
    own = case.base_values
    if own:
        names = _load(scenario, {}).parameters
        taken = {names.get(key, key) for key in own}
        values = {k: v for k, v in values.items() if names.get(k, k) not in taken}
    if study.duration is not None:
        values["duration_s"] = study.duration
    values |= own
    if case.duration is not None:
        values["duration_s"] = case.duration
    return values


def _check_keys(study: Study, case: Case, where: str, base: Config, file: Path) -> None:
    """Check that no key is set twice, be it by a short name of the scenario."""
    used: dict[str, str] = {}
    for table, values in (("base", study.base), (f"{where}.base", case.base)):
        own: dict[str, str] = {}
        for key, _ in flatten_table(values):
            name = base.parameters.get(key, key)
            if name == "seed":
                raise ConfigError(f"{table}.{key}", base.seed, "set by `seeds`", file)
            if name in own:
                valid = f"a key that is set once, not by {own[name]} too"
                raise ConfigError(f"{table}.{key}", key, valid, file)
            own[name] = key
        used |= own
    for i, factor in enumerate(study.factors):
        name = base.parameters.get(factor.key, factor.key)
        if name in used:
            valid = f"a key that is set once, not by {used[name]} too"
            error = ConfigError(f"factors.{i}.key", factor.key, valid)
            raise locate(error, file, case.name if where else None)
        used[name] = factor.key


def _load(scenario: str | Path, values: Mapping[str, Any]) -> Config:
    texts = [
        f"{key}={tomli_w.dumps({'value': value}).partition('=')[2].strip()}"
        for key, value in values.items()
    ]
    return load_config(scenario, texts).config


def _levels(factor: Factor, case: Case) -> tuple[Value, ...]:
    """Return the values of a grid that a case takes, in the order of the grid."""
    chosen = case.only.get(factor.key, factor.levels)
    return tuple(level for level in factor.levels if level in chosen)


def _count_cells(study: Study, case: Case) -> int:
    n_sampled = sum(factor.is_sampled for factor in study.factors)
    count = study.sampling.count_points(n_sampled) if study.sampling else 1
    for factor in study.factors:
        count *= 1 if factor.is_sampled else len(_levels(factor, case))
    return count


def _combinations(study: Study, case: Case) -> Iterator[dict[str, Value]]:
    """Yield the values of each cell of a case, keys in the order of the factors."""
    keys = [factor.key for factor in study.factors]
    gridded = [factor for factor in study.factors if not factor.is_sampled]
    sampled = [factor for factor in study.factors if factor.is_sampled]
    points: list[list[float]] = [[]]
    if study.sampling is not None:
        points = design_points(study.sampling, len(sampled))
    for levels in itertools.product(*(_levels(factor, case) for factor in gridded)):
        fixed = dict(zip((f.key for f in gridded), levels, strict=True))
        for point in points:
            drawn = {f.key: f.place(p) for f, p in zip(sampled, point, strict=True)}
            values = {**fixed, **drawn}
            yield {key: values[key] for key in keys}


def _digest(study: Study, cases: Sequence[Case], cells: Sequence[Cell]) -> str:
    """Return the digest of all that rows depend on; limits are not."""
    content: dict[str, Any] = {
        "seeds": study.seeds,
        "stopping": dataclasses.asdict(study.stopping) if study.stopping else None,
        "recordings": study.keep_recordings,
        "factors": [list(cell.values.items()) for cell in cells],
    }
    if study.cases:
        content["cases"] = [cases[cell.case].name for cell in cells]
    if any(case.seeds for case in cases):
        content["case_seeds"] = [cases[cell.case].seeds for cell in cells]
    digest = hashlib.sha256(json.dumps(content).encode())
    for cell in cells:
        digest.update(format_config(cell.config).encode())
    return digest.hexdigest()
