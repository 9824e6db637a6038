r"""Planar plant of the paper's Section VI, driven by the actual CoP.

The paper differentiates the actual theta_2 twice to get the plant's input. The
actual CoP jumps, and two differentiations of a jump are better not done: with

.. math:: z_1 = \theta_1 - a_1 \theta_2, \qquad z_3 = \theta_4 - a_3 \theta_2

the second derivative of theta_2 drops out of (18), and theta_2 itself is the
input. The result is the same to all digits (simplified-model.md section 3).

The plant is a dozen multiplications: plain floats are quicker than arrays.
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
        reduced: (z1, z3), [rad].
        reduced_rates: Their rates, [rad/s].
        contact: Actual theta_2 at this instant, [rad].
    """

    reduced: tuple[float, float]
    reduced_rates: tuple[float, float]
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
    _stiffness: tuple[tuple[float, ...], ...] = field(
        init=False, repr=False, compare=False
    )
    _echo: tuple[float, float] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Take the rows of theta_1 and theta_4 from A_s and B_s."""
        A, B = held_cop_wheeled_lip(self.params)
        rows = tuple(tuple(A[row, :3].tolist()) for row in (3, 5))
        object.__setattr__(self, "_stiffness", rows)
        object.__setattr__(self, "_echo", (float(B[3, 0]), float(B[5, 0])))

    def start(self, angles: Array) -> PlanarState:
        """Return the state at rest at given angles.

        Args:
            angles: (theta_1, theta_2, theta_4), shape (3,), [rad].
        """
        first, contact, last = angles.tolist()
        a1, a3 = self._echo
        reduced = (first - a1 * contact, last - a3 * contact)
        return PlanarState(reduced, (0.0, 0.0), contact)

    def angles(self, state: PlanarState) -> Array:
        """Return the measured output y = (theta_1, theta_2, theta_4), [rad]."""
        return np.array(self._angles(state))

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
        th1, th2, th4 = self._angles(state)
        (s1, s2, s4), (u1, u2, u4) = self._stiffness
        (z1, z3), (w1, w3) = state.reduced, state.reduced_rates
        w1 += dt * (s1 * th1 + s2 * th2 + s4 * th4)
        w3 += dt * (u1 * th1 + u2 * th2 + u4 * th4)
        return PlanarState((z1 + dt * w1, z3 + dt * w3), (w1, w3), contact)

    def _angles(self, state: PlanarState) -> tuple[float, float, float]:
        a1, a3 = self._echo
        (z1, z3), contact = state.reduced, state.contact
        return z1 + a1 * contact, contact, z3 + a3 * contact
