"""What ``paper.json`` and ``table.md`` hold."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

import ballsim
from ballsim.paper.comparison import Row, compare, format_table
from ballsim.paper.experiments import Experiment
from ballsim.paper.measures import largest_deviation, mean_step_length, steady_state
from ballsim.paper.observer_gains import observer_gain
from ballsim.paper.parameter_sets import (
    PARAMETER_SETS,
    ObserverKind,
    ParameterSet,
    open_points,
)
from ballsim.paper.targets import STAGES, TOLERANCE
from ballsim_controllers.balance.observer import echo_zeros
from ballsim_controllers.balance.paper_controller import (
    FEEDBACK_POLES,
    OBSERVER_POLES,
    PaperBalanceController,
)
from ballsim_controllers.footsteps.conditions import cop_speed_limit, swing_speed_limit
from ballsim_controllers.wheeled_lip import equilibrium_direction

__all__ = ["build_report", "format_markdown"]


def build_report(experiments: Sequence[Experiment], command: str) -> dict[str, Any]:
    """Return the contents of ``paper.json``.

    Args:
        experiments: All runs.
        command: Command line.

    Returns:
        Only what JSON knows; angles in [rad], times in [s], lengths in [m].
    """
    radii = sorted({experiment.ball_radius for experiment in experiments})
    return {
        "version": ballsim.__version__,
        "command": command,
        "open_points": [point._asdict() for point in open_points()],
        "parameter_sets": {n: dataclasses.asdict(s) for n, s in PARAMETER_SETS.items()},
        "feedback_poles": list(FEEDBACK_POLES),
        "observer_poles": list(OBSERVER_POLES),
        "velocity_stages": list(STAGES),
        "velocity_tolerance": TOLERANCE,
        "balls": [
            {
                **_describe_ball(radius),
                "runs": [
                    _describe_run(experiment)
                    for experiment in experiments
                    if experiment.ball_radius == radius
                ],
            }
            for radius in radii
        ],
        "comparison": [
            {**dataclasses.asdict(row), "difference": row.difference}
            for row in compare(experiments)
        ],
    }


def _describe_ball(radius: float) -> dict[str, Any]:
    choices = PARAMETER_SETS["S1"]
    params, footsteps = choices.model(radius), choices.footsteps(radius)
    balance = PaperBalanceController(params)
    observers = {}
    for kind in ObserverKind:
        F = observer_gain(kind, params)
        zeros = echo_zeros(*balance.model, F)
        observers[kind.value] = {
            "F": F.tolist(),
            "zeros": [[float(zero.real), float(zero.imag)] for zero in zeros],
            "is_loop_stable": bool(zeros.real.max() < 0.0),
        }
    cop_limit = cop_speed_limit(
        footsteps.half_length, footsteps.shrink, radius, footsteps.min_swing_time
    )
    return {
        "ball_radius": radius,
        "model": dataclasses.asdict(params),
        "K": balance.gain.tolist(),
        "KT": float((balance.gain @ equilibrium_direction(params))[0]),
        "lead_time": balance.lead_time,
        "observers": observers,
        "speed_limits": {
            "cop": cop_limit,
            "swing": swing_speed_limit(footsteps.max_swing_rate),
        },
    }


def _describe_run(experiment: Experiment) -> dict[str, Any]:
    run, choices = experiment.run, experiment.choices
    final = float(run.outputs[-1, 0])
    table: dict[str, Any] = {
        "name": experiment.name,
        "parameter_set": choices.name,
        "parameters": _describe_parameters(choices, experiment),
        "duration": run.dt * len(run.outputs),
        "fall_time": run.fall_time,
        "final_angle": final,
        "steps": [step._asdict() for step in run.steps],
        "step_count": run.step_count,
        "mean_step_length": mean_step_length(run),
        "cop_deviation_max": largest_deviation(run),
    }
    if experiment.target_angles:
        changes = np.flatnonzero(np.diff(run.targets, prepend=np.nan) != 0.0)
        table["targets"] = [
            {"time": float(run.time[i]), "angle": float(run.targets[i])}
            for i in changes
        ]
        table["final_error"] = final - experiment.target_angles[-1]
    else:
        steady = steady_state(run)
        table["stages"] = [switch._asdict() for switch in experiment.switches]
        table["peak_velocity"] = float(run.ball_rates.max())
        table["steady"] = None if steady is None else steady._asdict()
    return table


def _describe_parameters(
    choices: ParameterSet, experiment: Experiment
) -> dict[str, Any]:
    footsteps = dataclasses.asdict(experiment.run.footsteps)
    if choices.max_foot_angle is None:
        footsteps["max_foot_angle"] = None
    return {
        "dt": choices.dt,
        "observer": choices.observer.value,
        "footsteps": footsteps,
    }


def format_markdown(rows: Iterable[Row]) -> str:
    """Return the table with the parameter sets and open points, as Markdown.

    Args:
        rows: Rows of the table.
    """
    names = [
        item.name for item in dataclasses.fields(ParameterSet) if item.name != "purpose"
    ]
    sets: list[tuple[str, ...]] = [(*names, "purpose")]
    for chosen in PARAMETER_SETS.values():
        values = (getattr(chosen, name) for name in names)
        cells = ("none" if value is None else f"{value}" for value in values)
        sets.append((*cells, chosen.purpose))
    points = [("choice", "paper", "reason"), *open_points()]
    blocks = (
        ("The paper's figures and ours", list(format_table(rows))),
        ("Parameter sets", sets),
        ("Where the paper is open or misprinted", points),
    )
    return "\n".join(f"# {title}\n\n{_markdown(table)}" for title, table in blocks)


def _markdown(table: Sequence[Sequence[str]]) -> str:
    head, *body = [[cell.replace("|", r"\|") for cell in row] for row in table]
    lines = [head, ["---"] * len(head), *body]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
