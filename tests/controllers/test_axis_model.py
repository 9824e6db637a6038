"""Laws of the prediction along one axis: the swinging leg's part in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ballsim_controllers.body_pendulum import BALL, COP, STATE_SIZE
from ballsim_controllers.footsteps.axis_model import (
    KNOWN_SIZE,
    ONE,
    STANDING,
    SWINGING,
    AxisModel,
    SwingCells,
    predict,
)
from ballsim_controllers.footsteps.quintic import mean_acceleration, quintic_step
from ballsim_controllers.messages import Array

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

AxisFactory = Callable[[float], "PlainAxis"]
LANDING_CELLS = (5, 13, 21)
#: The right foot is in the air, then the left one swings, then the right one again.
SWINGS = (
    SwingCells(foot=1, origin=SWINGING, landing=0, first=0, count=5),
    SwingCells(foot=0, origin=STANDING, landing=1, first=8, count=5),
    SwingCells(foot=1, origin=0, landing=2, first=16, count=5),
)
#: A whole swing takes one cell more: that of the right foot has begun before.
LIFTING = (4.0, 9.0, -7.0, -6.0, 3.0, -8.0)
LIFTED = len(LIFTING)
LIFT_CELLS = tuple(s.first for s in SWINGS if s.origin != SWINGING)
IS_DOUBLE = tuple(
    not any(s.first <= k < s.first + s.count for s in SWINGS) for k in range(24)
)


def simulate(model: AxisModel, known: Array, landings: Array, inputs: Array) -> Array:
    """Return the states cell after cell, the feet moved one by one."""
    state, soles = known[:STATE_SIZE].copy(), known[STATE_SIZE : STATE_SIZE + 2].copy()
    foot, end_speed = tuple(known[STATE_SIZE + 2 : ONE]), state[BALL + 1]
    states = [state]
    for k, (is_double, free) in enumerate(zip(IS_DOUBLE, inputs, strict=True)):
        cell = model.double if is_double else model.single
        if k in LIFT_CELLS:
            cell = model.first_single
        moved = cell.transition @ state + cell.input * (free - cell.gain @ state)
        for swing in SWINGS:
            if not swing.first <= k < swing.first + swing.count:
                continue
            if k == swing.first and swing.origin != SWINGING:
                end_speed = state[BALL + 1]
                foot = (soles[swing.foot] - state[BALL], end_speed, 0.0)
            left = (swing.first + swing.count - k) * model.cell
            target = landings[swing.landing]
            new = quintic_step(*foot, target, end_speed, left, model.cell)
            moved = moved + cell.swing * (new[1] - foot[1]) / model.cell
            done = k + LIFTED - (swing.first + swing.count)
            moved = moved + cell.swing * model.lift * LIFTING[done]
            foot = new
            soles[swing.foot] = np.nan
            if k == swing.first + swing.count - 1:
                soles[swing.foot] = target + moved[BALL] - 2.0 * (moved - state)[BALL]
        soles += 2.0 * (moved - state)[BALL]
        state = moved
        states.append(state)
    return np.array(states)


@pytest.mark.parametrize("radius", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("is_across", [False, True])
def test_swinging_leg_is_that_of_a_simulation(
    axis: AxisFactory, radius: float, is_across: bool
) -> None:
    """The matrices give the motion of a robot whose feet are moved step by step."""
    model = replace(axis(radius).model, lift=0.7)
    if is_across:
        model = replace(model, lift_off=model.single.pass_load())
    prediction = predict(model, IS_DOUBLE, LANDING_CELLS, SWINGS, LIFTING, LIFT_CELLS)
    generator = np.random.default_rng(0)
    for _ in range(5):
        known = 0.03 * generator.normal(size=KNOWN_SIZE)
        known[ONE] = 1.0
        landings, inputs = (
            0.1 * generator.normal(size=3),
            0.01 * generator.normal(size=24),
        )
        variables = np.concatenate((known, landings, inputs))
        expected = simulate(model, known, landings, inputs)
        found = prediction.states @ variables
        np.testing.assert_allclose(found, expected, atol=1e-9)
        gains = prediction.gains
        commands = inputs - np.einsum("ki,ki->k", gains, expected[:-1])
        np.testing.assert_allclose(prediction.commands @ variables, commands, atol=1e-9)


def test_backward_swing_drives_the_ball_forwards_first(axis: AxisFactory) -> None:
    """A foot that is drawn back pushes CoM back and ball forwards as it leaves."""
    model = axis(0.5).model
    swing = SwingCells(foot=1, origin=STANDING, landing=0, first=0, count=10)
    states = predict(model, (False,) * 12, (10,), (swing,)).states
    by_landing = states[:, :, KNOWN_SIZE]
    assert by_landing[3, 1] > 0.0 > by_landing[3, BALL + 1]
    # Over the whole swing the leg gives back what it took: the mean force is nil.
    assert abs(model.single.swing[1]) * sum(
        mean_acceleration(0.0, 0.0, 0.0, 1.0, 0.0, 0.2, 0.02 * k, 0.02 * (k + 1))
        for k in range(10)
    ) == pytest.approx(0.0, abs=1e-12)


def test_load_passes_at_once(axis: AxisFactory) -> None:
    """A cell at whose start a foot lifts off is one that begins with the commanded CoP.

    Wherever the CoP was before: only the feedback has seen it.
    """
    single = axis(0.5).model.single
    cell, generator = single.pass_load(), np.random.default_rng(0)
    state, command = generator.normal(size=STATE_SIZE), generator.normal()
    moved = cell.transition @ state + cell.input * command
    passed = np.where(np.arange(STATE_SIZE) == COP, command, state)
    expected = single.transition @ passed + single.input * command
    np.testing.assert_allclose(moved, expected, atol=1e-12)
    assert moved[COP] == pytest.approx(command, abs=1e-12)
    np.testing.assert_array_equal(cell.gain, single.gain)
