"""The paper's gains by a second route, and the choice among its many F."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from ballsim.paper.observer_gains import knv_gain, observer_gain
from ballsim.paper.parameter_sets import PARAMETER_SETS, RADII, ObserverKind
from ballsim.paper.planar_simulation import simulate
from ballsim.paper.targets import SteppedTarget
from ballsim_controllers.balance.observer import echo_zeros
from ballsim_controllers.balance.paper_controller import (
    FEEDBACK_POLES,
    OBSERVER_POLES,
    PaperBalanceController,
)
from ballsim_controllers.wheeled_lip import (
    WheeledLipParameters,
    gravity_matrix,
    mass_matrix,
    wheeled_lip_matrices,
)


@pytest.mark.parametrize("radius", RADII)
def test_feedback_gain_is_ackermanns_in_forty_digits(radius):
    """K = e6^T (B, A B, ..., A^5 B)^-1 p(A), with nothing lost to rounding."""
    params = WheeledLipParameters(radius)
    with mpmath.workdps(40):
        inverse = mpmath.matrix(mass_matrix(params).tolist()) ** -1
        lower = -inverse * mpmath.matrix(gravity_matrix(params).tolist())
        A, B = mpmath.zeros(6), mpmath.zeros(6, 1)
        for i in range(3):
            A[i, 3 + i], B[3 + i] = 1, inverse[i, 1]
            for j in range(3):
                A[3 + i, j] = lower[i, j]
        columns, reached, polynomial = B, mpmath.zeros(6), mpmath.eye(6)
        for i, pole in enumerate(FEEDBACK_POLES):
            reached[:, i] = columns
            columns = A * columns
            polynomial *= A - mpmath.mpf(str(pole)) * mpmath.eye(6)
        expected = (reached**-1)[5, :] * polynomial
        expected = np.array([float(entry) for entry in expected])
    gain = PaperBalanceController(params).gain[0]
    np.testing.assert_allclose(gain, expected, rtol=1e-9)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("kind", ObserverKind)
def test_every_observer_gain_has_the_papers_poles(kind, radius):
    """A - F C has the six poles of Section VI-B, whatever chose F."""
    params = WheeledLipParameters(radius)
    F = observer_gain(kind, params)
    poles = np.linalg.eigvals(wheeled_lip_matrices(params).A - F @ np.eye(3, 6))
    assert np.abs(poles.imag).max() < 1e-2
    np.testing.assert_allclose(np.sort(poles.real), sorted(OBSERVER_POLES), rtol=1e-3)


@pytest.mark.parametrize("radius", RADII)
def test_knv_leaves_its_unstable_choice_after_a_few_sweeps(radius):
    """Stopped early it has an unstable echo zero, in the end none."""
    params = WheeledLipParameters(radius)
    model = wheeled_lip_matrices(params)
    assert echo_zeros(*model, knv_gain(params, sweeps=2)).real.max() > 10.0
    largest = echo_zeros(*model, knv_gain(params)).real.max()
    assert -1.1 < largest < -0.9


@pytest.mark.parametrize("radius", RADII)
def test_default_place_makes_the_papers_loop_fall(radius):
    """With the F of `place` the robot falls at once, even from a small step."""
    choices = PARAMETER_SETS["S1"]
    params = choices.model(radius)
    F = observer_gain(ObserverKind.PLACE, params)
    balance = PaperBalanceController(params, observer_gain=F)
    target = SteppedTarget((0.0, 0.2))
    run = simulate(balance, choices.footsteps(radius), target, 2.0)
    assert run.fall_time is not None
    assert run.fall_time < 0.6
