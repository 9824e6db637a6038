"""The paper's balance controller: state feedback, observer and ideal CoP."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ballsim_controllers.balance.observer import decoupled_gain, observer_derivative
from ballsim_controllers.balance.pole_assignment import place_poles
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import Array
from ballsim_controllers.wheeled_lip import (
    StateMatrices,
    WheeledLipParameters,
    equilibrium_direction,
    held_cop_wheeled_lip,
    velocity_direction,
    wheeled_lip_matrices,
)

__all__ = ["FEEDBACK_POLES", "OBSERVER_POLES", "PaperBalanceController"]

FEEDBACK_POLES = (-24.9, -25.0, -4.55, -4.5, -1.05, -1.0)
"""Poles of A - B K in Section VI-B, [rad/s]."""

OBSERVER_POLES = (-49.8, -50.0, -4.55, -4.5, -1.05, -1.0)
"""Poles of A - F C in Section VI-B, [rad/s]."""


@dataclass(frozen=True)
class PaperBalanceController:
    """Six-state controller of the wheeled LIP; holds no state of its own.

    Attributes:
        params: Parameters of the wheeled pendulum.
        poles: Six poles of A - B K, [rad/s].
        observer_gain: F, shape (6, 3); the decoupled F_S if None.
        is_commanded_cop_in_output: Whether y carries the commanded theta_2 in
            place of the measured one. The measured theta_4 echoes each move of
            the contact at once; with the command in y a lag of the contact does
            not upset the observer (simplified-model.md, Delay).
        model: A and B; follow from the parameters.
        gain: K, shape (1, 6); follows from the poles.
        F: The observer gain in use, shape (6, 3).
        echo: (a1, 1, a3), shape (3,): change of the angles with theta_2.

    Source:
        Section III-B.

    Examples:
        >>> controller = PaperBalanceController(WheeledLipParameters(0.5))
        >>> round(controller.lead_time, 4)
        2.4745
    """

    params: WheeledLipParameters
    poles: tuple[float, ...] = FEEDBACK_POLES
    observer_gain: Array | None = None
    is_commanded_cop_in_output: bool = False
    model: StateMatrices = field(init=False, repr=False, compare=False)
    gain: Array = field(init=False, repr=False, compare=False)
    F: Array = field(init=False, repr=False, compare=False)
    echo: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Compute the gains.

        Raises:
            InvalidSettingError: If a gain has the wrong shape or poles.
        """
        model = wheeled_lip_matrices(self.params)
        F = self.observer_gain
        if F is None:
            F = decoupled_gain(model.A)
        if np.shape(F) != (6, 3):
            raise InvalidSettingError("observer_gain", np.shape(F), "shape (6, 3)")
        object.__setattr__(self, "F", F)
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "gain", place_poles(*model, self.poles))
        object.__setattr__(self, "echo", held_cop_wheeled_lip(self.params).B[3:, 0])

    @property
    def lead_time(self) -> float:
        """Return KT'/KT of equation (9), [s]."""
        K = self.gain[0]
        rolling = K @ velocity_direction(self.params)
        return float(rolling / (K @ equilibrium_direction(self.params)))

    def compute_torque(self, estimate: Array, target_angle: float) -> float:
        """Return the feedback torque of the model, u = K (T theta_1* - x).

        Args:
            estimate: Estimated state, shape (6,), [rad] and [rad/s].
            target_angle: theta_1*, [rad].

        Returns:
            tau_2, [N m]. The robot never applies it: it moves the estimate.

        Source:
            Equation (4).
        """
        target = equilibrium_direction(self.params) * target_angle
        return float(self.gain[0] @ (target - estimate))

    def update(
        self, estimate: Array, output: Array, target_angle: float, dt: float
    ) -> Array:
        """Return the estimate one Euler step later.

        Args:
            estimate: Estimated state, shape (6,), [rad] and [rad/s].
            output: Measured angles y = (theta_1, theta_2, theta_4), shape (3,),
                [rad].
            target_angle: theta_1*, [rad].
            dt: Step, [s].

        Returns:
            Estimate at the end of the step; its theta_2 is the ideal CoP
            relative to the ball.

        Source:
            Equations (5)-(7) with the errata of simplified-model.md.
        """
        if self.is_commanded_cop_in_output:
            output = output + self.echo * (estimate[1] - output[1])
        torque = self.compute_torque(estimate, target_angle)
        rate = observer_derivative(self.model, self.F, estimate, torque, output)
        updated: Array = estimate + dt * rate
        return updated
