"""Observer gains F with the paper's poles, from three kinds of pole assignment."""

from __future__ import annotations

import warnings

import numpy as np

from ballsim.paper.parameter_sets import ObserverKind, ParameterSet
from ballsim_controllers.balance.observer import assigned_gain, decoupled_gain
from ballsim_controllers.balance.paper_controller import (
    OBSERVER_POLES,
    PaperBalanceController,
)
from ballsim_controllers.messages import Array
from ballsim_controllers.wheeled_lip import WheeledLipParameters, wheeled_lip_matrices

__all__ = ["knv_gain", "make_balance", "observer_gain"]

KNV_SWEEPS = 1000
"""The iteration rests near an unstable choice for its first three sweeps, and
then leaves it; SciPy's own test of convergence stops it there."""


def knv_gain(params: WheeledLipParameters, sweeps: int = KNV_SWEEPS) -> Array:
    """Return the F that the method of Kautsky, Nichols and Van Dooren ends at.

    MATLAB's `place` is of this kind; the paper does not say what it used.

    Args:
        params: Parameters of the wheeled pendulum.
        sweeps: Sweeps over all poles.

    Returns:
        F, shape (6, 3).

    Source:
        F_KNV of simplified-model.md section 2.
    """
    from scipy.signal import place_poles  # noqa: PLC0415 (takes a second)

    A = wheeled_lip_matrices(params).A
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it never converges to a tolerance of 0
        placed = place_poles(
            A.T, np.eye(6, 3), OBSERVER_POLES, method="KNV0", rtol=0.0, maxiter=sweeps
        )
    gain: Array = placed.gain_matrix.T
    return gain


def observer_gain(kind: ObserverKind, params: WheeledLipParameters) -> Array:
    """Return F of one kind.

    Args:
        kind: Choice of F.
        params: Parameters of the wheeled pendulum.

    Returns:
        F, shape (6, 3), with the poles of Section VI-B.
    """
    if kind is ObserverKind.KNV:
        return knv_gain(params)
    A = wheeled_lip_matrices(params).A
    if kind is ObserverKind.PLACE:
        return assigned_gain(A, OBSERVER_POLES)
    return decoupled_gain(A)


def make_balance(
    choices: ParameterSet,
    ball_radius: float,
    *,
    is_commanded_cop_in_output: bool = False,
) -> PaperBalanceController:
    """Return the paper's balance controller with the choices of a set.

    Args:
        choices: Parameter set.
        ball_radius: r0, [m].
        is_commanded_cop_in_output: Whether y carries the commanded theta_2, the
            cure of a delay of the CoP.
    """
    params = choices.model(ball_radius)
    return PaperBalanceController(
        params,
        observer_gain=observer_gain(choices.observer, params),
        is_commanded_cop_in_output=is_commanded_cop_in_output,
    )
