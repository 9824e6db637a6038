r"""Planar plant of the paper's Section VI, driven by the actual CoP.

The paper differentiates the actual theta_2 twice to get the plant's input. The
actual CoP jumps, and two differentiations of a jump are better not done: with

.. math:: z_1 = \theta_1 - a_1 \theta_2, \qquad z_3 = \theta_4 - a_3 \theta_2

the second derivative of theta_2 drops out of (18), and theta_2 itself is the
input. The result is the same to all digits (simplified-model.md section 3).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ballsim_controllers.messages import Array
from ballsim_controllers.wheeled_lip import WheeledLipParameters, held_cop_wheeled_lip

__all__ = ["PlanarPlant", "PlanarState"]


@dataclass(frozen=True, slots=True)
class PlanarState:
    """State of the planar plant.

    Attributes:
        reduced: (z1, z3), shape (2,), [rad].
        reduced_rates: Their rates, shape (2,), [rad/s].
        contact: Actual theta_2 at this instant, [rad].
    """

    reduced: Array
    reduced_rates: Array
    contact: float


@dataclass(frozen=True)
class PlanarPlant:
    """Wheeled LIP whose contact is where the feet put it.

    Attributes:
        params: Parameters of the wheeled pendulum.

    Source:
        Equations (18) and (19), errata 4 and 5.

    Examples:
        >>> plant = PlanarPlant(WheeledLipParameters(ball_radius=0.5))
        >>> state = plant.start(np.array([0.1, 0.0, 0.0]))
        >>> plant.angles(state).round(9).tolist()
        [0.1, 0.0, 0.0]
    """

    params: WheeledLipParameters
    _stiffness: Array = field(init=False, repr=False, compare=False)
    _echo: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Take the rows of theta_1 and theta_4 from A_s and B_s."""
        A, B = held_cop_wheeled_lip(self.params)
        object.__setattr__(self, "_stiffness", A[[3, 5], :3])
        object.__setattr__(self, "_echo", B[[3, 5], 0])

    def start(self, angles: Array) -> PlanarState:
        """Return the state at rest at given angles.

        Args:
            angles: (theta_1, theta_2, theta_4), shape (3,), [rad].
        """
        contact = float(angles[1])
        reduced = angles[[0, 2]] - self._echo * contact
        return PlanarState(reduced, np.zeros(2), contact)

    def angles(self, state: PlanarState) -> Array:
        """Return the measured output y = (theta_1, theta_2, theta_4), [rad]."""
        first, last = state.reduced + self._echo * state.contact
        return np.array([first, state.contact, last])

    def step(self, state: PlanarState, contact: float, dt: float) -> PlanarState:
        """Return the state one semi-implicit Euler step later.

        The acceleration is that of the old contact, as in the paper's form: the
        second difference of theta_2 brings it to the new one over the step.

        Args:
            state: State at the start of the step.
            contact: Actual theta_2 at the end of the step, [rad].
            dt: Step, [s].

        Returns:
            State at the end of the step.
        """
        acceleration = self._stiffness @ self.angles(state)
        rates = state.reduced_rates + dt * acceleration
        return PlanarState(state.reduced + dt * rates, rates, contact)
