"""Checks of a study that need the simulator, before anything is written."""

from __future__ import annotations

import dataclasses

from ballsim.errors import ConfigError
from ballsim.studies.design import Plan, extreme_cells, locate
from ballsim.studies.factors import is_number
from ballsim.studies.single_run import UNSTABLE, summarise_config
from ballsim.studies.table import flatten_summary

__all__ = ["check_plan"]

_N_TICKS = 5  # of a run that shows what a summary holds


def check_plan(plan: Plan) -> None:
    """Prepare the extreme cells, run them for an instant, and check the metrics.

    Args:
        plan: The study.

    Raises:
        ConfigError: A configuration cannot be prepared, or a metric or what a case
            requires is no number of the summary.
    """
    found: list[dict[str, bool]] = [{} for _ in plan.cases]
    for cell in extreme_cells(plan):
        period = cell.config.simulation.control_period
        duration = min(cell.config.duration, _N_TICKS * period)
        config = dataclasses.replace(
            cell.config, seed=plan.seeds_of(cell)[0], duration=duration
        )
        try:
            summary = summarise_config(config)
        except ConfigError as error:
            name = plan.cases[cell.case].name if plan.study.cases else None
            raise locate(error, plan.file, name) from None
        own = found[cell.case]
        for key, value in flatten_summary(summary).items():
            is_left_out = key in UNSTABLE or key == "fall_reason"
            is_metric = not is_left_out and (value is None or is_number(value))
            own[key] = own.get(key, True) and is_metric
    known = [[key for key, is_metric in own.items() if is_metric] for own in found]
    any_known = list(dict.fromkeys(key for keys in known for key in keys))
    for i, metric in enumerate(plan.study.metrics):
        if metric not in any_known:
            valid = f"one of {', '.join(any_known)}"
            raise ConfigError(f"metrics.{i}", metric, valid, plan.file)
    places = [place for place, _ in plan.study.expanded_cases]
    for place, case, keys in zip(places, plan.cases, known, strict=True):
        for requirement in case.requirements:
            for name in requirement.names:
                if name not in keys:
                    key = f"{place}.require.{requirement.text}"
                    valid = f"one of {', '.join(keys)} (case {case.name!r})"
                    raise ConfigError(key, name, valid, plan.file)
