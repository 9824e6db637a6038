"""The simulations of Section VI: which run belongs to which figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from ballsim.paper.observer_gains import make_balance
from ballsim.paper.parameter_sets import PARAMETER_SETS, RADII, ParameterSet
from ballsim.paper.planar_simulation import PlanarRun, simulate
from ballsim.paper.targets import StageSwitch, SteppedTarget, VelocityStages
from ballsim_controllers.balance.paper_controller import PaperBalanceController

__all__ = [
    "CONSTANT_TARGETS",
    "TARGET_CHANGES",
    "VELOCITY_SETS",
    "Experiment",
    "Laboratory",
    "Progress",
    "run_experiments",
]

Progress = Callable[[int, int], None]

CONSTANT_TARGETS = {"S1": 1.0, "S2": 0.5}
"""theta_1* of Figs. 6 to 8 for each parameter set, [rad].

The paper does not state its own. 1 rad on the unit ball is beyond the envelope
of S2, 0.8 rad; that of S1 is 1.6 rad and more on every ball."""

TARGET_CHANGES = {
    "up": ((0.0, 0.5), (3.0, 1.0), (7.0, 0.2)),
    "back": ((0.0, 0.5), (2.0, -0.3), (3.5, 0.5)),
}
"""Changes of theta_1* for Fig. 9: (time in [s], angle in [rad]); not stated."""

VELOCITY_SETS = {"S1": 40.0, "KNV2": 40.0, "KNV20": 60.0, "KNV5": 60.0}
"""Duration of the runs of Figs. 10 to 13 for each parameter set, [s]."""

REST_DURATION = 20.0
"""Duration of the runs of Figs. 6 to 9, [s]."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """One run of Section VI.

    Attributes:
        name: ``constant``, ``change-...`` or ``velocity``.
        choices: Parameter set.
        ball_radius: r0, [m].
        run: What happened.
        target_angles: theta_1* one after the other, [rad]; none at constant velocity.
        switches: Ends of the velocity's stages.
    """

    name: str
    choices: ParameterSet
    ball_radius: float
    run: PlanarRun
    target_angles: tuple[float, ...] = ()
    switches: tuple[StageSwitch, ...] = ()


class Laboratory:
    """Runs the simulations of Section VI; a controller is built only once."""

    def __init__(self) -> None:
        """Start without controllers."""
        self._controllers: dict[tuple[str, float, float], PaperBalanceController] = {}

    def balance(
        self, choices: ParameterSet, ball_radius: float
    ) -> PaperBalanceController:
        """Return the balance controller of a set on a ball."""
        key = (choices.observer, choices.gravity, ball_radius)
        if key not in self._controllers:
            self._controllers[key] = make_balance(choices, ball_radius)
        return self._controllers[key]

    def roll_to(
        self,
        set_name: str,
        ball_radius: float,
        *points: tuple[float, float],
        name: str = "constant",
        duration: float = REST_DURATION,
    ) -> Experiment:
        """Roll to angles, one after the other, Section VI-C.

        Args:
            set_name: Name of the parameter set.
            ball_radius: r0, [m].
            points: Pairs (time in [s], theta_1* in [rad]).
            name: Name of the experiment.
            duration: Time to simulate, [s].
        """
        choices, target = PARAMETER_SETS[set_name], SteppedTarget(*points)
        run = simulate(
            self.balance(choices, ball_radius),
            choices.footsteps(ball_radius),
            target,
            duration,
            choices.dt,
        )
        angles = tuple(angle for _, angle in points)
        return Experiment(name, choices, ball_radius, run, angles)

    def roll_steadily(
        self, set_name: str, ball_radius: float, duration: float
    ) -> Experiment:
        """Roll at 0.4 rad/s through the intermediate velocities, Section VI-D.

        Args:
            set_name: Name of the parameter set.
            ball_radius: r0, [m].
            duration: Time to simulate, [s].
        """
        choices = PARAMETER_SETS[set_name]
        balance = self.balance(choices, ball_radius)
        target = VelocityStages(
            balance.lead_time, choices.stage_reading, choices.is_checked_at_lift_off
        )
        run = simulate(
            balance, choices.footsteps(ball_radius), target, duration, choices.dt
        )
        return Experiment(
            "velocity", choices, ball_radius, run, switches=tuple(target.switches)
        )


def run_experiments(
    progress: Progress | None = None, radii: Sequence[float] = RADII
) -> tuple[Experiment, ...]:
    """Run all simulations of Section VI.

    Args:
        progress: Called with runs done and runs in all.
        radii: Radii of the balls, [m].

    Returns:
        The experiments, in the order of the paper's figures.
    """
    laboratory, jobs = Laboratory(), []
    for set_name, angle in CONSTANT_TARGETS.items():
        for radius in radii:
            jobs.append(partial(laboratory.roll_to, set_name, radius, (0.0, angle)))
    for name, points in TARGET_CHANGES.items():
        for radius in radii:
            change = f"change-{name}"
            jobs.append(partial(laboratory.roll_to, "S2", radius, *points, name=change))
    for set_name, duration in VELOCITY_SETS.items():
        for radius in radii:
            jobs.append(partial(laboratory.roll_steadily, set_name, radius, duration))
    experiments = []
    for job in jobs:
        experiments.append(job())
        if progress is not None:
            progress(len(experiments), len(jobs))
    return tuple(experiments)
