"""Timers from outside: their arithmetic, and that nothing of them remains."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from ballsim.bench.timers import NO_COST, PartTimers, Target, WrapperCost, patched
from ballsim.errors import BallsimError


class _Clock:
    """A clock that the code under test moves, and that each reading moves too."""

    def __init__(self, per_reading: int = 0) -> None:
        self.now, self.per_reading = 0, per_reading

    def __call__(self) -> int:
        self.now += self.per_reading
        return self.now


def _wrapped_pair(cost: WrapperCost, clock: _Clock) -> tuple[PartTimers, Any]:
    """Return timers, and a part of 10 + 5 ns that calls one of 100 ns twice."""
    timers = PartTimers(cost, clock)

    def work_inside() -> None:
        clock.now += 100

    inside = timers.wrap(work_inside, "inside")

    def work_outside() -> None:
        clock.now += 10
        inside()
        inside()
        clock.now += 5

    return timers, timers.wrap(work_outside, "outside")


def test_inner_parts_do_not_count_for_outer_ones() -> None:
    """Each part has its own time only; together they are the whole."""
    clock = _Clock()
    timers, outside = _wrapped_pair(NO_COST, clock)
    outside()
    clock.now += 7
    assert timers.samples == {"inside": [100, 100], "outside": [15]}
    assert timers.rest(clock.now) == 7
    assert timers.n_calls == 3


def test_cost_of_the_timers_is_subtracted() -> None:
    """A clock that takes 3 ns a reading changes no part, once that is known."""
    clock = _Clock(per_reading=3)
    # The reading at the end of a call falls between the two, that at its start not.
    timers, outside = _wrapped_pair(WrapperCost(inner=3, outer=3), clock)
    outside()
    outside()
    clock.now += 7
    assert timers.samples == {"inside": [100] * 4, "outside": [15] * 2}
    assert timers.rest(clock.now) == 7


def test_time_of_a_call_that_raises_counts() -> None:
    """An exception passes through; later calls are not taken for nested ones."""
    clock = _Clock()
    timers = PartTimers(NO_COST, clock)

    def fail() -> None:
        clock.now += 4
        raise RuntimeError

    wrapped = timers.wrap(fail, "part")
    for _ in range(2):
        with pytest.raises(RuntimeError):
            wrapped()
    assert timers.samples["part"] == [4, 4]
    assert timers.rest(clock.now) == 0


def test_reset_forgets() -> None:
    """After a reset only later calls count."""
    clock = _Clock()
    timers, outside = _wrapped_pair(NO_COST, clock)
    outside()
    timers.reset()
    assert timers.n_calls == 0
    outside()
    assert timers.samples["outside"] == [15]
    assert timers.rest(215) == 0


def test_measured_cost_is_that_of_a_call() -> None:
    """A wrapper costs something, and less than any method worth timing."""
    cost = WrapperCost.measure()
    assert 0 <= cost.inner < 100_000
    assert 0 < cost.outer < 100_000


class _Base:
    def inherited(self) -> str:
        return "inherited"


@dataclass(frozen=True, slots=True)
class _Frozen(_Base):
    value: int = 1

    def method(self) -> int:
        return self.value

    @staticmethod
    def static(value: int) -> int:
        return value

    @classmethod
    def of(cls, value: int) -> _Frozen:
        return cls(value)


def function() -> str:
    return "function"


THIS = "probe_of_timers"
PATHS = (
    "thing.method",
    "thing.inherited",
    f"{THIS}:_Frozen.static",
    f"{THIS}:_Frozen.of",
    f"{THIS}:function",
)


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Any:
    """What stands for a module of that name."""
    module = SimpleNamespace(_Frozen=_Frozen, function=function)
    monkeypatch.setitem(sys.modules, THIS, module)
    return module


def _call_all(module: Any) -> list[object]:
    thing = _Frozen(3)
    answers = [thing.method(), thing.inherited(), _Frozen.static(4), _Frozen.of(5)]
    return [*answers, module.function()]


def test_wrapped_methods_do_the_same_and_are_restored(module: Any) -> None:
    """Frozen, slotted, inherited, static: all are timed, and all are put back."""
    root = SimpleNamespace(thing=_Frozen())
    before = dict(vars(_Frozen)), dict(vars(_Base)), module.function
    timers = PartTimers()
    expected = _call_all(module)
    targets = [Target(path, path) for path in PATHS]
    with patched(targets, root, timers.wrap):
        assert _call_all(module) == expected
    assert [len(timers.samples[path]) for path in PATHS] == [1] * len(PATHS)
    assert (dict(vars(_Frozen)), dict(vars(_Base)), module.function) == before
    _call_all(module)
    assert timers.n_calls == len(PATHS)


def test_classes_are_restored_after_an_error() -> None:
    """An exception in the block leaves no wrapper behind."""
    before = dict(vars(_Frozen))
    targets = [Target("part", "thing.method")]
    root = SimpleNamespace(thing=_Frozen())
    with pytest.raises(ZeroDivisionError), patched(targets, root, PartTimers().wrap):
        raise ZeroDivisionError
    assert dict(vars(_Frozen)) == before


@pytest.mark.parametrize(
    "path",
    [
        "thing.methd",
        "thng.method",
        "thing.value",
        "ballsim.plant:Plnt.step",
        "ballsim.plant:Plant.stp",
        "ballsim.plnt:Plant.step",
    ],
)
def test_missing_path_is_named_and_nothing_is_patched(path: str) -> None:
    """One line names path and part, before anything is replaced."""
    counter = itertools.count()

    def wrap(function: Callable[..., Any], _part: str) -> Callable[..., Any]:
        next(counter)
        return function

    root = SimpleNamespace(thing=_Frozen())
    targets = [Target("good", "thing.method"), Target("the part", path)]
    with pytest.raises(BallsimError) as error, patched(targets, root, wrap):
        pass
    message = str(error.value)
    assert path in message
    assert "the part" in message
    assert "\n" not in message
    assert next(counter) == 0
