"""``ballsim bench``: all measurements in one report."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ballsim.bench.headline import measure_ball, measure_overhead
from ballsim.bench.log_cost import measure_log
from ballsim.bench.machine import count_cores, describe_machine, read_load
from ballsim.bench.parts import check_parts, measure_parts
from ballsim.bench.scaling import choose_counts, measure_scaling
from ballsim.bench.startup import measure_startup
from ballsim.config import Config
from ballsim.config_io import load_config
from ballsim.errors import ConfigError, MissingDependencyError
from ballsim.preparation import prepare

__all__ = ["BenchOptions", "load_configs", "run_bench"]

_RADII = ("0.25", "0.5", "0.75", "1.0")  # the paper's balls, [m]
_PARTS_RADIUS = 0.5  # of these the one whose parts are shown, [m]
_DEFAULT = ("roll-to", ("target_angle=4",))
_DURATION, _QUICK_DURATION = "8", "1"  # [s]
_REPEATS, _QUICK_REPEATS = 3, 1
_LOG_DURATION, _QUICK_LOG_DURATION = 60.0, 2.0  # [s]
_LENGTHS, _QUICK_LENGTHS = (60.0, 600.0), (2.0, 4.0)  # for the memory, [s]
_MEMORY = "ballsim.bench.memory"


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """What is measured.

    Attributes:
        scenario: Name or TOML file, ``roll-to`` with a target of 4 rad if None.
        radii: Radii of the balls as typed, the paper's four if empty, [m].
        duration: Simulated time of each run as typed, or None for the default, [s].
        overrides: Texts ``key=value``.
        repeats: Repeats of each measurement as typed, or None for the default.
        workers: Most processes as typed, or None for all cores.
        is_quick: True for a short look: one repeat of a second, no scaling.
        has_memory: True to measure the memory against the length of a run.
        has_batch: True to assess MuJoCo's batched stepping.
    """

    scenario: str | None = None
    radii: tuple[str, ...] = ()
    duration: str | None = None
    overrides: tuple[str, ...] = ()
    repeats: str | None = None
    workers: str | None = None
    is_quick: bool = False
    has_memory: bool = False
    has_batch: bool = False


def run_bench(options: BenchOptions, notify: Callable[[str], None]) -> dict[str, Any]:
    """Measure everything that was asked for.

    All inputs are checked before the first measurement.

    Args:
        options: What is measured.
        notify: Called with a few words before each measurement.

    Returns:
        The report, as ``--json`` shows it; None for what was not measured.

    Raises:
        ConfigError: An option or a value of the configuration is not valid.
        BallsimError: Something that is to be timed does not exist.
        MissingDependencyError: The measurement of memory is not there.
        ReplayMismatchError: Bare physics do not repeat a run bit for bit.
    """
    default = _QUICK_REPEATS if options.is_quick else _REPEATS
    repeats = _read_count("--repeats", options.repeats, default)
    few = (repeats + 1) // 2  # of what takes long and varies little
    workers = _read_count("--workers", options.workers, count_cores())
    configs = load_configs(options)
    measure_memory = _find_memory() if options.has_memory else None
    first = min(configs, key=lambda c: abs(c.ball.radius - _PARTS_RADIUS))
    check_parts(prepare(first))
    machine = {**describe_machine(), "load_before": read_load()}
    balls = []
    for config in configs:
        notify(f"closed loop and bare physics, ball of {config.ball.radius:g} m")
        balls.append(measure_ball(config, repeats))
    notify("parts of a tick")
    parts = measure_parts(first, few)
    notify("what the log costs")
    duration = _QUICK_LOG_DURATION if options.is_quick else _LOG_DURATION
    log = measure_log(first, duration, few)
    notify("what a run costs besides its loop")
    overhead = measure_overhead(first, few)
    notify("start-up")
    startup = measure_startup(few)
    scaling = batch = memory = None
    if not options.is_quick:
        notify("processes")
        scaling = measure_scaling(first, choose_counts(workers), few)
    if options.has_batch:
        from ballsim.bench.batch import measure_batch  # noqa: PLC0415 - rarely used

        notify("batched stepping")
        batch = measure_batch(first, choose_counts(workers)[:2], few)
    if measure_memory is not None:
        notify("memory")
        memory = measure_memory(_QUICK_LENGTHS if options.is_quick else _LENGTHS)
    return {
        "machine": {**machine, "load_after": read_load()},
        "settings": {
            "scenario": first.scenario,
            "overrides": list(_overrides(options)),
            "controller": first.controller.name,
            "sensors": first.sensors.preset,
            "duration": first.duration,
            "control_period": first.simulation.control_period,
            "physics_steps_per_tick": first.n_substeps,
            "repeats": repeats,
        },
        "balls": balls,
        "parts": parts,
        "log": log,
        "overhead_ms": overhead,
        "startup_s": startup,
        "scaling": scaling,
        "batch": batch,
        "memory": memory,
    }


def _overrides(options: BenchOptions) -> tuple[str, ...]:
    """Return the overrides, those of the default scenario included."""
    return (*(() if options.scenario else _DEFAULT[1]), *options.overrides)


def load_configs(options: BenchOptions) -> list[Config]:
    """Return the configuration for each ball, checked as far as a run is.

    Args:
        options: What is measured.

    Raises:
        ConfigError: A value is not valid.
    """
    duration = options.duration or (_QUICK_DURATION if options.is_quick else _DURATION)
    configs = []
    for radius in options.radii or _RADII:
        given = [f"ball.radius_m={radius}", f"duration_s={duration}"]
        # What is given on the command line beats what we add.
        overrides = [*given, *_overrides(options)]
        loaded = load_config(options.scenario or _DEFAULT[0], overrides)
        delay = loaded.config.drives.delay
        try:
            if delay > 0.0:  # bare mj_step gets each set-point when it is sent
                raise ConfigError("drives.delay_s", delay, "0 in a benchmark")
            prepare(loaded.config)
        except ConfigError as error:
            raise loaded.source.locate(error) from None
        configs.append(loaded.config)
    return configs


def _read_count(option: str, text: str | None, default: int) -> int:
    """Return a whole number of at least one."""
    if text is None:
        return default
    try:
        count = int(text)
    except ValueError:
        count = 0
    if count < 1:
        raise ConfigError(option, text, "a whole number of at least 1", "command line")
    return count


def _find_memory() -> Callable[[Sequence[float]], list[dict[str, Any]]]:
    """Return what runs some durations, [s], with their log, and gives rows."""
    if importlib.util.find_spec(_MEMORY) is None:
        raise MissingDependencyError("ballsim bench --memory", f"module {_MEMORY}")
    module = importlib.import_module(_MEMORY)

    def measure(durations: Sequence[float]) -> list[dict[str, Any]]:
        return [asdict(use) for use in module.measure_memory(durations, is_logged=True)]

    return measure
