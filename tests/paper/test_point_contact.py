"""The paper's feedback on a contact that transmits no moment."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.paper.parameter_sets import RADII
from ballsim.paper.point_contact import angles_from_places, point_contact_poles
from ballsim_controllers.wheeled_lip import WheeledLipParameters, equilibrium_direction

SLOW_PAIRS = {0.25: -0.02 + 2.06j, 0.5: -0.76 + 2.10j}


@pytest.mark.parametrize("radius", SLOW_PAIRS)
def test_slow_poles_leave_their_places(radius):
    """Of -1 and -1.05 the paper's wheel makes a pair that hardly decays."""
    poles = point_contact_poles(WheeledLipParameters(radius))
    nearest = np.abs(poles - SLOW_PAIRS[radius]).min()
    assert nearest < 0.02


@pytest.mark.parametrize("radius", RADII)
def test_small_wheel_calms_them(radius):
    """With a wheel of 1 cm all poles are well damped."""
    poles = point_contact_poles(WheeledLipParameters(radius, wheel_radius=0.01))
    assert (np.abs(poles.imag) < -0.6 * poles.real).all()


@pytest.mark.parametrize("radius", RADII)
def test_angles_of_the_place_at_rest(radius):
    """With CoM and CoP over the ball's centre the angles are a multiple of T."""
    params = WheeledLipParameters(radius)
    roll = 0.3
    ball = radius * roll
    # p = 2 b + r0 theta_2 = b
    angles = angles_from_places(params) @ [ball, ball, -roll]
    np.testing.assert_allclose(angles, roll * equilibrium_direction(params)[:3])
