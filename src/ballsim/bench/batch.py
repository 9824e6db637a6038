"""Could MuJoCo's batched stepping serve runs whose controller is Python?

A closed loop needs the state after every control tick. Compared are, per
simulation and tick: a plain loop over `mj_step`, `mujoco.batch.Batch` and
`mujoco.rollout`, each called once a tick for all simulations, with the inputs that
a run commanded. Whether a way ends in the very state of that run is told, too:
`mujoco.rollout` cannot, for it does not hand the contact solver's warm start from
one call to the next.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from mujoco.rollout import Rollout

from ballsim.config import Config
from ballsim.preparation import prepare
from ballsim.simulation import KeptRun, run_prepared
from ballsim_controllers.messages import Array

__all__ = ["SIM_COUNTS", "measure_batch"]

SIM_COUNTS = (1, 8, 32)
_MAX_TICKS = 250
# What the sensors, the log and the fall detector read, as far as it can be bound.
_OUTPUTS = ("sensordata", "actuator_force", "xpos", "subtree_com")
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS.value


def measure_batch(
    config: Config, threads: Sequence[int], repeats: int
) -> list[dict[str, Any]]:
    """Return the cost of a tick of one simulation, [us].

    Args:
        config: The run whose inputs are used, at most its first 250 ticks.
        threads: Numbers of threads.
        repeats: How often, the least counts.

    Returns:
        Rows with ``way``, ``threads``, ``sims``, ``us_per_sim_tick``, and
        ``is_identical``: whether all came to the last state of the run.
    """
    result = run_prepared(prepare(config))
    ways: list[tuple[str, int, Callable[[KeptRun, int, int], tuple[float, Array]]]]
    ways = [("loop", 1, _time_loop)]
    ways += [("Batch", n, _time_batch) for n in threads]
    ways += [("rollout", n, _time_rollout) for n in threads]
    n_ticks = min(_MAX_TICKS, result.series.n_ticks)
    rows = []
    for n_sims in SIM_COUNTS:
        walls: dict[tuple[str, int], list[float]] = {}
        is_identical: dict[tuple[str, int], bool] = {}
        for _ in range(repeats):
            for name, n_threads, measure in ways:
                gc.collect()
                wall, qpos = measure(result, n_sims, n_threads)
                walls.setdefault((name, n_threads), []).append(wall)
                same = bool((qpos == result.series.qpos[n_ticks]).all())
                is_identical[name, n_threads] = same
        rows += [
            {
                "way": name,
                "threads": n_threads,
                "sims": n_sims,
                "us_per_sim_tick": 1e6 * min(times) / n_ticks / n_sims,
                "is_identical": is_identical[name, n_threads],
            }
            for (name, n_threads), times in walls.items()
        ]
    return rows


def _time_loop(result: KeptRun, n_sims: int, _n_threads: int) -> tuple[float, Array]:
    """Return the wall time, [s], and the last states, shape (n_sims, nq)."""
    model, n = result.model, result.config.n_substeps
    sims = [_make_data(result) for _ in range(n_sims)]
    start = time.perf_counter()
    for ctrl in result.inputs[:_MAX_TICKS]:
        for data in sims:
            data.ctrl[:] = ctrl
            mujoco.mj_step(model, data, n)
    wall = time.perf_counter() - start
    return wall, np.array([data.qpos for data in sims])


def _time_batch(result: KeptRun, n_sims: int, n_threads: int) -> tuple[float, Array]:
    n = result.config.n_substeps
    batch = Batch(result.model, n_sims, n_threads)
    inputs, qpos = batch.bind("ctrl"), batch.bind("qpos")
    for name in _OUTPUTS:
        batch.bind(name)
    qpos[:] = result.series.qpos[0]
    batch.bind("qvel")[:] = result.series.qvel[0]
    start = time.perf_counter()
    for ctrl in result.inputs[:_MAX_TICKS]:
        inputs[:] = ctrl
        batch.step(nstep=n)
    return time.perf_counter() - start, np.array(qpos)


def _time_rollout(result: KeptRun, n_sims: int, n_threads: int) -> tuple[float, Array]:
    model, n = result.model, result.config.n_substeps
    scratch = [_make_data(result) for _ in range(n_threads)]
    first = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, scratch[0], first, _STATE)
    states = np.tile(first, (n_sims, 1))
    with Rollout(nthread=n_threads) as pool:
        start = time.perf_counter()
        for ctrl in result.inputs[:_MAX_TICKS]:
            steps, _ = pool.rollout(
                model,
                scratch,
                states,
                np.broadcast_to(ctrl, (n_sims, n, model.nu)),
            )
            states = np.ascontiguousarray(steps[:, -1])
        wall = time.perf_counter() - start
    return wall, states[:, 1 : 1 + model.nq]


def _make_data(result: KeptRun) -> Any:
    data = mujoco.MjData(result.model)
    data.qpos[:], data.qvel[:] = result.series.qpos[0], result.series.qvel[0]
    return data
