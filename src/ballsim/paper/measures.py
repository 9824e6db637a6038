"""Numbers of a planar run: pure functions of its time series."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ballsim.paper.planar_simulation import PlanarRun

__all__ = ["SteadyState", "largest_deviation", "mean_step_length", "steady_state"]

STEADY_TIME = 10.0
"""Last part of a run that counts as steady, [s]."""


class SteadyState(NamedTuple):
    """The last part of a run at constant velocity.

    Attributes:
        mean: Mean theta_1', [rad/s].
        oscillation: Half of the peak-to-peak of theta_1', [rad/s].
        deviation: Largest |actual - ideal theta_2|, [rad].
        deviating_steps: Share of the steps in which the actual theta_2 deviates.
    """

    mean: float
    oscillation: float
    deviation: float
    deviating_steps: float


def largest_deviation(run: PlanarRun) -> float:
    """Return the largest |actual - ideal theta_2| of a run, [rad]."""
    return float(np.abs(run.deviations).max(initial=0.0))


def mean_step_length(run: PlanarRun) -> float:
    """Return the mean |length| of the last ten finished steps, [rad]; 0 for none."""
    lengths = [abs(s.length) for s in run.steps if s.landing_time is not None]
    return float(np.mean(lengths[-10:])) if lengths else 0.0


def steady_state(run: PlanarRun, threshold: float = 1e-9) -> SteadyState | None:
    """Return the steady state of a run, or None if it fell or is too short.

    Args:
        run: A run at constant velocity.
        threshold: Least |actual - ideal theta_2| that is a deviation, [rad].
    """
    n = round(STEADY_TIME / run.dt)
    if run.fall_time is not None or len(run.outputs) <= n:
        return None
    angles, rates = run.outputs[-n - 1 :, 0], run.ball_rates[-n:]
    deviations = np.abs(run.deviations)
    begin = (len(run.outputs) - n) * run.dt
    spans = [
        (round(step.lift_time / run.dt), round(step.landing_time / run.dt))
        for step in run.steps
        if step.landing_time is not None and step.lift_time >= begin
    ]
    hits = [bool((deviations[a : b + 1] > threshold).any()) for a, b in spans]
    return SteadyState(
        mean=float(angles[-1] - angles[0]) / (n * run.dt),
        oscillation=float(np.ptp(rates)) / 2.0,
        deviation=float(deviations[-n:].max()),
        deviating_steps=float(np.mean(hits)) if hits else 0.0,
    )
