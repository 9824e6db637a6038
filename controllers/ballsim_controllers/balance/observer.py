r"""Observers: the paper's for the wheeled LIP, and one for the ball pendulum.

The paper's observer gain F has the right poles for any F that pole assignment
returns, yet the paper's loop is stable for few of them. Where the robot's
contact *is* the observer's theta_2, the measured theta_2 only echoes the
estimate, and the error follows the four zeros of (A - F C, B, row theta_2).
`echo_zeros` computes them; `decoupled_gain` builds an F whose zeros are its own
poles, hence stable (simplified-model.md section 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg

from ballsim_controllers.balance.pole_assignment import place_poles
from ballsim_controllers.compilation import compiled
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.geometry import apply
from ballsim_controllers.messages import Array
from ballsim_controllers.wheeled_lip import StateMatrices, discretise

__all__ = [
    "F_S_PAIRS",
    "BallPendulumObserver",
    "assigned_gain",
    "decoupled_gain",
    "echo_zeros",
    "observer_derivative",
    "update_observer",
]

PolePairs = Sequence[tuple[float, float]]

F_S_PAIRS: PolePairs = ((-49.8, -4.55), (-1.05, -1.0), (-50.0, -4.5))
"""Pairing F_S of the paper's observer poles: theta_1, theta_2, theta_4, [rad/s].

The best of the 21 pairings in survival and noise (simplified-model.md)."""


def decoupled_gain(A: Array, pairs: PolePairs = F_S_PAIRS) -> Array:
    r"""Return the observer gain that gives each output its own pair of poles.

    With the state split into outputs and the rest, the error e of the outputs
    obeys, for N = A12 A22 A12^-1 and D the derivative or the next step,

    .. math::
        D^2 e = (A_{11} - F_1 + N) D e
        + [A_{12} (A_{21} - F_2) - N (A_{11} - F_1)] e .

    F makes both brackets diagonal: sums and (negative) products of the poles.
    For positions and rates, A12 = I and N = 0, it is the closed form
    F = [diag(-sums); A21 + diag(products)].

    Args:
        A: State matrix, continuous or discrete, outputs first, shape (2n, 2n).
        pairs: Two real poles for each output, [rad/s] if continuous.

    Returns:
        F for the output C = [I 0], shape (2n, n).

    Source:
        simplified-model.md section 2; F of equation (5).

    Examples:
        >>> decoupled_gain(np.diag([1.0], k=1), [(-2.0, -3.0)]).tolist()
        [[5.0], [6.0]]
    """
    n = len(pairs)
    A11, A12, A21, A22 = A[:n, :n], A[:n, n:], A[n:, :n], A[n:, n:]
    N = A12 @ A22 @ np.linalg.inv(A12)
    sums = np.diag([first + second for first, second in pairs])
    products = np.diag([first * second for first, second in pairs])
    F1 = A11 + N - sums
    F2 = A21 - np.linalg.solve(A12, N @ (A11 - F1) - products)
    return np.vstack([F1, F2])


def assigned_gain(A: Array, poles: Sequence[complex]) -> Array:
    """Return the observer gain that `place` picks for the output C = [I 0].

    It puts the eigenvalues of A - F C right, but not the echo zeros: with it the
    paper's loop falls within 0.4 s on every ball. Kept for that comparison.

    Args:
        A: State matrix of n positions and their n rates, shape (2n, 2n).
        poles: 2n poles, [rad/s].

    Returns:
        F, shape (2n, n).

    Source:
        Section VI-B: poles of A - F C.
    """
    n = len(A) // 2
    gain: Array = place_poles(A.T, np.eye(2 * n, n), poles).T
    return gain


def echo_zeros(A: Array, B: Array, F: Array) -> Array:
    """Return the poles of the observer whose measured theta_2 is its own.

    Args:
        A: State matrix of the wheeled LIP, shape (6, 6).
        B: Input matrix, shape (6, 1).
        F: Observer gain, shape (6, 3).

    Returns:
        Transmission zeros of (A - F C, B, row theta_2), sorted, shape (4,),
        [rad/s]; the paper's loop needs all of them stable.

    Source:
        simplified-model.md section 2.
    """
    row = np.zeros((1, 7))
    row[0, 1] = 1.0
    pencil = np.vstack([np.hstack([A - F @ np.eye(3, 6), B]), row])
    values = scipy.linalg.eigvals(pencil, np.diag([1.0] * 6 + [0.0]))
    finite = values[np.isfinite(values)]
    zeros: Array = np.sort_complex(finite[np.argsort(np.abs(finite))][:4])
    return zeros


def observer_derivative(
    model: StateMatrices, F: Array, estimate: Array, torque: float, output: Array
) -> Array:
    """Return the rate of change of the paper's estimate.

    Args:
        model: A, shape (6, 6), and B, shape (6, 1), of the wheeled LIP.
        F: Observer gain, shape (6, 3).
        estimate: Estimated state, shape (6,), [rad] and [rad/s].
        torque: Input u = tau_2, [N m].
        output: Measured angles y, shape (3,), [rad].

    Returns:
        d/dt of the estimate, shape (6,).

    Source:
        Equation (5).
    """
    derivative: Array = (
        model.A @ estimate + model.B[:, 0] * torque + F @ (output - estimate[:3])
    )
    return derivative


@dataclass(frozen=True)
class BallPendulumObserver:
    r"""Observer of (x, x', b, b') with known inputs, one axis.

    The paper's observer on the ball pendulum. Places and velocities are all
    measured (C = I: the gyros see velocities that positions would only show
    through differences), so that the observer gain is in closed form,

    .. math:: F = A + \mathrm{diag}(-p), \qquad A - F C = \mathrm{diag}(p),

    here for the discrete model. The CoP enters as a known input, and with it all
    else that the model knows; with exact readings and inputs held over each
    step the error decays to nothing, also while robot and ball move.

    Attributes:
        model: Continuous model, A of shape (4, 4), B of shape (4, m); the CoP
            is the first input.
        dt: Step, [s].
        pole: Pole p of every channel, [rad/s].
        step: The model over one step.
        correction: Gain of the corrected prediction, shape (4, 4).

    Source:
        Equation (5).

    Examples:
        >>> from ballsim_controllers.messages import BallParameters
        >>> from ballsim_controllers.wheeled_lip import *
        >>> ball = BallParameters(radius=0.5, mass=40.0, inertia=0.5)
        >>> model = state_matrices(BallPendulumParameters(ball, 65.0, 0.9))
        >>> observer = BallPendulumObserver(model, dt=0.002, pole=-100.0)
        >>> observer.update(np.zeros(4), np.ones(4), inputs=np.zeros(1)).shape
        (4,)
    """

    model: StateMatrices
    dt: float
    pole: float
    step: StateMatrices = field(init=False, repr=False, compare=False)
    correction: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Discretise the model and place the poles of the discrete observer.

        Raises:
            InvalidSettingError: If the pole is not stable or the step not positive.
        """
        if not self.pole < 0.0:
            raise InvalidSettingError("observer pole", self.pole, "a stable pole")
        step = discretise(*self.model, self.dt)
        decay = np.exp(self.pole * self.dt)
        step = StateMatrices(*(np.ascontiguousarray(matrix) for matrix in step))
        object.__setattr__(self, "step", step)
        # (I - L) A = decay I
        gain = np.eye(len(step.A)) - decay * np.linalg.inv(step.A)
        object.__setattr__(self, "correction", gain)

    def update(self, estimate: Array, measured: Array, inputs: Array) -> Array:
        """Return the estimate of now, from that of one step ago.

        Args:
            estimate: (x, x', b, b') one step ago, shape (4,), [m] and [m/s].
            measured: The same as measured now, shape (4,).
            inputs: CoP, [m], and other inputs measured over the step that ends
                now, shape (m,).

        Returns:
            Estimate of now, shape (4,).
        """
        return update_observer(*self.step, self.correction, estimate, measured, inputs)


@compiled
def update_observer(
    A: Array,
    B: Array,
    correction: Array,
    estimate: Array,
    measured: Array,
    inputs: Array,
) -> Array:
    """Return the prediction, corrected by what was measured, shape (n,).

    Args:
        A: State matrix over the step, shape (n, n).
        B: Input matrix over the step, shape (n, m).
        correction: Gain, shape (n, n).
        estimate: State one step ago, shape (n,).
        measured: The state as measured now, shape (n,).
        inputs: Inputs over the step, shape (m,).
    """
    predicted = apply(A, estimate) + apply(B, inputs)
    return predicted + apply(correction, measured - predicted)
