"""Timers put around methods from outside, for an instrumented run only.

Nothing in the production code knows of them: for the time of a ``with`` block,
methods of classes (slotted and frozen ones too) and functions of modules are
replaced by wrappers that read a clock before and after. What a wrapper itself
costs is measured once and subtracted, and the time of a timed method that is
called within another one counts for the inner one only.
"""

from __future__ import annotations

import functools
import importlib
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from inspect import getattr_static
from typing import Any

from ballsim.errors import BallsimError

__all__ = ["NO_COST", "PartTimers", "Target", "WrapperCost", "patched"]

_N_CALIBRATION = 20_000
_N_CALIBRATION_ROUNDS = 5


@dataclass(frozen=True, slots=True)
class Target:
    """What is timed, and what it counts for.

    Attributes:
        part: Name of the part of the tick.
        path: ``module:Class.method`` or ``module:function``, or a dotted path that
            begins at an attribute of the prepared run, ``plant.step``; then the
            class of ``plant`` is patched.
    """

    part: str
    path: str

    def find(self, root: object) -> tuple[Any, str]:
        """Return what has to be patched, class or module, and the name in it.

        Args:
            root: Where a path without a module begins.

        Raises:
            BallsimError: There is no such thing.
        """
        module, _, names = self.path.rpartition(":")
        *way, last = names.split(".")
        try:
            owner: Any = importlib.import_module(module) if module else root
            for name in way:
                owner = getattr(owner, name)
            owner = owner if module else type(owner)
            if not callable(getattr(owner, last)):
                raise AttributeError(f"{last!r} cannot be called")
        except (AttributeError, ImportError) as error:
            raise BallsimError(
                f"nothing to time at {self.path!r} (part {self.part!r}): {error}; "
                "what is timed stands in ballsim.bench.parts"
            ) from None
        return owner, last


@dataclass(frozen=True, slots=True)
class WrapperCost:
    """What a wrapper adds to a call.

    Attributes:
        inner: Between the two readings of the clock, [ns].
        outer: Outside of them, [ns].
    """

    inner: int
    outer: int

    @classmethod
    def measure(cls) -> WrapperCost:
        """Return the cost of an empty call's wrapper, least of several rounds."""
        rounds = [_measure_once() for _ in range(_N_CALIBRATION_ROUNDS)]
        plain = min(plain for plain, _, _ in rounds)
        wrapped = min(wrapped for _, wrapped, _ in rounds)
        inside = min(inside for _, _, inside in rounds)
        # Some of the empty call's own cost lies between the two readings.
        inner = max(0.0, inside - plain)
        return cls(round(inner), round(max(0.0, wrapped - plain - inner)))


NO_COST = WrapperCost(0, 0)


class PartTimers:
    """Collects the time of each part's calls.

    Args:
        cost: What is subtracted for each call.
        clock: Returns the time, [ns].

    Attributes:
        samples: Time of each call by part, that of timed calls within it not
            counted, [ns].
    """

    def __init__(
        self,
        cost: WrapperCost = NO_COST,
        clock: Callable[[], int] = time.perf_counter_ns,
    ) -> None:
        """Begin without samples."""
        self.samples: dict[str, list[int]] = {}
        self._cost = cost
        self._clock = clock
        self._within = [0]  # for each open call, time of the timed calls within it

    @property
    def n_calls(self) -> int:
        """Return the number of calls of all parts."""
        return sum(map(len, self.samples.values()))

    def reset(self) -> None:
        """Forget all samples; no timed call may be open."""
        for samples in self.samples.values():
            samples.clear()
        self._within[:] = [0]

    def rest(self, total: int) -> int:
        """Return the time outside of all timed calls, [ns].

        Args:
            total: Time of everything since the reset, [ns].
        """
        return total - self._within[0]

    def wrap(self, function: Callable[..., Any], part: str) -> Callable[..., Any]:
        """Return a function that does the same and is timed.

        Args:
            function: What is called.
            part: Name of the part that its time counts for.
        """
        samples = self.samples.setdefault(part, [])
        within, clock = self._within, self._clock
        inner, outer = self._cost.inner, self._cost.outer

        @functools.wraps(function)
        def timed(*args: Any, **kwargs: Any) -> Any:
            within.append(0)
            start = clock()
            try:
                return function(*args, **kwargs)
            finally:
                elapsed = clock() - start
                samples.append(elapsed - within.pop() - inner)
                within[-1] += elapsed + outer

        return timed


@contextmanager
def patched(
    targets: Iterable[Target],
    root: object,
    wrap: Callable[[Callable[..., Any], str], Callable[..., Any]],
) -> Iterator[None]:
    """Replace methods and functions by wrapped ones while the block runs.

    Args:
        targets: What is replaced; all paths are looked up before the first change.
        root: Where paths without a module begin.
        wrap: Returns the replacement for a function and the name of its part.

    Raises:
        BallsimError: A path does not exist; nothing is changed then.
    """
    found = [(target.part, *target.find(root)) for target in targets]
    with ExitStack() as undo:
        for part, owner, name in found:
            is_own = name in vars(owner)
            present = getattr_static(owner, name)
            replacement: Any
            if isinstance(present, staticmethod | classmethod):
                replacement = type(present)(wrap(present.__func__, part))
            else:
                replacement = wrap(present, part)
            setattr(owner, name, replacement)
            if is_own:
                undo.callback(setattr, owner, name, present)
            else:
                undo.callback(delattr, owner, name)
        yield


def _measure_once() -> tuple[float, float, float]:
    """Return what an empty call takes: plain, wrapped, between the readings, [ns]."""
    timers = PartTimers()
    wrapped = timers.wrap(_nothing, "nothing")
    calls = range(_N_CALIBRATION)
    start = time.perf_counter_ns()
    for _ in calls:
        _nothing(None)
    middle = time.perf_counter_ns()
    for _ in calls:
        wrapped(None)
    end = time.perf_counter_ns()
    inside = sum(timers.samples["nothing"])
    return (
        (middle - start) / _N_CALIBRATION,
        (end - middle) / _N_CALIBRATION,
        inside / _N_CALIBRATION,
    )


def _nothing(_argument: object) -> None:
    """Stand for a method without a body."""
