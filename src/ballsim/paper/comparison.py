"""The table: what the paper's figures say, what ours say, the difference."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ballsim.paper.experiments import Experiment
from ballsim.paper.measures import steady_state

__all__ = ["Row", "compare", "format_number", "format_table"]

STAGE_SPEEDS = {
    0.5: (0.2469, 0.3194, 0.3600, 0.3694),
    1.0: (0.2318, 0.2943, 0.3414, 0.3685),
}
"""theta_1' at the ends of the stages, captions of Figs. 10 and 11, [rad/s]."""

LAST_SPEEDS = {0.5: 0.4045, 1.0: 0.3983}
"""theta_1' at the end, captions of Figs. 10 and 11, [rad/s]."""

DESIRED_SPEED = 0.4
"""Section VI-D, [rad/s]."""


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table.

    Attributes:
        figure: The paper's figure.
        quantity: What is compared, with its unit.
        ball_radius: r0, [m].
        paper: The paper's number or, where it prints none, its words.
        ours: Our number; None after a fall.
        parameter_set: Name of the parameter set.
        note: What else there is to say.
    """

    figure: str
    quantity: str
    ball_radius: float
    paper: float | str
    ours: float | None
    parameter_set: str
    note: str = ""

    @property
    def difference(self) -> float | None:
        """Return ours minus the paper's, or None if that makes no sense."""
        if self.ours is None or isinstance(self.paper, str):
            return None
        return self.ours - self.paper


def compare(experiments: Iterable[Experiment]) -> list[Row]:
    """Return the table of some experiments, in the order of the figures."""
    rows = [row for experiment in experiments for row in _rows(experiment)]
    quantities = list(dict.fromkeys(row.quantity for row in rows))
    return sorted(
        rows,
        key=lambda row: (
            int(row.figure.split(",")[0]),
            quantities.index(row.quantity),
        ),
    )


def _rows(experiment: Experiment) -> Iterator[Row]:
    yield from _angle_rows(experiment)
    if experiment.name == "velocity":
        yield from _stage_rows(experiment)
        if experiment.choices.name != "KNV2":
            yield from _steady_rows(experiment)


def _angle_rows(experiment: Experiment) -> Iterator[Row]:
    if not experiment.target_angles:
        return
    target, run = experiment.target_angles[-1], experiment.run
    name, radius = experiment.choices.name, experiment.ball_radius
    figure = "9" if experiment.name.startswith("change") else "8"
    has_fallen = run.fall_time is not None
    final = None if has_fallen else float(run.outputs[-1, 0])
    way = " -> ".join(f"{angle:g}" for angle in experiment.target_angles)
    what = f"final theta_1 for theta_1* = {way} [rad]"
    note = _fall_note(experiment) or f"{run.step_count} steps"
    yield Row(figure, what, radius, target, final, name, note)


def _stage_rows(experiment: Experiment) -> Iterator[Row]:
    name, radius = experiment.choices.name, experiment.ball_radius
    if name != "KNV2" or radius not in STAGE_SPEEDS:
        return
    for i, (paper, switch) in enumerate(
        zip(STAGE_SPEEDS[radius], experiment.switches, strict=False), start=1
    ):
        what = f"theta_1' at the end of stage {i}, {switch.stage:g} [rad/s]"
        note = f"at {switch.time:.2f} s"
        yield Row("10, 11", what, radius, paper, switch.speed, name, note)
    steady = steady_state(experiment.run)
    mean = None if steady is None else steady.mean
    what = "theta_1' at the end [rad/s]"
    yield Row("10, 11", what, radius, LAST_SPEEDS[radius], mean, name, "mean of 10 s")


def _steady_rows(experiment: Experiment) -> Iterator[Row]:
    name, radius = experiment.choices.name, experiment.ball_radius
    steady, fall = steady_state(experiment.run), _fall_note(experiment)
    mean, oscillation, deviation = (None,) * 3 if steady is None else steady[:3]
    what = "steady theta_1' [rad/s]"
    yield Row("12", what, radius, DESIRED_SPEED, mean, name, fall)
    if radius not in LAST_SPEEDS:  # the paper rolls two of its balls steadily
        return
    words = "oscillates" if radius == 1.0 else "stable"
    what = "oscillation of theta_1', half p-p [rad/s]"
    yield Row("12", what, radius, words, oscillation, name, fall)
    words = "cyclic" if radius == 1.0 else "closely matches"
    share = "" if steady is None else f"in {steady.deviating_steps:.0%} of the steps"
    what = "largest |actual - ideal theta_2| [rad]"
    yield Row("13", what, radius, words, deviation, name, fall or share)


def _fall_note(experiment: Experiment) -> str:
    time = experiment.run.fall_time
    return "" if time is None else f"falls at {time:.2f} s"


def format_number(value: float | str | None, is_difference: bool = False) -> str:
    """Return a cell of the table.

    Args:
        value: Number, words, or None for nothing.
        is_difference: Whether a number gets a sign.

    Examples:
        >>> format_number(0.40451), format_number(-1e-7, True), format_number(None)
        ('0.4045', '-1.0e-07', '-')
    """
    if value is None or isinstance(value, str):
        return value or "-"
    if abs(value) < 1e-9:
        return "0"
    sign = "+" if is_difference else ""
    is_plain = abs(value) >= 1e-3
    return f"{value:{sign}.4f}" if is_plain else f"{value:{sign}.1e}"


def format_table(rows: Iterable[Row]) -> Iterator[tuple[str, ...]]:
    """Yield the table as texts, the head first.

    Args:
        rows: Rows of the table.
    """
    yield ("figure", "r0 [m]", "quantity", "paper", "ours", "difference", "set", "note")
    for row in rows:
        yield (
            row.figure,
            f"{row.ball_radius:g}",
            row.quantity,
            format_number(row.paper),
            format_number(row.ours),
            format_number(row.difference, is_difference=True),
            row.parameter_set,
            row.note,
        )
