"""Are the errors of the state estimate what the sensors' figures say? NEES and NIS.

``python -m ballsim.consistency`` runs a scenario with some seeds, compares the estimate
with the truth, and prints for each quantity the rms error beside the prediction of
`ballsim.error_model`, and the normalised square beside its chi-square band. What the
model behind the estimator adds is the error of an estimator that gets perfect readings
of the same motion.

The exit code is 0 if all quantities are inside, 4 if one is outside, 3 if a robot fell,
2 for bad input.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from ballsim.config import Config
from ballsim.config_io import LoadedConfig, load_config
from ballsim.error_model.error_recorder import ErrorRecorder
from ballsim.error_model.normalised import CHECKED, Consistency, check_consistency
from ballsim.error_model.sigmas import ErrorPrediction, find_support, predict_errors
from ballsim.errors import ConfigError
from ballsim.module_parser import ModuleParser, list_overrides
from ballsim.preparation import prepare
from ballsim.sensor_config import SENSORS
from ballsim.simulation import simulate
from ballsim_controllers.messages import Array

__all__ = ["FallenError", "check_runs", "main"]

_SPACING = 0.1  # between the instants that are compared, [s]


class FallenError(Exception):
    """A robot fell, so that there is nothing to compare."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the check; see the module.

    Args:
        arguments: Words of the command line, those of the process if None.
    """
    parser = ModuleParser("consistency", __doc__)
    parser.add_world("with noise in all sensors")
    parser.add_seeds()
    add = parser.add_argument
    add("--scenario", default="stand", metavar="SCENARIO", help="name or TOML file")
    add("--duration", type=float, default=30.0, metavar="T", help="[s]")
    add(
        "--start",
        type=float,
        default=10.0,
        metavar="T",
        help="compare from then on [s]",
    )
    options = parser.parse_args(arguments)
    given = [f"duration_s={options.duration}", *list_overrides(options)]
    try:
        if not 0.0 <= options.start < options.duration:
            valid = f"from 0 to less than the duration, {options.duration:g}"
            raise ConfigError("--start", options.start, valid, "command line")
        seeds = range(max(1, options.seeds))
        rows = check_runs(options.scenario, given, seeds, options.start)
    except ConfigError as error:
        parser.complain(error)
        return 2
    except FallenError as error:
        parser.complain(error)
        return 3
    if options.json:
        print(json.dumps([dataclasses.asdict(row) for row in rows], indent=2))
    else:
        _print_table(rows)
    return 0 if all(row.is_inside for row in rows) else 4


def check_runs(
    scenario: str, overrides: Sequence[str], seeds: Sequence[int], start: float
) -> list[Consistency]:
    """Run a scenario with some seeds and compare all quantities.

    Args:
        scenario: Name of a scenario or a TOML file.
        overrides: Texts ``key=value``.
        seeds: The seeds.
        start: Time from which on errors are compared, [s].

    Raises:
        ConfigError: The input is not valid, or a sensor has no noise at all.
        FallenError: A robot fell.
    """
    config = load_config(scenario, overrides).config
    period = config.simulation.control_period
    step = max(1, round(_SPACING / period))
    ticks = range(config.count_ticks(start), config.n_ticks, step)
    prediction = predict_errors(config)
    sensors = config.sensors
    noises = [
        sensors.find_level(name) * getattr(sensors, name).sample_std(period)
        for name in SENSORS
    ]
    if not all(noise > 0.0 for noise in noises):
        valid = "a preset with noise in all sensors"
        raise ConfigError("sensors.preset", config.sensors.preset, valid)
    runs = [
        _run(load_config(scenario, [*overrides, f"seed={seed}"]), ticks)
        for seed in seeds
    ]
    errors, model_errors, predictions = zip(*runs, strict=True)
    rows = []
    for name, d in CHECKED.items():
        first = prediction.find_columns(name).start
        columns = slice(first, first + d)
        part = np.concatenate(model_errors)[:, columns]
        model = part.T @ part / len(part)
        own = np.array(errors)[:, :, columns]
        rows.append(check_consistency(name, own, ticks, predictions, model))
    return rows


def _run(loaded: LoadedConfig, ticks: range) -> tuple[Array, Array, ErrorPrediction]:
    """Return errors and innovations at some ticks of a run, and two parts of them.

    The second are those of the model behind the estimator, the third what the sensors'
    figures predict for feet that bear the robot when those of the run do.

    Raises:
        ConfigError: The configuration is not valid.
        FallenError: The robot fell.
    """
    try:
        prepared = prepare(loaded.config)
    except ConfigError as error:
        raise loaded.source.locate(error) from None
    recorder = ErrorRecorder(prepared)
    outcome = simulate(recorder.prepared, [recorder])
    if not outcome.is_upright:
        config: Config = loaded.config
        text = f"{config.scenario} with seed {config.seed}: {outcome.fall_reason}"
        raise FallenError(f"{text} at {outcome.simulated_time:.2f} s")
    rows, chosen = recorder.rows, list(ticks)
    support = find_support(recorder.loads, loaded.config.simulation.control_period)
    prediction = predict_errors(loaded.config, support)
    return rows[chosen], recorder.model_rows[chosen], prediction


def _print_table(rows: Sequence[Consistency]) -> None:
    table = Table(box=None, pad_edge=False)
    heads = ("rms", "sensors", "model", "square", "band", "instants", "")
    table.add_column("quantity")
    for head in heads:
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(
            row.name,
            *(f"{value:.2e}" for value in (row.rms, row.sensors, row.model)),
            f"{row.square:.2f}",
            f"{row.band[0]:.2f} - {row.band[1]:.2f}",
            f"{row.n_independent:.1f}",
            "" if row.is_inside else "outside",
        )
    Console(highlight=False, width=120).print(table)


if __name__ == "__main__":
    sys.exit(main())
