"""The delay that the paper's loop tolerates, and the cure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ballsim.paper.loop import loop_growth, loop_matrix, tolerated_delay
from ballsim.paper.observer_gains import make_balance
from ballsim.paper.parameter_sets import PARAMETER_SETS, RADII, ObserverKind
from ballsim.paper.planar_simulation import simulate
from ballsim.paper.targets import SteppedTarget
from ballsim_controllers.balance.observer import echo_zeros
from ballsim_controllers.balance.paper_controller import FEEDBACK_POLES

S1 = PARAMETER_SETS["S1"]
PLAIN = {0.25: 1.9e-3, 0.5: 1.6e-3, 0.75: 1.4e-3, 1.0: 1.3e-3}
MENDED = {0.25: 3.6e-3, 0.5: 6.4e-3, 0.75: 8.2e-3, 1.0: 9.4e-3}


@pytest.mark.parametrize("radius", RADII)
def test_loop_has_the_poles_and_the_echo_zeros(radius):
    """Its modes are those of A - B K and the zeros of F, for a small step."""
    balance = make_balance(S1, radius)
    dt = 1e-5
    values = np.linalg.eigvals(loop_matrix(balance, dt))
    modes = np.log(values[np.abs(values) > 0.5].astype(complex)) / dt
    zeros = echo_zeros(*balance.model, balance.F)
    expected = np.poly([*FEEDBACK_POLES, *zeros])
    # Poles in pairs: compare the polynomials, which do not mind.
    for s in (-60.0, -10.0j, 2.0, 30.0 + 20.0j):
        assert np.prod(s - modes) == pytest.approx(np.polyval(expected, s), rel=2e-2)


@pytest.mark.parametrize("radius", RADII)
def test_delay_tolerance_and_its_cure(radius):
    """1 to 2 ms as printed, 4 to 9 ms with the commanded CoP in y."""
    plain = make_balance(S1, radius)
    mended = replace(plain, is_commanded_cop_in_output=True)
    dt = 2e-4
    for balance, expected in ((plain, PLAIN[radius]), (mended, MENDED[radius])):
        found = tolerated_delay(balance, dt)
        assert found == pytest.approx(expected, abs=2.1 * dt)


def test_without_a_delay_the_cure_changes_nothing():
    """Where the CoP is on time the two loops have the same modes."""
    plain = make_balance(S1, 0.5)
    mended = replace(plain, is_commanded_cop_in_output=True)
    expected = loop_growth(plain, 1e-3)
    assert loop_growth(mended, 1e-3) == pytest.approx(expected, abs=1e-3)


def test_no_delay_is_tolerated_by_place():
    """The loop of `place` is unstable to begin with."""
    choices = replace(S1, observer=ObserverKind.PLACE)
    assert tolerated_delay(make_balance(choices, 0.5)) is None


@pytest.mark.parametrize("radius", RADII)
def test_simulation_agrees_with_the_eigenvalues(radius):
    """Steps included, the robot stands within the tolerance and falls beyond."""
    plain = make_balance(S1, radius)
    mended = replace(plain, is_commanded_cop_in_output=True)

    for balance in (plain, mended):
        delays = [(t, loop_growth(balance, 1e-3, t)) for t in range(14)]
        longest = max(ticks for ticks, growth in delays if growth < 0.0)
        too_long = min(ticks for ticks, growth in delays if growth > 0.5)
        for ticks, is_fall in ((longest, False), (too_long, True)):
            run = simulate(
                balance,
                S1.footsteps(radius),
                SteppedTarget((0.0, 0.2)),
                duration=8.0,
                delay_ticks=ticks,
            )
            assert (run.fall_time is not None) == is_fall
