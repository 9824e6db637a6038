"""Shares of survivors: interval and curve over time; pure functions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ballsim_controllers.messages import Array

__all__ = ["SurvivalCurve", "estimate_survival_curve", "wilson_interval"]

_Z = 1.959964  # 97.5 % point of the normal distribution


def wilson_interval(n_successes: int, n_runs: int) -> tuple[float, float]:
    """Return the 95 % Wilson score interval of a probability.

    Args:
        n_successes: Runs that succeeded.
        n_runs: All runs, at least one.

    Examples:
        >>> [round(end, 3) for end in wilson_interval(37, 100)]
        [0.282, 0.468]
    """
    z, share = _Z, n_successes / n_runs
    scale = 1.0 + z**2 / n_runs
    centre = (share + z**2 / (2 * n_runs)) / scale
    spread = share * (1.0 - share) / n_runs + (z / (2 * n_runs)) ** 2
    half = z * math.sqrt(spread) / scale
    return max(0.0, centre - half), min(1.0, centre + half)


@dataclass(frozen=True, slots=True)
class SurvivalCurve:
    """A Kaplan-Meier estimate; a step function.

    Attributes:
        times: Times of the steps, the first is 0, [s].
        shares: Share that is still up from each of these times on.
        low: Lower end of its 95 % interval (Greenwood, log-log).
        high: Upper end.
    """

    times: Array
    shares: Array
    low: Array
    high: Array


def estimate_survival_curve(
    times: Sequence[float], is_fall: Sequence[bool]
) -> SurvivalCurve:
    """Estimate the share of runs that are still up, over time.

    Args:
        times: When each run fell or ended, [s].
        is_fall: True where it fell; the others were up until then.

    Source:
        Kaplan and Meier 1958; Greenwood's variance on the log-log scale
        (Kalbfleisch and Prentice).
    """
    time, fall = np.array(times, dtype=float), np.array(is_fall, dtype=bool)
    steps = np.unique(time[fall])
    share, variance = 1.0, 0.0
    rows = [(0.0, 1.0, 1.0, 1.0)]
    for step in steps.tolist():
        n_at_risk = int((time >= step).sum())
        n_falls = int((fall & (time == step)).sum())
        share *= 1.0 - n_falls / n_at_risk
        if n_falls == n_at_risk:
            rows.append((step, 0.0, 0.0, rows[-1][3]))
            continue
        variance += n_falls / (n_at_risk * (n_at_risk - n_falls))
        spread = _Z * math.sqrt(variance) / abs(math.log(share))
        low, high = (share ** math.exp(sign * spread) for sign in (1.0, -1.0))
        rows.append((step, share, low, high))
    return SurvivalCurve(*np.array(rows).T)
