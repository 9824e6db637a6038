r"""Ideal CoP of the contact-consistent pendulum on a ball, along one axis.

.. math:: u = u_{ref} - K (z - z_{ref}), \qquad z = (x, \dot x, b, \dot b)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ballsim_controllers.balance.pole_assignment import place_poles
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import Array
from ballsim_controllers.wheeled_lip import (
    BallPendulumParameters,
    held_cop_matrix,
    state_matrices,
)

__all__ = ["IdealCop", "RollingReference", "compute_mirrored_poles"]

POLE_SPREAD = 1.05
"""Ratio inside each pair of mirrored poles: equal poles are ill-conditioned."""


class RollingReference(NamedTuple):
    """State and CoP of an exact rolling motion.

    Attributes:
        state: (x, x', b, b'), shape (4,), in [m] and [m/s].
        cop: CoP in the world, [m].
    """

    state: Array
    cop: float


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


@dataclass(frozen=True)
class IdealCop:
    """State feedback from the motion of CoM and ball to the CoP, one axis.

    Attributes:
        params: Parameters of robot and ball.
        poles: Four poles of the closed loop, [rad/s]; mirrored ones if None.
        gain: K, shape (4,), CoP per state, [1] and [s]; follows from the poles.
    """

    params: BallPendulumParameters
    poles: Sequence[complex] | None = None
    gain: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Place the poles.

        Raises:
            InvalidSettingError: If a pole is not stable or cannot be placed.
        """
        poles = self.poles
        if poles is None:
            poles = compute_mirrored_poles(self.params)
        if any(complex(pole).real >= 0.0 for pole in poles):
            raise InvalidSettingError("poles", list(poles), "four stable poles")
        object.__setattr__(self, "poles", tuple(poles))
        gain = place_poles(*state_matrices(self.params), poles)[0]
        gain.setflags(write=False)
        object.__setattr__(self, "gain", gain)

    def compute_cop(self, state: Array, reference: RollingReference) -> float:
        """Return the CoP that the feedback wants.

        Args:
            state: (x, x', b, b'), shape (4,), in [m] and [m/s], in the world.
            reference: State and CoP to follow, along the same axis.

        Returns:
            CoP in the world, [m], not limited to the soles.
        """
        return reference.cop - float(self.gain @ (state - reference.state))

    def reference_at(
        self,
        position: float,
        velocity: float = 0.0,
        acceleration: float = 0.0,
        jerk: float = 0.0,
    ) -> RollingReference:
        """Return the motion of CoM and CoP that moves the ball as given.

        With x'' = b'' = a the model gives p = b + a / c + 2 r0 a / g and
        x = p + a h / g: the robot leans ahead of an accelerating ball. This is
        exact as long as the jerk is constant.

        Args:
            position: b, [m] (r0 theta_1 for a roll angle theta_1).
            velocity: b', [m/s].
            acceleration: b'', [m/s^2].
            jerk: b''', [m/s^3].

        Returns:
            State and CoP of that motion.

        Source:
            The model of full-physics.md section 1, solved for x and p.
        """
        params = self.params
        cop_lead = 1.0 / params.ball_stiffness + 2.0 * params.ball.radius / (
            params.gravity
        )
        com_lead = cop_lead + params.com_height / params.gravity
        state = np.array(
            [
                position + com_lead * acceleration,
                velocity + com_lead * jerk,
                position,
                velocity,
            ]
        )
        return RollingReference(state, position + cop_lead * acceleration)
