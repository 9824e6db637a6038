"""The ranking of factors."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.studies.sensitivity import rank_sensitivities


def _sample(n: int = 200) -> np.ndarray:
    points: np.ndarray = np.random.default_rng(1).uniform(size=(3, n))
    return points


def test_ranks_find_the_order_of_monotonic_effects() -> None:
    """y = exp(5 a) - b: a rules, b opposes, c does nothing; ranks explain it."""
    a, b, c = _sample()
    y = np.exp(5.0 * a) - 10.0 * b
    found = rank_sensitivities(
        {"a": a, "b": b, "c": c},
        y,
        np.random.default_rng(0),
    )
    assert found is not None
    assert found.coefficients["a"] > 0.8
    assert found.high["b"] < 0.0
    assert found.low["c"] < 0.0 < found.high["c"]
    assert found.explained > 0.9


def test_one_factor_alone_has_coefficient_one() -> None:
    """A monotonic function of one factor: coefficient 1, all is explained."""
    a, _, _ = _sample()
    found = rank_sensitivities({"a": a}, a**3, np.random.default_rng(0))
    assert found is not None
    assert found.coefficients["a"] == pytest.approx(1.0)
    assert found.explained == pytest.approx(1.0)


def test_same_generator_gives_the_same_intervals() -> None:
    """The bootstrap takes its numbers from the generator alone."""
    a, b, c = _sample(30)
    results = [
        rank_sensitivities({"a": a, "b": b}, c, np.random.default_rng(5))
        for _ in range(2)
    ]
    assert results[0] == results[1]


@pytest.mark.parametrize(
    ("factors", "quantity"),
    [
        ({}, [1.0, 2.0]),
        ({"a": [1.0, 2.0], "b": [2.0, 1.0]}, [1.0, 2.0]),
        ({"a": list(range(20))}, [3.0] * 20),
        ({"a": [1.0] * 20}, list(range(20))),
        ({"a": list(range(20))}, [np.nan] * 20),
    ],
)
def test_too_little_gives_no_ranking(
    factors: dict[str, list[float]], quantity: list[float]
) -> None:
    """No factor, too few cells, or nothing that varies: no answer."""
    assert rank_sensitivities(factors, quantity, np.random.default_rng(0)) is None
