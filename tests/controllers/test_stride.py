"""Laws of the periodic sagittal motion over a stride."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ballsim_controllers.body_pendulum import BALL, COP, STATE_SIZE
from ballsim_controllers.footsteps.axis_model import AxisModel
from ballsim_controllers.footsteps.quintic import quintic_step
from ballsim_controllers.footsteps.stride import (
    StrideMotion,
    StrideReference,
    compute_stride,
)
from ballsim_controllers.footsteps.swing import mean_lifting
from ballsim_controllers.messages import Array

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

RADII = (0.25, 0.5, 0.75, 1.0)
DOUBLE, SINGLE = 3, 12
AxisFactory = Callable[[float], "PlainAxis"]


def make(axis: AxisFactory, radius: float) -> tuple[AxisModel, StrideReference]:
    """Return a model whose feet are lifted by 3 cm, and its stride."""
    model = replace(axis(radius).model, lift=0.8)
    lifting = mean_lifting(0.03, SINGLE, model.cell)
    return model, compute_stride(model, DOUBLE, lifting)


def swing_accelerations(cell: float) -> list[float]:
    """Return the foot's mean acceleration per cell of a swing back at 1 m/s.

    The foot has stood for two double and one single support, through below the hip.
    """
    way = 0.5 * (2 * DOUBLE + SINGLE) * cell
    foot, result = (way, 1.0, 0.0), []
    for k in range(SINGLE):
        moved = quintic_step(*foot, -way, 1.0, (SINGLE - k) * cell, cell)
        result.append((moved[1] - foot[1]) / cell)
        foot = moved
    return result


def simulate(
    model: AxisModel, state: Array, inputs: Array, accelerations: Sequence[float]
) -> Array:
    """Return the states of a step under its inputs."""
    states = [state]
    for k, command in enumerate(inputs):
        cell = model.double if k < DOUBLE else model.single
        state = cell.transition @ state + cell.input * command
        if k >= DOUBLE:
            state = state + cell.swing * accelerations[k - DOUBLE]
        states.append(state)
    return np.array(states)


def motions(
    model: AxisModel, stride: StrideReference
) -> list[tuple[StrideMotion, list[float]]]:
    """Return both motions, each with what the foot does."""
    lifted = [model.lift * upward for upward in stride.lifting]
    return [(stride.roll, swing_accelerations(model.cell)), (stride.lift, lifted)]


@pytest.mark.parametrize("radius", RADII)
def test_step_ends_as_it_began(axis: AxisFactory, radius: float) -> None:
    """Simulating a step under its inputs gives its states, and the first one again."""
    model, stride = make(axis, radius)
    for motion, accelerations in motions(model, stride):
        assert motion.states.shape == (DOUBLE + SINGLE, STATE_SIZE)
        states = simulate(model, motion.states[0], motion.inputs, accelerations)
        np.testing.assert_allclose(states[:-1], motion.states, atol=1e-8)
        np.testing.assert_allclose(states[-1], motion.states[0], atol=1e-8)
        assert np.abs(motion.states[:, COP]).max() > 1e-4


@pytest.mark.parametrize("radius", RADII)
def test_ball_rolls_evenly(axis: AxisFactory, radius: float) -> None:
    """The ball neither gains nor loses speed, nor place; left alone it would."""
    model, stride = make(axis, radius)
    for motion, accelerations in motions(model, stride):
        assert np.abs(motion.states[:, BALL + 1]).max() < 1e-4
        assert abs(motion.states[:, BALL].mean()) < 1e-9
        zeros = np.zeros(DOUBLE + SINGLE)
        left = simulate(model, np.zeros(STATE_SIZE), zeros, accelerations)
        assert np.abs(left[:, BALL + 1]).max() > 5e-3


@pytest.mark.parametrize("radius", RADII)
def test_feedback_about_the_stride_keeps_the_speed(
    axis: AxisFactory, radius: float
) -> None:
    """Feedback that follows the stride ends in it; alone it lets the ball sway."""
    model, stride = make(axis, radius)
    speed = 0.4 * radius
    (roll, swung), (lift, lifted) = motions(model, stride)
    accelerations = [speed * a + b for a, b in zip(swung, lifted, strict=True)]
    states = speed * roll.states + lift.states
    inputs = speed * roll.inputs + lift.inputs
    sways = {}
    for is_followed in (True, False):
        state, speeds = np.zeros(STATE_SIZE), []
        for k in range(60 * (DOUBLE + SINGLE)):
            phase = k % (DOUBLE + SINGLE)
            cell = model.double if phase < DOUBLE else model.single
            goal = states[phase] if is_followed else np.zeros(STATE_SIZE)
            command = (inputs[phase] if is_followed else 0.0) - cell.gain @ (
                state - goal
            )
            state = cell.transition @ state + cell.input * command
            if phase >= DOUBLE:
                state = state + cell.swing * accelerations[phase - DOUBLE]
            if k >= 50 * (DOUBLE + SINGLE):
                speeds.append(state[BALL + 1] / radius)
        sways[is_followed] = float(np.std(speeds))
    assert sways[True] < 1e-3
    assert sways[False] > 0.02


def test_without_mass_in_the_legs_nothing_is_to_be_answered(axis: AxisFactory) -> None:
    """Massless legs push nobody off."""
    model = axis(0.5).model
    still = replace(
        model,
        single=replace(model.single, swing=np.zeros(STATE_SIZE)),
        double=replace(model.double, swing=np.zeros(STATE_SIZE)),
    )
    stride = compute_stride(still, DOUBLE, (1.0,) * SINGLE)
    for motion in (stride.roll, stride.lift):
        np.testing.assert_allclose(motion.states, 0.0, atol=1e-12)
        np.testing.assert_allclose(motion.inputs, 0.0, atol=1e-12)
