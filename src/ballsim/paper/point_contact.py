r"""The paper's feedback on a contact that transmits no moment.

In the paper's model the contact force passes through the wheel's centre, r1
above the contact: the contact transmits a moment, as no point can. Here K acts
on the contact-consistent pendulum instead, with the paper's own rule for the
contact, (16) and (4):

.. math:: \ddot\theta_2 = m_{22} K (T \theta_1^* - x) - m_2 G \theta
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ballsim_controllers.balance.paper_controller import PaperBalanceController
from ballsim_controllers.messages import Array, BallParameters
from ballsim_controllers.wheeled_lip import (
    BallPendulumParameters,
    WheeledLipParameters,
    state_matrices,
)

__all__ = ["angles_from_places", "point_contact_poles"]


def angles_from_places(params: WheeledLipParameters) -> Array:
    r"""Return the matrix from (x, b, theta_2) to (theta_1, theta_2, theta_4).

    .. math:: x = L_1 \theta_1 + L_2 \theta_2 + L_0 \theta_4, \qquad b = r_0 \theta_1

    Args:
        params: Parameters of the wheeled pendulum.

    Returns:
        Matrix, shape (3, 3).

    Source:
        Section III-A, to first order.
    """
    r0, r1, L0 = params.ball_radius, params.wheel_radius, params.pendulum_length
    L1, L2 = 2.0 * r0 + r1 + L0, r0 + r1 + params.wheel_ratio * L0
    places = np.array([[L1, L2, L0], [r0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return np.linalg.inv(places)


def point_contact_poles(
    params: WheeledLipParameters,
) -> npt.NDArray[np.complex128]:
    """Return the poles of the paper's state feedback on a point contact.

    Args:
        params: Parameters that K is computed from. The pendulum that it acts on
            has its CoM L0 + r1 over the ball's top.

    Returns:
        Six poles, sorted, complex, [rad/s]. On the paper's own model they would
        be those of Section VI-B.
    """
    balance = PaperBalanceController(params)
    ball = BallParameters(params.ball_radius, params.ball_mass, params.ball_inertia)
    plant = state_matrices(
        BallPendulumParameters(
            ball,
            params.robot_mass,
            params.pendulum_length + params.wheel_radius,
            params.gravity,
        )
    )
    # State (x, x', b, b', theta_2, theta_2'); the CoP is p = 2 b + r0 theta_2.
    places, rates = [0, 2, 4], [1, 3, 5]
    to_angles, to_state = angles_from_places(params), np.zeros((6, 6))
    to_state[np.ix_([0, 1, 2], places)] = to_angles
    to_state[np.ix_([3, 4, 5], rates)] = to_angles
    closed = np.zeros((6, 6))
    closed[:4, :4] = plant.A
    cop = np.array([0.0, 0.0, 2.0, 0.0, params.ball_radius, 0.0])
    closed[:4] += np.outer(plant.B[:, 0], cop)
    closed[4, 5] = 1.0
    A, B = balance.model
    closed[5] = (A - B @ balance.gain)[4] @ to_state
    return np.sort_complex(np.linalg.eigvals(closed).astype(np.complex128))
