"""Survival: intervals, levels and curves that are known from elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, stats

from ballsim.studies.levels import fit_logistic
from ballsim.studies.survival import estimate_survival_curve, wilson_interval

LEVELS = np.linspace(0.0, 20.0, 8)
N = 40


def _draw(centre: float, slope: float, seed: int) -> list[int]:
    share = 1.0 / (1.0 + np.exp(slope * (LEVELS - centre)))
    counts: list[int] = np.random.default_rng(seed).binomial(N, share).tolist()
    return counts


@pytest.mark.parametrize("n", [1, 7, 100])
def test_wilson_interval_is_that_of_scipy(n: int) -> None:
    """For all numbers of successes; it holds the share and lies in [0, 1]."""
    for k in range(n + 1):
        low, high = wilson_interval(k, n)
        expected = stats.binomtest(k, n).proportion_ci(method="wilson")
        assert (low, high) == pytest.approx((expected.low, expected.high), abs=1e-6)
        assert 0.0 <= low <= k / n <= high <= 1.0


def test_level_is_the_most_likely_one() -> None:
    """The 50 % level maximises the likelihood, as another optimiser finds it."""
    k = np.array(_draw(9.0, 0.8, seed=3))

    def loss(x: np.ndarray) -> float:
        logits = -x[1] * (LEVELS - x[0])
        return float(-(k * logits - N * np.logaddexp(0.0, logits)).sum())

    best = optimize.minimize(loss, [10.0, 0.5], method="Nelder-Mead").x
    fit = fit_logistic(LEVELS.tolist(), k.tolist(), [N] * 8)
    assert fit is not None
    assert fit.levels[0].value == pytest.approx(best[0], abs=0.005)
    assert fit.slope == pytest.approx(-best[1], rel=0.005)


def test_level_between_tested_values_far_apart_is_the_most_likely_one() -> None:
    """Half survives early in the tested range, where a coarse fit shows most."""
    levels, k = np.array([0, 0.25, 0.5, 1, 1.5, 2, 5, 20]), [20, 20, 20, 18, 14, 11, 1]
    k = np.array([*k, 0])

    def loss(x: np.ndarray) -> float:
        logits = -x[1] * (levels - x[0])
        return float(-(k * logits - 20 * np.logaddexp(0.0, logits)).sum())

    best = optimize.minimize(loss, [2.0, 1.0], method="Nelder-Mead").x
    fit = fit_logistic(levels.tolist(), k.tolist(), [20] * 8)
    assert fit is not None
    assert fit.levels[0].value == pytest.approx(best[0], abs=0.005)


def test_intervals_hold_the_true_level_as_often_as_they_say() -> None:
    """Of 60 studies, 95 % of the intervals hold the true 50 % and 99 % levels."""
    true = (9.0, 9.0 - np.log(99.0) / 0.8)
    hits = np.zeros(2)
    for seed in range(60):
        fit = fit_logistic(LEVELS.tolist(), _draw(9.0, 0.8, seed), [N] * 8)
        assert fit is not None
        for i, level in enumerate(fit.levels):
            low = -np.inf if level.low is None else level.low
            high = np.inf if level.high is None else level.high
            hits[i] += low <= true[i] <= high
    assert (hits / 60 > 0.95 - 3 * np.sqrt(0.05 * 0.95 / 60)).all()


def test_fit_does_not_care_for_mirror_and_logarithm() -> None:
    """A mirrored factor gives mirrored levels, a logarithmic one their powers."""
    k = _draw(9.0, 0.8, seed=1)
    fit = fit_logistic(LEVELS.tolist(), k, [N] * 8)
    mirrored = fit_logistic((-LEVELS).tolist(), k, [N] * 8, harder="low")
    power = fit_logistic(np.exp(LEVELS / 5.0).tolist(), k, [N] * 8, is_log=True)
    assert fit is not None
    assert mirrored is not None
    assert power is not None
    for a, b, c in zip(fit.levels, mirrored.levels, power.levels, strict=True):
        assert b.value == pytest.approx(-a.value)
        assert (b.low, b.high) == pytest.approx((-a.high, -a.low))
        assert 5.0 * np.log(c.value) == pytest.approx(a.value)
    assert power.probability(np.exp(LEVELS / 5.0)) == pytest.approx(
        fit.probability(LEVELS)
    )


@pytest.mark.parametrize(
    ("survivors", "harder", "words"),
    [
        ([N] * 8, "high", "above 20"),
        ([0] * 8, "high", "below 0"),
        ([N] * 8, "low", "below 0"),
        ([0] * 8, "low", "above 20"),
    ],
)
def test_nothing_is_extrapolated(survivors: list[int], harder: str, words: str) -> None:
    """If all survive, or none, the level lies beyond what was tested."""
    fit = fit_logistic(LEVELS.tolist(), survivors, [N] * 8, harder)
    assert fit is not None
    assert fit.levels[0].value is None
    assert fit.levels[0].describe() == words


def test_level_between_two_separate_values_is_in_their_middle() -> None:
    """All survive up to one value, none from the next: the interval covers the gap."""
    fit = fit_logistic([0.0, 1.0, 2.0, 3.0], [9, 9, 0, 0], [9] * 4)
    assert fit is not None
    level = fit.levels[0]
    assert level.value == pytest.approx(1.5, abs=0.01)
    assert level.low is not None
    assert level.high is not None
    assert level.low <= 1.01
    assert level.high >= 1.99


def test_one_value_gives_no_fit() -> None:
    """A level cannot be told from a single value."""
    assert fit_logistic([1.0], [3], [9]) is None


def test_kaplan_meier_of_the_textbook() -> None:
    """Freireich's leukaemia data, group 6-MP (Kleinbaum and Klein, table 2.1)."""
    falls = [6, 6, 6, 7, 10, 13, 16, 22, 23]
    others = [6, 9, 10, 11, 17, 19, 20, 25, 32, 32, 34, 35]
    curve = estimate_survival_curve(
        [*falls, *others], [True] * len(falls) + [False] * len(others)
    )
    assert curve.times.tolist() == [0, 6, 7, 10, 13, 16, 22, 23]
    expected = [1, 0.8571, 0.8067, 0.7529, 0.6902, 0.6275, 0.5378, 0.4482]
    assert curve.shares == pytest.approx(expected, abs=1e-4)
    # Greenwood's interval on the log-log scale at 10 weeks, as R's survfit gives it.
    assert (curve.low[3], curve.high[3]) == pytest.approx((0.5032, 0.8894), abs=2e-3)


def test_without_censoring_the_curve_is_the_share() -> None:
    """All fall: the curve is the empirical distribution and ends at 0."""
    curve = estimate_survival_curve([1.0, 2.0, 2.0, 4.0], [True] * 4)
    assert curve.shares == pytest.approx([1.0, 0.75, 0.25, 0.0])
    assert (curve.low <= curve.shares).all()
    assert (curve.shares <= curve.high).all()


def test_no_fall_gives_a_flat_curve() -> None:
    """Nobody falls: the share stays 1."""
    curve = estimate_survival_curve([3.0, 3.0], [False, False])
    assert curve.shares.tolist() == [1.0]
