"""Laws of one axis of the balance controller: feedback, observer, lag."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.linalg

from ballsim_controllers.balance.axis_balance import AxisBalance, AxisDesign
from ballsim_controllers.balance.mirrored_poles import compute_mirrored_poles
from ballsim_controllers.body_pendulum import STATE_SIZE, TILT, body_matrices
from ballsim_controllers.footsteps.axis_model import CellModel
from ballsim_controllers.messages import Array

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

PERIOD, CELL, LAG, POLE = 0.004, 0.02, 0.02, -100.0
RADII = (0.25, 0.5, 1.0)
AxisFactory = Callable[[float], "PlainAxis"]


def make_design(plain: PlainAxis) -> AxisDesign:
    """Return the design of the axis that the tests' own axis has."""
    return AxisDesign(
        params=plain.params,
        coupling=plain.coupling,
        trunk=plain.trunk,
        cop_lag=LAG,
        cop_lead=0.0,
        cop_feedback=0.0,
        feedback_poles=(-6.0, -6.1, -2.0, -2.1),
        trunk_poles=None,
        observer_pole=POLE,
        are_feet_apart=False,
        cell=CELL,
        period=PERIOD,
    )


def tilt_of(state: Array) -> tuple[float, float]:
    """Return tilt and tilt rate of a state."""
    return (float(state[5]), float(state[6]))


@pytest.mark.parametrize("radius", RADII)
def test_model_and_gain_are_those_of_a_second_route(
    axis: AxisFactory, radius: float
) -> None:
    """Prediction and gains equal those by Ackermann's formula, in both supports."""
    plain = axis(radius)
    found = AxisBalance(make_design(plain)).model
    for one, other in (
        (found.double, plain.model.double),
        (found.single, plain.model.single),
    ):
        np.testing.assert_allclose(one.transition, other.transition, atol=1e-12)
        np.testing.assert_allclose(one.input, other.input, atol=1e-12)
        np.testing.assert_allclose(one.swing, other.swing, atol=1e-12)
        np.testing.assert_allclose(one.gain, other.gain, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("radius", RADII)
def test_no_poles_mean_the_mirrored_ones(axis: AxisFactory, radius: float) -> None:
    """Without poles the unstable modes are mirrored, the CoP's lag keeps its own."""
    plain = axis(radius)
    design = replace(make_design(plain), feedback_poles=())
    cell = AxisBalance(design).model.double
    # The trunk, which the feedback leaves out, is left out here too.
    A, B = body_matrices(plain.params, plain.coupling, plain.trunk, LAG, 4.0)
    step = scipy.linalg.expm(
        np.block([[A[:TILT, :TILT], B[:TILT, :1]], [np.zeros((1, TILT + 1))]]) * CELL
    )
    core = step[:TILT, :TILT] - np.outer(step[:TILT, TILT], cell.gain[:TILT])
    wanted = np.exp(np.array([*compute_mirrored_poles(plain.params), -1 / LAG]) * CELL)
    found = np.sort(np.linalg.eigvals(core).real)
    np.testing.assert_allclose(found, np.sort(wanted), atol=1e-4)


@pytest.mark.parametrize("radius", RADII)
def test_trunk_sways_where_it_has_no_part_in_the_feedback(
    axis: AxisFactory, radius: float
) -> None:
    """With its poles all are where they were asked for; without, a pair hardly decays.

    On a single foot, and where the ball rolls, it is left to itself in any case.
    """
    design = make_design(axis(radius))
    design = replace(design, trunk=replace(design.trunk, compliance=1000.0))
    pair = (complex(-4.0, 2.5), complex(-4.0, -2.5))
    with_trunk = AxisBalance(replace(design, trunk_poles=pair)).model
    left = AxisBalance(design).model

    def rates(cell: CellModel) -> Array:
        loop = cell.transition - np.outer(cell.input, cell.gain)
        poles: Array = np.log(np.linalg.eigvals(loop)) / CELL
        return poles[np.lexsort((poles.imag.round(3), poles.real.round(3)))]

    expected = np.array([*design.feedback_poles, -1.0 / LAG, *pair])
    expected = expected[np.lexsort((expected.imag, expected.real))]
    np.testing.assert_allclose(rates(with_trunk.rest().double), expected, atol=0.02)
    swaying = rates(left.double)
    ratios = -swaying.real / np.abs(swaying)
    assert 0.0 < ratios.min() < 0.35
    assert left.rest() is left
    for one, other in (
        (with_trunk.single.gain, left.single.gain),
        (with_trunk.double.gain, left.double.gain),
        (with_trunk.rest().single.gain, left.single.gain),
        (with_trunk.rest().double.transition, left.double.transition),
    ):
        np.testing.assert_array_equal(one, other)


def true_motion(plain: PlainAxis, feet: float, ticks: int) -> tuple[Array, Array]:
    """Return states and CoP, held over each tick, of the continuous model."""
    A, _ = body_matrices(plain.params, plain.coupling, plain.trunk, LAG, feet)
    known = A[:4, :4]
    inputs = A[:4, 4:]
    step = scipy.linalg.expm(np.block([[known, inputs], [np.zeros((3, 7))]]) * PERIOD)
    generator = np.random.default_rng(0)
    held = 0.01 * generator.normal(size=(ticks, 3))
    states = [np.array([0.01, -0.02, 0.0, 0.03])]
    for values in held:
        states.append(step[:4, :4] @ states[-1] + step[:4, 4:] @ values)
    return np.array(states), held


@pytest.mark.parametrize(("is_single", "feet"), [(False, 4.0), (True, 3.0)])
@pytest.mark.parametrize("radius", RADII)
def test_observer_is_exact_on_its_model(
    axis: AxisFactory, radius: float, is_single: bool, feet: float
) -> None:
    """With exact readings of state, CoP and tilt the estimate is the state."""
    plain = axis(radius)
    balance = AxisBalance(make_design(plain))
    states, held = true_motion(plain, feet, 50)
    balance.observe(states[0], 0.0, (0.0, 0.0), is_single)
    for state, (cop, *tilt) in zip(states[1:], held, strict=True):
        found = balance.observe(state, cop, (tilt[0], tilt[1]), is_single)
        np.testing.assert_allclose(found[:4], state, atol=1e-12)
        assert tilt_of(found) == tuple(tilt)
        assert found.shape == (STATE_SIZE,)


def test_observer_forgets_at_its_pole(axis: AxisFactory) -> None:
    """A wrong start dies out by e^(pole T) per tick in every channel."""
    plain = axis(0.5)
    balance = AxisBalance(make_design(plain))
    states, held = true_motion(plain, 4.0, 20)
    wrong = np.array([0.02, -0.1, 0.03, 0.2])
    balance.observe(states[0] + wrong, 0.0, (0.0, 0.0), is_single=False)
    decay = np.exp(POLE * PERIOD)
    for k, (cop, *tilt) in enumerate(held, start=1):
        found = balance.observe(states[k], cop, (tilt[0], tilt[1]), is_single=False)
        np.testing.assert_allclose(found[:4] - states[k], wrong * decay**k, atol=1e-12)


def test_lag_is_that_of_the_model(axis: AxisFactory) -> None:
    """The followed CoP goes to its command as 1 - e^(-t / lag), from where it was."""
    balance = AxisBalance(make_design(axis(0.5)))
    start = balance.observe(np.zeros(4), 0.03, (0.0, 0.0), is_single=False)
    assert start[4] == 0.03
    for k in range(1, 20):
        found = balance.follow(-0.01)
        expected = -0.01 + 0.04 * np.exp(-k * PERIOD / LAG)
        assert found == pytest.approx(expected, abs=1e-12)
        state = balance.observe(np.zeros(4), 0.5, (0.0, 0.0), is_single=False)
        assert state[4] == found  # measured once, at the start


def test_cop_jumps_to_the_foot_that_is_left(axis: AxisFactory) -> None:
    """As a foot lifts off, only where feet stand apart; and so the model has it."""
    for apart in (False, True):
        design = replace(make_design(axis(0.5)), are_feet_apart=apart)
        balance, plain = AxisBalance(design), AxisBalance(make_design(axis(0.5)))
        for one in (balance, plain):
            one.observe(np.zeros(4), 0.03, (0.0, 0.0), is_single=False)
        expected = -0.01 if apart else plain.follow(-0.01)
        found = balance.follow(-0.01, lifts_off=True)
        assert found == pytest.approx(expected, abs=1e-12)
        assert (balance.model.lift_off is not None) is apart
        # Afterwards it lags again.
        expected += (1.0 - np.exp(-PERIOD / LAG)) * (0.02 - expected)
        assert balance.follow(0.02) == pytest.approx(expected, abs=1e-12)


def test_lead_makes_up_for_a_second_lag(axis: AxisFactory) -> None:
    """What is asked for, lagged by the lead time, is the CoP that was planned."""
    lead = 0.01
    balance = AxisBalance(replace(make_design(axis(0.5)), cop_lead=lead, period=1e-4))
    plain = AxisBalance(replace(make_design(axis(0.5)), period=1e-4))
    for one in (balance, plain):
        one.observe(np.zeros(4), 0.0, (0.0, 0.0), is_single=False)
    actual = 0.0
    for _ in range(2000):
        asked, planned = balance.follow(0.03), plain.follow(0.03)
        actual += 1e-4 / lead * (asked - actual)
        assert actual == pytest.approx(planned, abs=3e-4)


@pytest.mark.parametrize("off", [0.008, -0.008])
def test_error_of_the_cop_shrinks_by_one_and_the_feedback(
    axis: AxisFactory, off: float
) -> None:
    """A CoP that is off what was asked for ends off / (1 + share) from the planned one.

    It is not more than a share of 2 cm that is added, whatever is measured.
    """
    balance = AxisBalance(replace(make_design(axis(0.5)), cop_feedback=0.7))
    balance.observe(np.zeros(4), 0.01, (0.0, 0.0), is_single=False)
    measured = 0.01
    for _ in range(100):
        asked = balance.follow(0.01)
        measured += 0.3 * (asked + off - measured)
        balance.observe(np.zeros(4), measured, (0.0, 0.0), is_single=False)
    assert measured - 0.01 == pytest.approx(off / 1.7, abs=1e-9)
    balance.observe(np.zeros(4), 5.0, (0.0, 0.0), is_single=False)
    assert balance.follow(0.01) == pytest.approx(0.01 - 0.7 * 0.02)


def test_measurement_is_not_kept(axis: AxisFactory) -> None:
    """Changing the first measured array afterwards does not move the estimate."""
    found = []
    for scribbles in (False, True):
        balance = AxisBalance(make_design(axis(0.5)))
        measured = np.array([0.01, 0.0, 0.0, 0.0])
        balance.observe(measured, 0.0, (0.0, 0.0), is_single=False)
        if scribbles:
            measured[:] = 7.0
        found.append(balance.observe(np.zeros(4), 0.0, (0.0, 0.0), is_single=False))
    np.testing.assert_array_equal(found[0], found[1])
