"""How the throughput of a study grows with the number of its processes."""

from __future__ import annotations

import dataclasses
import math
import multiprocessing
import time
from collections.abc import Sequence
from multiprocessing.synchronize import Barrier

from ballsim.config import Config
from ballsim.errors import ReplayMismatchError
from ballsim.metrics import summarise
from ballsim.preparation import prepare
from ballsim.simulation import run_prepared

__all__ = ["choose_counts", "measure_scaling", "tabulate_scaling"]

_RUNS_PER_WORKER = 4
_START_TIMEOUT = 300.0  # for all workers to be warm, [s]
_WARM_UP = 0.5  # simulated time of a worker's first run, [s]


def choose_counts(n_workers: int) -> tuple[int, ...]:
    """Return the numbers of processes to try: 1, 2 and all.

    Args:
        n_workers: Most processes, at least one.

    Examples:
        >>> choose_counts(8)
        (1, 2, 8)
    """
    return tuple(sorted(n for n in {1, 2, n_workers} if n <= n_workers))


def measure_scaling(
    config: Config, counts: Sequence[int], repeats: int
) -> list[dict[str, float]]:
    """Return throughput and efficiency for several numbers of processes.

    Each worker gets as many runs as any other, the same seeds over and over, one at
    a time as in a study: prepared, run and summarised. Starting the processes and
    a first short run in each are not counted.

    Args:
        config: The run; its seed is replaced.
        counts: Numbers of processes, the first of them to compare with.
        repeats: How often, the quickest counts.

    Returns:
        The rows, see `tabulate_scaling`.

    Raises:
        ReplayMismatchError: A run's trajectory depended on the number of processes.
    """
    walls = dict.fromkeys(counts, math.inf)
    simulated = dict.fromkeys(counts, 0.0)
    digests = set()
    for count in [*counts] * repeats:
        configs = [
            dataclasses.replace(config, seed=seed)
            for _ in range(count)
            for seed in range(_RUNS_PER_WORKER)
        ]
        wall, runs = _run_batch(configs, count)
        walls[count] = min(wall, walls[count])
        simulated[count] = sum(time for _, time, _ in runs)
        digests |= {(seed, digest) for seed, _, digest in runs}
    if len(digests) != _RUNS_PER_WORKER:
        raise ReplayMismatchError(["runs depend on the number of processes"])
    return tabulate_scaling(counts, [*walls.values()], [*simulated.values()])


def tabulate_scaling(
    counts: Sequence[int], walls: Sequence[float], simulated: Sequence[float]
) -> list[dict[str, float]]:
    """Return a row for each number of processes.

    Args:
        counts: Numbers of processes.
        walls: Wall time of each batch, [s].
        simulated: Simulated time of each batch, [s].

    Returns:
        Rows with ``workers``, ``throughput`` (simulated over wall time) and
        ``efficiency`` (throughput per process over that of the first row).
    """
    rates = [sim / wall for sim, wall in zip(simulated, walls, strict=True)]
    return [
        {
            "workers": count,
            "throughput": rate,
            "efficiency": rate / count / (rates[0] / counts[0]),
        }
        for count, rate in zip(counts, rates, strict=True)
    ]


def _run_batch(
    configs: Sequence[Config], n_workers: int
) -> tuple[float, list[tuple[int, float, str]]]:
    """Return the wall time, [s], and what `_run_one` gave for each run."""
    context = multiprocessing.get_context("spawn")
    are_warm = context.Barrier(n_workers + 1)
    arguments = (are_warm, configs[0])
    with context.Pool(n_workers, initializer=_warm_up, initargs=arguments) as pool:
        are_warm.wait(_START_TIMEOUT)
        start = time.perf_counter()
        runs = list(pool.imap_unordered(_run_one, configs))
        return time.perf_counter() - start, runs


def _warm_up(are_warm: Barrier, config: Config) -> None:
    """Import and compile everything in a worker, then wait for the others."""
    _run_one(dataclasses.replace(config, duration=min(_WARM_UP, config.duration)))
    are_warm.wait(_START_TIMEOUT)


def _run_one(config: Config) -> tuple[int, float, str]:
    """Return seed, simulated time, [s], and digest of a run."""
    summary = summarise(run_prepared(prepare(config)), "ballsim bench")
    return summary["seed"], summary["simulated_time"], summary["trajectory_sha256"]
