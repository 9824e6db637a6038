"""Executes tasks on any executor, and survives the loss of workers."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass, replace

from ballsim.errors import BallsimError
from ballsim.studies.executors import Backend
from ballsim.studies.single_run import Outcome, Task, run_chunk

__all__ = ["CRASHED", "TIMEOUT", "StudyError", "execute"]

CRASHED = "crashed"  # the worker died, twice
TIMEOUT = "timeout"  # the run took too long, twice

_MAX_ATTEMPTS = 2
_CHUNK_TIME = 2.0  # of work that a worker is sent at once, [s]
_MAX_CHUNK = 64
_MAX_LOSSES = 4  # before any run is done
_PATIENCE = 60.0  # without an outcome, then it is asked for the workers, [s]

OnOutcome = Callable[[Outcome], Iterable[Task]]
RunChunk = Callable[[list[Task], float], list[Outcome]]


class StudyError(BallsimError):
    """A study cannot go on; what is in its ledger is kept.

    Args:
        reason: Why, and what to do.
    """

    def __init__(self, reason: str) -> None:
        """Build the message."""
        super().__init__(" ".join(reason.split()))
        self._arguments = (reason,)


@dataclass(frozen=True, slots=True)
class _Chunk:
    tasks: list[Task]
    attempts: int
    start: float


def execute(
    tasks: Iterable[Task],
    backend: Backend,
    on_outcome: OnOutcome,
    limit: float = math.inf,
    run: RunChunk = run_chunk,
) -> None:
    """Execute tasks, and those that come up meanwhile.

    Workers are sent chunks of about two seconds of work. If a worker is lost, each
    run of its chunk is started once more, on its own; a run that loses a second
    worker is given up, its outcome says so.

    Args:
        tasks: The runs.
        backend: Where they are executed.
        on_outcome: Called with every outcome as it comes in; returns new runs.
        limit: Wall-clock time that a run may take, [s].
        run: What a worker does with a chunk.

    Raises:
        StudyError: The executor itself failed.
    """
    waiting, again = deque(tasks), deque[Task]()
    in_flight: dict[Future[list[Outcome]], _Chunk] = {}
    n_done, time_done, n_lost = 0, 0.0, 0
    held_back: list[Outcome] = []  # of lost runs, until a worker has done one

    def start() -> None:
        if again:
            chunk = _Chunk([again.popleft()], 2, time.monotonic())
        else:
            size = _chunk_size(n_done, time_done, len(waiting), backend.n_slots)
            some = [waiting.popleft() for _ in range(size)]
            chunk = _Chunk(some, 1, time.monotonic())
        in_flight[backend.executor.submit(run, chunk.tasks, limit)] = chunk

    def finish(outcomes: Iterable[Outcome]) -> None:
        for outcome in outcomes:
            waiting.extend(on_outcome(outcome))

    while waiting or again or in_flight or held_back:
        while (waiting or again) and len(in_flight) < backend.n_slots:
            start()
        done = wait(in_flight, _PATIENCE, FIRST_COMPLETED).done
        if not done and not backend.is_alive():
            raise StudyError("there is no worker left; the same command goes on")
        for future in done:
            chunk = in_flight.pop(future)
            outcomes = _outcomes(future, backend)
            if outcomes is not None:
                n_done += len(outcomes)
                time_done += sum(outcome.wall_time for outcome in outcomes)
                finish(replace(o, attempts=chunk.attempts) for o in outcomes)
                continue
            n_lost += 1
            if n_done == 0 and n_lost > backend.n_slots + _MAX_LOSSES:
                raise StudyError(
                    f"every worker was lost: {_lost(chunk, limit)[0].message}"
                )
            if chunk.attempts < _MAX_ATTEMPTS:
                again.extend(chunk.tasks)
            else:
                held_back += _lost(chunk, limit)
        if n_done > 0 or not (waiting or again or in_flight):
            finish(held_back)
            held_back.clear()


def _outcomes(future: Future[list[Outcome]], backend: Backend) -> list[Outcome] | None:
    """Return the outcomes of a chunk, None if its worker was lost."""
    try:
        return future.result()
    except backend.losses:
        return None
    except CancelledError:
        raise StudyError(
            "the connection to the workers was lost; the same command goes on"
        ) from None
    except Exception as error:
        raise StudyError(f"a worker cannot work ({error!r})") from error


def _lost(chunk: _Chunk, limit: float) -> list[Outcome]:
    """Return what is recorded of runs that lost their last worker."""
    duration = time.monotonic() - chunk.start
    is_slow = duration >= limit
    message = f"took more than {limit:g} s" if is_slow else "the worker died"
    return [
        Outcome(
            cell=task.cell,
            seed=task.config.seed,
            status=TIMEOUT if is_slow else CRASHED,
            summary={},
            message=message,
            wall_time=duration,
            attempts=chunk.attempts,
        )
        for task in chunk.tasks
    ]


def _chunk_size(n_done: int, time_done: float, n_waiting: int, n_slots: int) -> int:
    """Return how many runs a worker is sent at once; few when it draws to an end."""
    if n_done == 0:
        return 1
    size = _CHUNK_TIME / max(1e-3, time_done / n_done)
    return max(1, min(int(size), _MAX_CHUNK, n_waiting // (2 * n_slots)))
