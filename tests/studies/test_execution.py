"""Execution: every run ends in the ledger, whatever its worker does."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from ballsim.config import Config
from ballsim.config_io import load_config
from ballsim.studies.execution import CRASHED, TIMEOUT, StudyError, execute
from ballsim.studies.executors import Backend, ProcessSlots, local_backend
from ballsim.studies.single_run import ERROR, FINISHED, Outcome, Task, run_chunk

# What workers do instead of simulating: a module of its own, which they import.
HELPERS = """
import os, time
from ballsim.studies.single_run import Outcome, run_chunk

def die_on_first(tasks, limit):
    # The run of cell 1 kills its worker when it is started for the first time.
    for task in tasks:
        mark = os.environ["BALLSIM_TEST_MARK"]
        if task.cell == 1 and not os.path.exists(mark):
            open(mark, "w").close()
            os._exit(1)
    return fake(tasks, limit)

def die_always(tasks, limit):
    if any(task.cell == 1 for task in tasks):
        os._exit(1)
    return fake(tasks, limit)

def die(tasks, limit):
    os._exit(1)

def fake(tasks, limit):
    summary = {"survived": True, "pid": os.getpid()}
    return [Outcome(t.cell, t.config.seed, "finished", summary) for t in tasks]
"""


@pytest.fixture
def helpers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    (tmp_path / "study_helpers.py").write_text(HELPERS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("BALLSIM_TEST_MARK", str(tmp_path / "mark"))
    import study_helpers

    return study_helpers


@pytest.fixture
def config() -> Config:
    return load_config("stand", ["duration_s=0.1"]).config


def _execute(tasks: list[Task], backend: Backend, **more: Any) -> dict[int, Outcome]:
    found: dict[int, Outcome] = {}

    def finish(outcome: Outcome) -> tuple[Task, ...]:
        assert outcome.cell not in found
        found[outcome.cell] = outcome
        return ()

    execute(tasks, backend, finish, **more)
    return found


@pytest.fixture
def here() -> Iterator[Backend]:
    """Threads of this process: the same interface without the cost."""
    with ThreadPoolExecutor(2) as executor:
        yield Backend(executor, 2, ())


def test_run_gives_its_summary_without_what_a_repeat_changes(config: Config) -> None:
    """Twice the same summary; clock, command and versions stand beside it."""
    task = Task(3, config)
    first, second = run_chunk([task, task], 60.0)
    assert first.status == FINISHED
    assert first.summary == second.summary
    left_out = {"wall_time", "realtime_factor", "versions", "command"}
    assert not left_out & set(first.summary)
    assert first.wall_time > 0.0
    assert first.provenance is not None
    assert "mujoco" in first.provenance


def test_exception_of_a_run_is_its_outcome(config: Config) -> None:
    """A run that raises is an outcome with the message; the next one is done."""
    bad = load_config("stand", ["duration_s=0.1", "controller.gait.lift=1"]).config
    first, second = run_chunk([Task(0, bad), Task(1, config)], 60.0)
    assert (first.status, second.status) == (ERROR, FINISHED)
    assert first.message is not None
    assert "controller.gait.lift" in first.message


def test_end_of_a_fall_is_recorded_on_demand() -> None:
    """The paper's controller falls: its recording is there, and only if asked for."""
    overrides = ["duration_s=2", "controller.name=paper"]
    fallen = load_config("stand", overrides).config
    plain, recorded = run_chunk([Task(0, fallen), Task(1, fallen, True)], 60.0)
    assert not plain.summary["survived"]
    assert plain.recording is None
    assert recorded.summary == plain.summary
    assert recorded.recording is not None
    assert recorded.recording.startswith(b"RRF")


def test_all_tasks_are_done_once(config: Config, here: Backend, helpers: Any) -> None:
    """Tasks that come up meanwhile are done, too."""
    found: list[int] = []

    def finish(outcome: Outcome) -> list[Task]:
        found.append(outcome.cell)
        return [Task(outcome.cell + 100, config)] if outcome.cell < 100 else []

    tasks = [Task(i, config) for i in range(50)]
    execute(tasks, here, finish, run=helpers.fake)
    assert sorted(found) == [*range(50), *range(100, 150)]


def test_worker_that_dies_costs_its_runs_one_retry(
    config: Config, helpers: Any
) -> None:
    """All runs have their result; those of the dead worker say that it was two."""
    tasks = [Task(i, config) for i in range(6)]
    with local_backend(2) as backend:
        found = _execute(tasks, backend, run=helpers.die_on_first)
    assert sorted(found) == list(range(6))
    assert {outcome.status for outcome in found.values()} == {FINISHED}
    assert found[1].attempts == 2
    assert found[0].attempts == 1


def test_run_that_kills_two_workers_is_given_up(config: Config, helpers: Any) -> None:
    """It is recorded as crashed, and all others are done."""
    tasks = [Task(i, config) for i in range(6)]
    with local_backend(1) as backend:
        found = _execute(tasks, backend, run=helpers.die_always)
    assert found.pop(1).status == CRASHED
    assert {outcome.status for outcome in found.values()} == {FINISHED}


def test_workers_that_never_live_end_the_study(config: Config, helpers: Any) -> None:
    """No outcome is invented where the machine is at fault."""
    tasks = [Task(i, config) for i in range(50)]
    with (
        local_backend(1) as backend,
        pytest.raises(StudyError, match="every worker was lost: the worker died"),
    ):
        execute(
            tasks, backend, lambda outcome: pytest.fail(str(outcome)), run=helpers.die
        )


def test_run_beyond_its_time_limit_is_given_up() -> None:
    """An hour of simulation with a limit of 0.3 s: twice ended, then recorded."""
    long = load_config("stand", ["duration_s=3600"]).config
    start = time.monotonic()
    with local_backend(1) as backend:
        found = _execute([Task(0, long)], backend, limit=0.3)
    assert found[0].status == TIMEOUT
    assert found[0].attempts == 2
    assert time.monotonic() - start < 60.0


def test_slot_replaces_its_process_after_some_tasks() -> None:
    """Two tasks for each process: five tasks see three processes."""
    executor = ProcessSlots(1, tasks_per_process=2)
    pids = [executor.submit(os.getpid).result() for _ in range(5)]
    executor.shutdown()
    assert len(set(pids)) == 3
    assert pids[0] == pids[1]


def test_interruption_leaves_no_process_behind() -> None:
    """An exception ends workers at once, though they have an hour of work."""
    long = load_config("stand", ["duration_s=3600"]).config
    before = set(multiprocessing.active_children())

    def work() -> None:
        with local_backend(2) as backend:
            backend.executor.submit(run_chunk, [Task(0, long)], 1e4)
            time.sleep(0.5)
            raise KeyboardInterrupt

    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        work()
    assert time.monotonic() - start < 20.0
    assert set(multiprocessing.active_children()) <= before


def test_lost_connection_is_an_error_of_the_study(config: Config) -> None:
    """Cancelled futures end the study with a line; nothing is recorded."""

    class Cancelling(Executor):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            future: Future[Any] = Future()
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    backend = Backend(Cancelling(), 1, ())
    with pytest.raises(StudyError, match="goes on"):
        _execute([Task(0, config)], backend)
