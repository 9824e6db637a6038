"""Logistic fit of survival against a factor, with intervals of its levels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ballsim_controllers.messages import Array

__all__ = ["Level", "LogisticFit", "fit_logistic"]

Mask = npt.NDArray[np.bool_]

_CHI2 = 3.841459  # 95 % point of the chi-squared distribution with one degree
_TIE = 1e-3  # log-likelihoods this close count as equal
_SLOPES = (0.5, 2000.0)  # least and greatest, in logits over the whole tested range
_N_HALVINGS = 40  # of the logarithm of the slope
# Where a level may lie: 0 is the easiest value tested, 1 the hardest one.
_PLACES = np.concatenate(
    [
        np.linspace(-2.0, -0.05, 40, endpoint=False),
        np.linspace(-0.05, 1.05, 4401),
        np.linspace(3.0, 1.05, 40, endpoint=False)[::-1],
    ]
)


@dataclass(frozen=True, slots=True)
class Level:
    """The value of a factor at which a share of the runs survives.

    A number is None where it lies outside the tested values: nothing is
    extrapolated.

    Attributes:
        share: The share, such as 0.5.
        value: The estimate.
        low: Lower end of its 95 % interval.
        high: Upper end.
        least: Least tested value.
        greatest: Greatest tested value.
        side: Where the estimate lies: ``inside``, ``above`` or ``below``.
    """

    share: float
    value: float | None
    low: float | None
    high: float | None
    least: float
    greatest: float
    side: str

    def describe(self) -> str:
        """Return it as words, as in ``2.1 (1.8 to 2.6)`` or ``above 20``."""
        if self.value is None:
            above, end, other = "above", self.greatest, self.low
            if self.side == "below":
                above, end, other = "below", self.least, self.high
            text = f"{above} {end:.3g}"
            return text if other is None else f"{text} (95 %: {above} {other:.3g})"
        low = f"below {self.least:.3g}" if self.low is None else f"{self.low:.3g}"
        high = f"above {self.greatest:.3g}" if self.high is None else f"{self.high:.3g}"
        return f"{self.value:.3g} ({low} to {high})"


@dataclass(frozen=True, slots=True)
class LogisticFit:
    """Survival as a logistic function of a factor.

    Attributes:
        centre: Value at which half of the runs survive, on the fit's scale.
        slope: Logits for each unit of that scale; negative if large values are
            harder.
        is_log: True if the scale is the logarithm of the factor.
        levels: The levels that were asked for.
    """

    centre: float
    slope: float
    is_log: bool
    levels: tuple[Level, ...]

    def probability(self, values: Array) -> Array:
        """Return the probability of survival at values of the factor."""
        x = np.log(values) if self.is_log else np.asarray(values, dtype=float)
        result: Array = _logistic(self.slope * (x - self.centre))
        return result


def fit_logistic(
    values: Sequence[float],
    n_survived: Sequence[int],
    n_runs: Sequence[int],
    harder: str = "high",
    is_log: bool = False,
    shares: Sequence[float] = (0.5, 0.99),
) -> LogisticFit | None:
    r"""Fit survival against a factor, with intervals of its levels.

    With the logit of the share :math:`q` and the level :math:`x_q`,

    .. math:: \operatorname{logit} P(x) = \operatorname{logit} q - s (x - x_q),
              \qquad s > 0

    where x is mirrored if small values are harder. Each interval holds the levels
    whose profile likelihood (the greatest over s) is within 1.92 of the maximum.
    That needs no random numbers, and stays sensible where the maximum lies at
    infinity: all survive, all fall, or a value separates the two.

    Args:
        values: Values of the factor.
        n_survived: Runs that survived at each value.
        n_runs: All runs at each value.
        harder: Which end is harder, ``high`` or ``low``.
        is_log: True to take the logarithm of the values, which are positive.
        shares: Shares of the levels.

    Returns:
        The fit, or None if there are fewer than two different values.
    """
    given = np.array(values, dtype=float)
    if len(np.unique(given)) < 2:
        return None
    sign = 1.0 if harder == "high" else -1.0
    x = sign * (np.log(given) if is_log else given)
    first, width = float(x.min()), float(np.ptp(x))
    u = (x - first) / width  # 0 at the easiest, 1 at the hardest value
    k, n = np.array(n_survived, dtype=float), np.array(n_runs, dtype=float)

    def back(unit: float) -> float:
        scaled = sign * (first + width * unit)
        return math.exp(scaled) if is_log else scaled

    def level(share: float) -> Level:
        profile, _ = _profile(share, u, k, n)
        best = float(profile.max())
        place = _middle(profile > best - _TIE)
        inside = _PLACES[profile > best - _CHI2 / 2.0]
        ends = [float(inside[0]), float(inside[-1])]
        easy, hard = (back(e) if 0.0 <= e <= 1.0 else None for e in ends)
        if ends[0] > 1.0:  # all of the interval is harder than what was tested
            easy = None
        low, high = (easy, hard) if sign > 0 else (hard, easy)
        is_inside = 0.0 <= place <= 1.0
        is_hard = place > 1.0
        side = "above" if is_hard == (sign > 0) else "below"
        return Level(
            share=share,
            value=back(place) if is_inside else None,
            low=low,
            high=high,
            least=float(given.min()),
            greatest=float(given.max()),
            side="inside" if is_inside else side,
        )

    profile, slopes = _profile(0.5, u, k, n)
    centre = _middle(profile > profile.max() - _TIE)
    steepness = float(slopes[np.argmin(np.abs(_PLACES - centre))])
    return LogisticFit(
        centre=sign * (first + width * centre),
        slope=-sign * steepness / width,
        is_log=is_log,
        levels=tuple(level(share) for share in shares),
    )


def _logistic(x: Array) -> Array:
    result: Array = 0.5 * (1.0 + np.tanh(0.5 * x))  # does not overflow
    return result


def _profile(share: float, u: Array, k: Array, n: Array) -> tuple[Array, Array]:
    """Return the log-likelihood of each place of a level, the greatest over slopes.

    Args:
        share: Share that survives at the level.
        u: Values, shape (m,), 0 the easiest and 1 the hardest.
        k: Runs that survived at each value.
        n: All runs at each value.

    Returns:
        The log-likelihood at each of `_PLACES` and the slope that gives it.
    """
    logit = math.log(share / (1.0 - share))
    distances = u[None, :] - _PLACES[:, None]
    low, high = (np.full(len(_PLACES), math.log(slope)) for slope in _SLOPES)
    for _ in range(_N_HALVINGS):  # the likelihood is concave in the slope
        middle = 0.5 * (low + high)
        probability = _logistic(logit - np.exp(middle)[:, None] * distances)
        gradient = (distances * (n * probability - k)).sum(axis=1)
        low = np.where(gradient > 0.0, middle, low)
        high = np.where(gradient > 0.0, high, middle)
    slopes = np.exp(low)
    logits = logit - slopes[:, None] * distances
    return (k * logits - n * np.logaddexp(0.0, logits)).sum(axis=1), slopes


def _middle(is_candidate: Mask) -> float:
    """Return the middle of the places that are equally likely."""
    candidates = _PLACES[is_candidate]
    return float((candidates[0] + candidates[-1]) / 2.0)
