"""How long the command line takes to start, in processes of its own."""

from __future__ import annotations

import os
import runpy
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ballsim.errors import BallsimError

__all__ = ["measure_startup", "report_first_step"]

_N_HELP = 5
_MARK = "first step at "
_PROBE = "from ballsim.bench.startup import report_first_step; report_first_step()"


def measure_startup(repeats: int) -> dict[str, dict[str, float]]:
    """Return start-up times from the spawn of the process on, [s].

    Args:
        repeats: How often ``ballsim run stand`` is started, at least one.

    Returns:
        ``help``: until ``ballsim --help`` has ended. ``first_step``: until
        ``ballsim run stand`` first calls its controller; ``first_step_no_log``
        without the recording; ``first_step_empty_cache`` once, with neither gains
        nor compiled code on disk. Each with the best and the median.
    """
    help_words = [sys.executable, "-m", "ballsim", "--help"]
    with TemporaryDirectory() as cache:
        empty = {**os.environ, "XDG_CACHE_HOME": cache, "NUMBA_CACHE_DIR": cache}
        return {
            "help": _spread(lambda: _time_until_end(help_words), _N_HELP),
            "first_step": _spread(_time_first_step, repeats),
            "first_step_no_log": _spread(lambda: _time_first_step("--no-log"), repeats),
            "first_step_empty_cache": _spread(lambda: _time_first_step(env=empty), 1),
        }


def report_first_step() -> None:
    """Do as ``python -m ballsim`` does, and tell when the first step comes.

    The time at which the controller is first called goes to stderr. Production
    code is as it is: the controller's class is patched once it is built.
    """
    from ballsim import preparation  # noqa: PLC0415 - this is what is timed

    prepare = preparation.prepare

    def prepare_and_watch(*args: Any, **kwargs: Any) -> Any:
        prepared = prepare(*args, **kwargs)
        kind: Any = type(prepared.controller)
        step = kind.step

        def first_step(*args: Any) -> Any:
            print(f"{_MARK}{time.time():.6f}", file=sys.stderr)
            kind.step = step
            return step(*args)

        kind.step = first_step
        return prepared

    preparation.prepare = prepare_and_watch
    runpy.run_module("ballsim", run_name="__main__")


def _time_first_step(*words: str, env: Mapping[str, str] | None = None) -> float:
    """Return the time from the spawn of ``ballsim run`` to its first step, [s]."""
    with TemporaryDirectory() as folder:
        run = ["run", "stand", "--duration", "0.1", "--out", str(Path(folder) / "run")]
        start = time.time()
        done = subprocess.run(
            [sys.executable, "-c", _PROBE, *run, *words],
            capture_output=True,
            text=True,
            env=env,
            check=False,
        )
    for line in done.stderr.splitlines():
        if line.startswith(_MARK):
            return float(line.removeprefix(_MARK)) - start
    last = (done.stderr.strip().splitlines() or ["no output"])[-1]
    raise BallsimError(f"`ballsim run stand` came to no first step: {last}")


def _time_until_end(words: list[str]) -> float:
    start = time.perf_counter()
    subprocess.run(words, capture_output=True, check=True)
    return time.perf_counter() - start


def _spread(measure: Callable[[], float], repeats: int) -> dict[str, float]:
    times = [measure() for _ in range(repeats)]
    return {"best": min(times), "median": statistics.median(times)}
