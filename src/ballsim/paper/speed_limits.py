"""How fast the ball may roll before the planner falls behind, by simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim.paper.observer_gains import make_balance
from ballsim.paper.parameter_sets import ParameterSet
from ballsim.paper.planar_simulation import PlanarRun, simulate
from ballsim.paper.targets import SpeedRamp
from ballsim_controllers.footsteps.conditions import (
    FootstepParameters,
    cop_speed_limit,
    swing_speed_limit,
)
from ballsim_controllers.messages import Array

__all__ = ["RampRun", "planner_speed_limit", "roll_faster_and_faster"]

DEVIATION = 1e-4
"""|actual - ideal theta_2| from which on the planner has fallen behind, [rad]."""


def planner_speed_limit(footsteps: FootstepParameters) -> float:
    """Return the rolling speed up to which the actual CoP is the ideal one.

    Args:
        footsteps: Parameters of the planner, with an alpha that leaves t_s alone.

    Returns:
        The lower of the support foot's and the swing foot's limits, [rad/s].

    Source:
        simplified-model.md section 3, "Speed limits".

    Examples:
        >>> round(planner_speed_limit(FootstepParameters(1.0, 4.0)), 3)
        0.4
    """
    support = cop_speed_limit(
        footsteps.half_length,
        footsteps.shrink,
        footsteps.ball_radius,
        footsteps.min_swing_time,
    )
    return min(support, swing_speed_limit(footsteps.max_swing_rate))


@dataclass(frozen=True, slots=True)
class RampRun:
    """A run with a slowly rising reference velocity.

    Attributes:
        run: What happened.
        speeds: theta_1^r' of each row, shape (n,), [rad/s].
    """

    run: PlanarRun
    speeds: Array

    @property
    def first_deviation(self) -> float | None:
        """Return theta_1^r' where the planner falls behind, [rad/s], if it does."""
        late = np.flatnonzero(np.abs(self.run.deviations) > DEVIATION)
        return float(self.speeds[late[0]]) if len(late) else None


def roll_faster_and_faster(
    choices: ParameterSet, ball_radius: float, last_speed: float, duration: float = 25.0
) -> RampRun:
    """Raise the reference velocity slowly and evenly from rest.

    Args:
        choices: Parameter set.
        ball_radius: r0, [m].
        last_speed: theta_1^r' at the end, [rad/s].
        duration: Time until then, [s].
    """
    balance = make_balance(choices, ball_radius)
    ramp = SpeedRamp(balance.lead_time, (0.0, 0.0), (duration, last_speed))
    footsteps = choices.footsteps(ball_radius)
    run = simulate(balance, footsteps, ramp, duration, choices.dt)
    return RampRun(run, last_speed / duration * run.time)
