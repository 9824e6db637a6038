"""Laws of the capture point of the standing robot."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim_controllers.body_pendulum import (
    BALL,
    STATE_SIZE,
    BodyCoupling,
    TrunkResponse,
    body_matrices,
    capture_point,
)
from ballsim_controllers.messages import BallParameters
from ballsim_controllers.wheeled_lip import BallPendulumParameters

RADII, LAG = (0.25, 0.5, 0.75, 1.0), 0.02
TRUNK = TrunkResponse(stiffness=100.0, damping=20.0, compliance=300.0)
PARAMS = {
    radius: BallPendulumParameters(BallParameters(radius, 40.0, 0.5), 65.0, 0.874)
    for radius in RADII
}


@pytest.mark.parametrize("radius", RADII)
def test_capture_point_flees_from_the_cop(radius: float) -> None:
    """(kappa z)' = lambda (kappa z - q) for a CoP that the ball carries at q."""
    A, B = body_matrices(PARAMS[radius], BodyCoupling(0.06, 0.05), TRUNK, LAG, 4.0)
    kappa, command = capture_point(A, B[:, 0]), B[:, 0]
    held = A.copy()
    held[:, BALL] += 2.0 * command
    rates = np.linalg.eigvals(held).real
    slow = rates[rates > 0.1].min()
    for z in np.random.default_rng(3).normal(size=(5, STATE_SIZE)):
        for q in (-0.1, 0.2):
            change = kappa @ (A @ z + command * (q + 2.0 * z[BALL]))
            assert change == pytest.approx(slow * (kappa @ z - q), rel=1e-6)
    # At rest over the ball's top, wherever that is, it is the place of the CoP.
    rest = np.zeros(STATE_SIZE)
    rest[[0, BALL, 4]] = 0.7
    assert kappa @ rest + 2.0 * 0.7 == pytest.approx(0.7, abs=1e-9)
