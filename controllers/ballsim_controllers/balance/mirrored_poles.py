"""Poles of the least control effort."""

from __future__ import annotations

import numpy as np

from ballsim_controllers.wheeled_lip import BallPendulumParameters, held_cop_matrix

__all__ = ["compute_mirrored_poles"]

POLE_SPREAD = 1.05
"""Ratio inside each pair of mirrored poles: equal poles are ill-conditioned."""


def compute_mirrored_poles(params: BallPendulumParameters) -> tuple[float, ...]:
    """Return stable poles at the mirror image of the held CoP's unstable modes.

    These are the poles of the least control effort: each unstable mode of the
    model with its CoP held on the ball is answered at its own speed. The two
    states left over go slightly beyond (`POLE_SPREAD`).

    Args:
        params: Parameters of robot and ball.

    Returns:
        Four real poles, [rad/s], slow pair first.

    Examples:
        >>> from ballsim_controllers.messages import BallParameters
        >>> ball = BallParameters(radius=0.5, mass=40.0, inertia=0.5)
        >>> params = BallPendulumParameters(ball, 65.0, 0.9)
        >>> [round(pole, 2) for pole in compute_mirrored_poles(params)]
        [-1.77, -1.86, -10.28, -10.79]
    """
    modes = np.linalg.eigvals(held_cop_matrix(params)).real
    unstable = sorted(float(mode) for mode in modes if mode > 0.0)
    return tuple(-mode * ratio for mode in unstable for ratio in (1.0, POLE_SPREAD))
