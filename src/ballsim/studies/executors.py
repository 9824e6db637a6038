"""Where runs are executed: processes of this machine, or a Dask cluster.

Both are executors of `concurrent.futures`; nothing else knows which one it is.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import connection
from typing import Any, TypeVar

from ballsim.errors import ConfigError, MissingDependencyError

__all__ = ["Backend", "ProcessSlots", "local_backend", "open_backend"]

_TASKS_PER_PROCESS = 200  # then a fresh process: whatever leaks stays small
_CONNECT_TIMEOUT = 10.0  # [s]
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Backend:
    """An executor and what one must know of it.

    Attributes:
        executor: The executor.
        n_slots: Tasks that it works on at the same time.
        losses: Exceptions of a future that say: the worker was lost, not the task.
        is_alive: Tells whether there are workers, or will be.
    """

    executor: Executor
    n_slots: int
    losses: tuple[type[BaseException], ...]
    is_alive: Callable[[], bool] = lambda: True


class ProcessSlots(Executor):
    """Local processes, each a pool of its own.

    A process that dies breaks its own pool only, so that the runs of the others
    go on, and it is clear whose task it was. A slot gets a fresh process after its
    old one died, and after many tasks: the pool's own ``max_tasks_per_child`` can
    hang in Python 3.11.

    Args:
        n_workers: Number of processes.
        tasks_per_process: Tasks after which a process is replaced.
    """

    def __init__(
        self, n_workers: int, tasks_per_process: int = _TASKS_PER_PROCESS
    ) -> None:
        """Start nothing yet."""
        for name in _THREAD_VARIABLES:  # before the workers import NumPy
            os.environ.setdefault(name, "1")
        self._slots = [_Slot(tasks_per_process) for _ in range(n_workers)]

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Give a task to the slot that has the least to do."""
        slot = min(self._slots, key=lambda slot: slot.n_pending)
        return slot.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all processes, at once if `cancel_futures` is True."""
        for slot in self._slots:
            slot.close(is_killing=cancel_futures, is_waiting=wait)


class _Slot:
    """One process at a time."""

    def __init__(self, tasks_per_process: int) -> None:
        self._tasks_per_process = tasks_per_process
        self._pool: ProcessPoolExecutor | None = None
        self._process: Any = None
        self._futures: list[Future[Any]] = []
        self._n_tasks = 0

    @property
    def n_pending(self) -> int:
        """Return the number of tasks that are not done."""
        return sum(not future.done() for future in self._futures)

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Hand a task over, to a fresh process if need be."""
        self._futures = [future for future in self._futures if not future.done()]
        if self._n_tasks >= self._tasks_per_process and not self._futures:
            self.close()
        try:
            return self._submit(fn, *args, **kwargs)
        except BrokenExecutor:
            self.close()
            return self._submit(fn, *args, **kwargs)

    def close(self, is_killing: bool = False, is_waiting: bool = False) -> None:
        """End the process; the next task gets a fresh one."""
        if self._pool is not None:
            if is_killing and self._process is not None:
                self._process.kill()
            self._pool.shutdown(wait=is_waiting or is_killing, cancel_futures=True)
        self._pool = self._process = None
        self._n_tasks = 0

    def _submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(1, context, _start_worker)
        before = set(multiprocessing.active_children())
        future = self._pool.submit(fn, *args, **kwargs)
        for process in set(multiprocessing.active_children()) - before:
            self._process = process
        self._futures.append(future)
        self._n_tasks += 1
        return future


def _start_worker() -> None:
    """Let a worker end with its parent, which may be killed without a word."""
    import signal  # noqa: PLC0415 - in the worker only

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent sees to it
    parent = multiprocessing.parent_process()
    if parent is not None:
        sentinel = parent.sentinel

        def watch() -> None:
            connection.wait([sentinel])
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()


@contextmanager
def open_backend(n_workers: int, scheduler: str | None) -> Iterator[Backend]:
    """Give local processes, or a Dask cluster if its scheduler is named.

    Args:
        n_workers: Number of local processes.
        scheduler: Address of a Dask scheduler, or None.

    Raises:
        ConfigError: There is no cluster at the address, or it does not fit.
        MissingDependencyError: Dask is not installed.
    """
    if scheduler is None:
        with local_backend(n_workers) as backend:
            yield backend
    else:
        with _dask_backend(scheduler) as backend:
            yield backend


@contextmanager
def local_backend(n_workers: int) -> Iterator[Backend]:
    """Give local processes, and end them in any case.

    Args:
        n_workers: Number of processes.
    """
    executor = ProcessSlots(n_workers)
    try:
        yield Backend(executor, n_workers, (BrokenExecutor,))
    except BaseException:
        executor.shutdown(cancel_futures=True)
        raise
    executor.shutdown()


@contextmanager
def _dask_backend(address: str) -> Iterator[Backend]:
    try:
        from distributed import Client  # noqa: PLC0415 (takes seconds)
        from distributed.scheduler import KilledWorker  # noqa: PLC0415
    except ImportError:
        feature, package = "ballsim study --scheduler", "Dask: install ballsim[cluster]"
        raise MissingDependencyError(feature, package) from None

    def refuse(valid: str) -> ConfigError:
        return ConfigError("--scheduler", address, valid, "command line")

    try:
        client = Client(address, timeout=_CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError, ImportError) as error:
        valid = "tcp://host:port of a running Dask scheduler"
        raise refuse(f"{valid} ({str(error) or type(error).__name__})") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_CONNECT_TIMEOUT)
        except TimeoutError:
            raise refuse("a scheduler that has workers, this one has none") from None
        n_threads = client.nthreads()
        if any(n > 1 for n in n_threads.values()):
            # The time limit of a run ends its whole process.
            raise refuse("workers with one thread each, see `dask worker --nthreads`")
        executor = client.get_executor(pure=False, retries=0)
        try:
            losses, n_slots = (KilledWorker,), len(n_threads)
            yield Backend(executor, n_slots, losses, lambda: bool(client.nthreads()))
        finally:
            executor.shutdown(wait=False)
