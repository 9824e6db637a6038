r"""Reduced models of a robot on a rolling ball: the paper's, and a stricter one.

Symbols (the paper's, and full-physics.md section 1 for the second model)
-------------------------------------------------------------------------
===========  =========================================  ==========
theta_1      roll angle of the ball                     [rad]
theta_2      place of the contact, relative to the ball [rad]
theta_4      swing of the pendulum about the wheel      [rad]
x, b, p      robot's CoM, ball's centre, CoP, along one
             horizontal axis of the world               [m]
h            height of the CoM over the ball's top      [m]
===========  =========================================  ==========

The paper's model (`WheeledLipParameters`) carries the contact force through the
centre of a massless wheel, r1 above the contact. In the limit r1 -> 0, I1 -> 0
it becomes the second model (`BallPendulumParameters`), whose force passes
through the contact itself, as a sole's does.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import scipy.linalg

from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import Array, BallParameters

__all__ = [
    "BallPendulumParameters",
    "StateMatrices",
    "WheeledLipParameters",
    "discretise",
    "equilibrium_direction",
    "gravity_matrix",
    "held_cop_matrix",
    "held_cop_wheeled_lip",
    "mass_matrix",
    "state_matrices",
    "velocity_direction",
    "wheeled_lip_matrices",
]


class StateMatrices(NamedTuple):
    """Matrices of a linear system x' = A x + B u, or x[k+1] = A x[k] + B u[k].

    Attributes:
        A: State matrix, shape (n, n).
        B: Input matrix, shape (n, m).
    """

    A: Array
    B: Array


def _require_positive(name: str, value: float) -> None:
    """Refuse a parameter that is not a positive finite number."""
    if not (np.isfinite(value) and value > 0.0):
        raise InvalidSettingError(name, value, "a positive finite number")


@dataclass(frozen=True, slots=True)
class WheeledLipParameters:
    """Parameters of the paper's wheeled linear inverted pendulum.

    The defaults of the robot are the paper's; it does not state its gravity.

    Attributes:
        ball_radius: r0, [m].
        ball_mass: m0, [kg].
        ball_inertia: I0 about the ball's centre, [kg m^2].
        robot_mass: m1, [kg].
        robot_inertia: I1 about the robot's CoM, [kg m^2]. M is singular for 0.
        wheel_radius: r1, [m].
        pendulum_length: L0 from the wheel's centre to the CoM, [m].
        gravity: g, [m/s^2].

    Source:
        Sections III-A and VI-B of the paper.

    Examples:
        >>> WheeledLipParameters(ball_radius=0.5).wheel_ratio
        6.0
    """

    ball_radius: float
    ball_mass: float = 40.0
    ball_inertia: float = 0.5
    robot_mass: float = 65.0
    robot_inertia: float = 0.5
    wheel_radius: float = 0.1
    pendulum_length: float = 0.8
    gravity: float = 9.81

    def __post_init__(self) -> None:
        """Refuse parameters that are not positive."""
        for item in fields(self):
            _require_positive(item.name, getattr(self, item.name))

    @property
    def wheel_ratio(self) -> float:
        """Return k = 1 + r0 / r1, wheel rotation per theta_2."""
        return 1.0 + self.ball_radius / self.wheel_radius


@dataclass(frozen=True, slots=True)
class BallPendulumParameters:
    """Parameters of the contact-consistent pendulum on a ball, one axis.

    Attributes:
        ball: Radius, mass and inertia of the ball.
        robot_mass: m1, [kg].
        com_height: Height h of the CoM over the ball's top, [m].
        gravity: g, [m/s^2].

    Source:
        full-physics.md section 1.
    """

    ball: BallParameters
    robot_mass: float
    com_height: float
    gravity: float = 9.81

    def __post_init__(self) -> None:
        """Refuse parameters that are not positive."""
        for name in ("radius", "mass", "inertia"):
            _require_positive(f"ball.{name}", getattr(self.ball, name))
        for name in ("robot_mass", "com_height", "gravity"):
            _require_positive(name, getattr(self, name))

    @property
    def natural_frequency_squared(self) -> float:
        """Return g / h of the pendulum on a fixed floor, [1/s^2]."""
        return self.gravity / self.com_height

    @property
    def ball_stiffness(self) -> float:
        """Return c = r0 m1 g / (I0 + m0 r0^2), [1/s^2]."""
        ball = self.ball
        rolling_inertia = ball.inertia + ball.mass * ball.radius**2
        return ball.radius * self.robot_mass * self.gravity / rolling_inertia


def mass_matrix(params: WheeledLipParameters) -> Array:
    """Return the mass matrix M of the paper's model.

    Args:
        params: Parameters of the wheeled pendulum.

    Returns:
        M for (theta_1, theta_2, theta_4), shape (3, 3), [kg m^2].

    Source:
        Equation (1).
    """
    m0, m1, k = params.ball_mass, params.robot_mass, params.wheel_ratio
    r0, r1 = params.ball_radius, params.wheel_radius
    I0, I1 = params.ball_inertia, params.robot_inertia
    L0 = params.pendulum_length
    L1 = 2.0 * r0 + r1 + L0
    L2 = r0 + r1 + k * L0
    lever = np.array([L1, L2, L0])
    turn = np.array([1.0, k, 1.0])
    M: Array = m1 * np.outer(lever, lever) + I1 * np.outer(turn, turn)
    M[0, 0] += m0 * r0**2 + I0
    return M


def gravity_matrix(params: WheeledLipParameters) -> Array:
    """Return the gravity matrix G of the paper's model.

    Args:
        params: Parameters of the wheeled pendulum.

    Returns:
        G for (theta_1, theta_2, theta_4), shape (3, 3), [N m/rad]; its null
        space is spanned by the first three entries of T.

    Source:
        Equation (1).
    """
    k, L0 = params.wheel_ratio, params.pendulum_length
    L3 = params.ball_radius + params.wheel_radius
    L2 = L3 + k * L0
    weight = params.robot_mass * params.gravity
    return -weight * np.array(
        [
            [L0 + L3, L2, L0],
            [L2, k**2 * L0 + L3, k * L0],
            [L0, k * L0, L0],
        ]
    )


def wheeled_lip_matrices(params: WheeledLipParameters) -> StateMatrices:
    r"""Return the state matrices of the paper's model with torque as input.

    .. math:: M \ddot\theta + G \theta = (0, \tau_2, 0)^T

    Args:
        params: Parameters of the wheeled pendulum.

    Returns:
        A, shape (6, 6), and B, shape (6, 1), for the state (theta_1, theta_2,
        theta_4 and their rates) in [rad] and [rad/s] and the input tau_2 in
        [N m]. The output y = C x is the first half of the state.

    Source:
        Equations (2) and (3).

    Examples:
        >>> A, B = wheeled_lip_matrices(WheeledLipParameters(ball_radius=0.5))
        >>> round(float(np.linalg.eigvals(A).real.max()), 3)  # [rad/s]
        49.036
    """
    M, G = mass_matrix(params), gravity_matrix(params)
    A = np.zeros((6, 6))
    A[:3, 3:] = np.eye(3)
    A[3:, :3] = -np.linalg.solve(M, G)
    B = np.zeros((6, 1))
    B[3:, 0] = np.linalg.solve(M, [0.0, 1.0, 0.0])
    return StateMatrices(A, B)


def held_cop_wheeled_lip(params: WheeledLipParameters) -> StateMatrices:
    r"""Return the paper's model with the contact's acceleration as input.

    The rows of theta_1 and theta_4 of (1) hold whatever tau_2 is; with theta_2
    given, they read

    .. math::
        M_{rr} \ddot\theta_r = -G_{rr} \theta_r - G_{r2} \theta_2
        - M_{r2} \ddot\theta_2 .

    This equals the erratum-free (18), A_s lower left =
    -M^-1 G + m2^T m2 G / m22, without the inverse of the stiff M.

    Args:
        params: Parameters of the wheeled pendulum.

    Returns:
        A_s, shape (6, 6), and B_s = (0, 0, 0, a1, 1, a3), shape (6, 1), for
        the input theta_2'' in [rad/s^2]; a = m2 / m22.

    Source:
        Equations (16)-(18) as mended in simplified-model.md, errata 4.
    """
    M, G = mass_matrix(params), gravity_matrix(params)
    free = [0, 2]
    free_mass = M[np.ix_(free, free)]
    A, B = np.zeros((6, 6)), np.zeros((6, 1))
    A[:3, 3:] = np.eye(3)
    A[np.ix_([3, 5], [0, 1, 2])] = -np.linalg.solve(free_mass, G[free, :])
    B[[3, 5], 0] = -np.linalg.solve(free_mass, M[free, 1])
    B[4, 0] = 1.0
    return StateMatrices(A, B)


def equilibrium_direction(params: WheeledLipParameters) -> Array:
    """Return T, which maps a roll angle of the ball to the state at rest there.

    Args:
        params: Parameters of the wheeled pendulum.

    Returns:
        T = (1, -1, r0/r1, 0, 0, 0), shape (6,); A T = 0.

    Source:
        Section III-B with its missing sixth entry.
    """
    ratio = params.ball_radius / params.wheel_radius
    return np.array([1.0, -1.0, ratio, 0.0, 0.0, 0.0])


def velocity_direction(params: WheeledLipParameters) -> Array:
    """Return T', the state's direction of constant rolling.

    Args:
        params: Parameters of the wheeled pendulum.

    Returns:
        T' = (0, 0, 0, 1, -1, r0/r1), shape (6,); A T' = T.

    Source:
        Section IV.
    """
    return np.roll(equilibrium_direction(params), 3)


def state_matrices(
    params: BallPendulumParameters, cop_lag: float | None = None
) -> StateMatrices:
    r"""Return the contact-consistent model, with the CoP in the world as input.

    .. math::
        \ddot x &= (g / h) (x - p) \\
        \ddot b &= c \, [(p - b) - (2 r_0 / h) (x - p)]

    With a lag time the CoP p becomes the fifth state, p' = (u - p) / lag.

    Args:
        params: Parameters of robot and ball.
        cop_lag: Time constant of the first-order lag from the commanded CoP u
            to the CoP p, [s]; None for none.

    Returns:
        A, shape (4, 4), and B, shape (4, 1), for the state (x, x', b, b') in
        [m] and [m/s] and the input p in [m]; with a lag (5, 5) and (5, 1) for
        (x, x', b, b', p) and the input u.

    Raises:
        InvalidSettingError: If the lag time is not positive.

    Assumes:
        Constant height of the CoM, no angular momentum about it, small angles,
        no slip at either contact.

    Examples:
        >>> ball = BallParameters(radius=0.5, mass=40.0, inertia=0.5)
        >>> A, B = state_matrices(BallPendulumParameters(ball, 65.0, 0.9))
        >>> A[1, 0] == -B[1, 0]  # a CoP under the CoM leaves it alone
        np.True_
    """
    w2, c = params.natural_frequency_squared, params.ball_stiffness
    tilt = 2.0 * params.ball.radius / params.com_height
    A = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [w2, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [-c * tilt, 0.0, -c, 0.0],
        ]
    )
    B = np.array([[0.0], [-w2], [0.0], [c * (1.0 + tilt)]])
    if cop_lag is None:
        return StateMatrices(A, B)
    _require_positive("cop_lag", cop_lag)
    lagged = np.zeros((5, 5))
    lagged[:4, :4], lagged[:4, 4:] = A, B
    lagged[4, 4] = -1.0 / cop_lag
    return StateMatrices(lagged, np.eye(5)[:, 4:] / cop_lag)


def held_cop_matrix(params: BallPendulumParameters) -> Array:
    """Return the state matrix with the CoP fixed to the ball's surface.

    A point carried along on the ball's top moves at twice the speed of the
    ball's centre: p = 2 b.

    Args:
        params: Parameters of robot and ball.

    Returns:
        Matrix of (x, x', b, b'), shape (4, 4). Its two unstable modes are the
        ball kicked out from under the feet (fast) and the fall (slow).

    Examples:
        >>> ball = BallParameters(radius=0.5, mass=40.0, inertia=0.5)
        >>> A = held_cop_matrix(BallPendulumParameters(ball, 65.0, 0.9))
        >>> [round(float(e), 2) for e in sorted(np.linalg.eigvals(A).real)]
        [-10.28, -1.77, 1.77, 10.28]
    """
    A, B = state_matrices(params)
    held: Array = A + B @ np.array([[0.0, 0.0, 2.0, 0.0]])
    return held


def discretise(A: Array, B: Array, dt: float) -> StateMatrices:
    """Return the exact discrete form for an input held over each step.

    Args:
        A: Continuous state matrix, shape (n, n).
        B: Continuous input matrix, shape (n, m).
        dt: Step, [s].

    Returns:
        Matrices of x[k+1] = A x[k] + B u[k], shapes (n, n) and (n, m).

    Examples:
        >>> A = np.array([[0.0, 1.0], [0.0, 0.0]])
        >>> discretise(A, np.array([[0.0], [1.0]]), 0.1).B.round(6).tolist()
        [[0.005], [0.1]]
    """
    _require_positive("dt", dt)
    n, m = B.shape
    augmented = np.zeros((n + m, n + m))
    augmented[:n, :n], augmented[:n, n:] = A, B
    step = scipy.linalg.expm(augmented * dt)
    return StateMatrices(step[:n, :n], step[:n, n:])
