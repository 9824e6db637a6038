"""Previews to solve, and what their solutions are held against: step by step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ballsim_controllers.body_pendulum import BALL, STATE_SIZE
from ballsim_controllers.footsteps.axis_model import AxisModel
from ballsim_controllers.footsteps.bounds import (
    PreviewStructure,
    SeparationRow,
    SupportRow,
)
from ballsim_controllers.footsteps.preview import (
    AxisPreview,
    PreviewProblem,
    PreviewSolution,
)
from ballsim_controllers.messages import Array


@dataclass(frozen=True)
class Case:
    """A preview in full: its structure, where the robot is and where it shall be."""

    structure: PreviewStructure
    state: Array
    state_reference: Array
    input_reference: Array
    soles: Array
    landing_nominal: Array

    @property
    def is_double(self) -> tuple[bool, ...]:
        """Return the kind of support of each cell."""
        return self.structure.is_double

    def restructured(self, **changes: Any) -> Case:
        """Return the case with changes of its structure."""
        return replace(self, structure=replace(self.structure, **changes))

    def solve(self, preview: AxisPreview) -> PreviewSolution:
        """Return the solution of a preview that was made for this structure."""
        return preview.solve(
            PreviewProblem(
                state=self.state,
                reference=preview.refer(self.state_reference, self.input_reference),
                soles=self.soles,
                swing=np.zeros(3),
                landing_nominal=self.landing_nominal,
            )
        )


def cell_of(model: AxisModel, is_double: bool) -> Any:
    """Return the cell's model for one kind of support."""
    return model.double if is_double else model.single


def simulate(model: AxisModel, problem: Case, inputs: Array) -> Array:
    """Return the states step by step, without any prediction matrix."""
    states = [problem.state]
    for is_double, command in zip(problem.is_double, inputs, strict=True):
        cell = cell_of(model, is_double)
        states.append(cell.transition @ states[-1] + cell.input * command)
    return np.array(states)


def ideal_commands(model: AxisModel, problem: Case, states: Array) -> Array:
    """Return the CoP that the feedback wants in each cell."""
    return np.array(
        [
            problem.input_reference[k]
            - cell_of(model, is_double).gain @ (states[k] - problem.state_reference[k])
            for k, is_double in enumerate(problem.is_double)
        ]
    )


def row_distance(
    row: SupportRow, problem: Case, states: Array, inputs: Array, d: Array
) -> float:
    """Return the CoP's distance from a mean sole, the soles carried by the ball."""
    ball = states[:, BALL]
    middle = 0.5 * (ball[row.cell] + ball[row.cell + 1])
    place = np.dot(row.standing, problem.soles + 2.0 * (middle - ball[0]))
    for weight, cell, offset in zip(
        row.landings, problem.structure.landing_cells, d, strict=True
    ):
        place += weight * (offset + ball[cell] + 2.0 * (middle - ball[cell]))
    return float(inputs[row.cell] - place)


def separation(row: SeparationRow, problem: Case, states: Array, d: Array) -> float:
    """Return the signed distance of a landing foot from the other one."""
    ball = states[:, BALL]
    cell = problem.structure.landing_cells[row.landing]
    if row.other < 0:
        other = problem.soles[row.other_foot] + 2.0 * (ball[cell] - ball[0])
    else:
        landed = problem.structure.landing_cells[row.other]
        other = d[row.other] + ball[landed] + 2.0 * (ball[cell] - ball[landed])
    return float(row.sign * (d[row.landing] + ball[cell] - other))


def margins(model: AxisModel, problem: Case, inputs: Array, d: Array) -> Array:
    """Return how far every constraint is from being violated."""
    states = simulate(model, problem, inputs)
    values = []
    apart = 0.5 * abs(problem.soles[0] - problem.soles[1])
    for row in problem.structure.rows:
        distance = row_distance(row, problem, states, inputs, d)
        reach = row.spread * apart
        values += [distance - row.lower + reach, row.upper + reach - distance]
    for item in problem.structure.separations:
        values.append(separation(item, problem, states, d) - item.minimum)
    structure = problem.structure
    lower, upper = np.array(structure.landing_lower), np.array(structure.landing_upper)
    return np.concatenate((values, d - lower, upper - d))


def walking_problem(
    half: float = 0.06, state: Array | None = None, size: int = 16, weight: float = 1.0
) -> Case:
    """Return a horizon with both kinds of support, two landings and all rows.

    Cells 0-3 on both feet, 4-8 on the first, which stands, 9-11 on both, from
    12 on the landed foot alone while the first one swings, landing at 15.
    """
    is_double = tuple(k < 4 or 9 <= k < 12 or k == 15 for k in range(size))
    spans = (
        (range(4), (0.5, 0.5), (0.0, 0.0), 1.0),
        (range(4, 9), (1.0, 0.0), (0.0, 0.0), 0.0),
        (range(9, 12), (0.5, 0.0), (0.5, 0.0), 0.0),
        (range(12, 15), (0.0, 0.0), (1.0, 0.0), 0.0),
        (range(15, size), (0.0, 0.0), (0.5, 0.5), 0.0),
    )
    rows = tuple(
        SupportRow(k, standing, shares, -half, half, spread)
        for cells, standing, shares, spread in spans
        for k in cells
    )
    if state is None:
        state = np.array([0.02, 0.05, 0.01, 0.04, 0.02, 0.005, -0.02])
    time = 0.02 * np.arange(size)
    reference = np.zeros((size, STATE_SIZE))
    reference[:, [0, 2, 4]] = (0.05 * time)[:, None]
    reference[:, [1, 3]] = 0.05
    structure = PreviewStructure(
        is_double=is_double,
        rows=rows,
        landing_cells=(9, 15),
        landing_lower=(-0.2, -0.2),
        landing_upper=(0.2, 0.2),
        landing_weights=(weight, weight),
    )
    return Case(
        structure=structure,
        state=state,
        state_reference=reference,
        input_reference=0.05 * time + 0.001,
        soles=np.array([0.03, -0.01]),
        landing_nominal=np.array([0.02, -0.01]),
    )


def solve(model: AxisModel, problem: Case) -> PreviewSolution:
    """Return the preview's solution."""
    return problem.solve(AxisPreview(model, problem.structure))


def separated(problem: Case, minimum: float = 0.12) -> Case:
    """Return the problem with distances that the nominal landings do not keep."""
    return problem.restructured(
        separations=(
            SeparationRow(0, -1, 0, 1.0, minimum),
            SeparationRow(1, 0, 0, -1.0, minimum),
        ),
    )
