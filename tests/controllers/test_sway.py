"""Laws of the periodic lateral sway."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ballsim_controllers.body_pendulum import BALL, STATE_SIZE
from ballsim_controllers.footsteps.axis_model import AxisModel
from ballsim_controllers.footsteps.quintic import quintic_step
from ballsim_controllers.frontal.sway import SwayReference, compute_sway
from ballsim_controllers.messages import Array

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

RADII = (0.25, 0.5, 0.75, 1.0)
WIDTH, DOUBLE, SINGLE = 0.06, 6, 11
AxisFactory = Callable[[float], "PlainAxis"]


def half_cycle(model: AxisModel, sway: SwayReference) -> Array:
    """Return the states of the half cycle, simulated under its inputs.

    The right foot, which landed at -w when the ball was at -b0, swings to -w; it
    pushes the robot off.
    """
    states, start = [sway.states[0]], sway.states[0][BALL]
    foot, duration = (0.0, 0.0, 0.0), 0.0
    for k, command in enumerate(sway.inputs):
        cell = model.double if k < sway.double_cells else model.single
        if k == sway.double_cells:
            cell = model.first_single
        state = cell.transition @ states[-1] + cell.input * command
        if k == sway.double_cells:
            ball, end_speed = states[-1][BALL : BALL + 2]
            foot = (-WIDTH + start + ball, end_speed, 0.0)
            duration = (len(sway.inputs) - k) * model.cell
        if k >= sway.double_cells:
            left = duration - (k - sway.double_cells) * model.cell
            moved = quintic_step(*foot, -WIDTH, end_speed, left, model.cell)
            state = state + cell.swing * (moved[1] - foot[1]) / model.cell
            foot = moved
        states.append(state)
    return np.array(states)


def make_model(axis: AxisFactory, radius: float) -> AxisModel:
    """Return the model across the heading: the load passes at once at lift-off."""
    model = axis(radius).model
    return replace(model, lift_off=model.single.pass_load())


def make(axis: AxisFactory, radius: float, width: float = WIDTH) -> SwayReference:
    """Return the sway of the preset's gait."""
    return compute_sway(make_model(axis, radius), width, DOUBLE, SINGLE)


@pytest.mark.parametrize("radius", RADII)
def test_half_cycle_ends_at_the_mirror_image(axis: AxisFactory, radius: float) -> None:
    """Simulating the half cycle under its inputs gives -z0."""
    sway = make(axis, radius)
    states = half_cycle(make_model(axis, radius), sway)
    assert sway.states.shape == (DOUBLE + SINGLE, STATE_SIZE)
    np.testing.assert_allclose(states[-1], -sway.states[0], atol=1e-9)
    np.testing.assert_allclose(states[:-1], sway.states, atol=1e-9)


@pytest.mark.parametrize("radius", RADII)
def test_feet_stay_where_they_landed(axis: AxisFactory, radius: float) -> None:
    """In single support the CoP is the left sole's centre, carried at twice the ball.

    The left foot lands at +w from the ball as the half cycle begins, the right
    one landed at -w half a cycle earlier, when the ball was at -b0.
    """
    sway = make(axis, radius)
    ball = sway.states[:, BALL]
    left = WIDTH + ball[0] + 2.0 * (ball - ball[0])
    right = -WIDTH - ball[0] + 2.0 * (ball + ball[0])
    np.testing.assert_allclose(sway.inputs[DOUBLE:], left[DOUBLE:], atol=1e-12)
    share = (sway.inputs - right)[:DOUBLE] / (left - right)[:DOUBLE]
    np.testing.assert_allclose(share, (np.arange(DOUBLE) + 0.5) / DOUBLE, atol=1e-12)


@pytest.mark.parametrize("radius", RADII)
def test_sway_is_small_and_leans_to_the_stance_foot(
    axis: AxisFactory, radius: float
) -> None:
    """The CoM stays between the feet, nearer to the one that carries; the ball rolls
    by a few centimetres only.
    """
    sway = make(axis, radius)
    assert np.abs(sway.states[:, BALL]).max() < 0.05
    assert np.abs(sway.states[:, 0]).max() < WIDTH
    relative = sway.states[DOUBLE:, 0] - sway.states[DOUBLE:, BALL]
    assert relative.mean() > 0.0


def test_sway_is_proportional_to_the_width(axis: AxisFactory) -> None:
    """Twice the width gives twice the sway, the other side its mirror image."""
    one, two = make(axis, 0.5), make(axis, 0.5, 2.0 * WIDTH)
    np.testing.assert_allclose(two.states, 2.0 * one.states, atol=1e-12)
    np.testing.assert_allclose(two.inputs, 2.0 * one.inputs, atol=1e-12)
    other = make(axis, 0.5, -WIDTH)
    np.testing.assert_allclose(other.states, -one.states, atol=1e-12)
    np.testing.assert_allclose(other.inputs, -one.inputs, atol=1e-12)
    still = make(axis, 0.5, 0.0)
    np.testing.assert_allclose(still.states, 0.0, atol=1e-15)


@pytest.mark.parametrize(("double", "single"), [(1, 1), (0, 10), (20, 5)])
def test_sway_exists_for_every_rhythm(
    axis: AxisFactory, double: int, single: int
) -> None:
    """The half cycle closes for any number of cells, without double support too."""
    model = make_model(axis, 0.5)
    sway = compute_sway(model, WIDTH, double, single)
    assert len(sway.inputs) == double + single
    np.testing.assert_allclose(half_cycle(model, sway)[-1], -sway.states[0], atol=1e-9)
