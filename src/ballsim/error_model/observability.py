r"""Which states and biases the sensors can tell of a robot that stands at rest.

Unknown are the state x, constant biases b of all channels, and constant errors u of the
drives' set-points: a drive does not hold its joint where it is told to, and closes its
loop on the encoder whose bias is in question. With the physics of `standing_physics`,

.. math:: x' = A x + B u, \quad u' = u, \quad b' = b, \quad y = C x + D u + b .

What does not change y at all, whatever sensors there are, is a change of equilibrium
(x, u) that the biases make up for,

.. math:: (A - I) x + B u = 0, \qquad b = -(C x + D u) ,

the space N of the unobservable directions: the null space of the observability matrix
at the eigenvalue 1 [Hautus's test]. It holds the symmetries, whose b is 0 (place and
heading of the whole, attitude of the ball), and one direction for each joint: another
posture, whose encoders, attitude and contact forces are those of the first one but for
biases. All other directions are found out from y sooner or later. Within N nothing but
what is known beforehand tells them apart: from biases of covariance S there is left

.. math:: P = N_b (N_b^T S^{-1} N_b)^+ N_b^T .
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim.error_model.standing_physics import StandingPhysics
from ballsim_controllers.messages import Array

__all__ = ["Unobservable", "find_unobservable", "remaining_std"]

_TOLERANCE = 1e-9  # of a singular value, relative to the largest one


@dataclass(frozen=True, slots=True)
class Unobservable:
    """Directions that no sensor sees, as columns.

    Attributes:
        states: State x, shape (2 nv, k).
        inputs: Set-points u, shape (nu, k), [rad].
        biases: What the biases have to be, shape (m, k).
        n_symmetries: Columns that need neither inputs nor biases: the first ones.
    """

    states: Array
    inputs: Array
    biases: Array
    n_symmetries: int


def find_unobservable(physics: StandingPhysics) -> Unobservable:
    """Return the unobservable directions of a robot at rest.

    Args:
        physics: Robot, ball and sensors.
    """
    rest = physics.A - np.eye(len(physics.A))
    symmetries = _find_null_space(rest)
    k = symmetries.shape[1]
    # Other equilibria, one for each set-point, without any part along the symmetries.
    postures = np.linalg.lstsq(rest, -physics.B, rcond=_TOLERANCE)[0]
    states = np.hstack([symmetries, postures])
    inputs = np.hstack([np.zeros((len(physics.ctrl), k)), np.eye(len(physics.ctrl))])
    biases = -(physics.C @ states + physics.D @ inputs)
    return Unobservable(states, inputs, biases, k)


def remaining_std(unobservable: Unobservable, prior_std: Array) -> Array:
    """Return what standing at rest leaves of the biases' standard deviations, (m,).

    Args:
        unobservable: The unobservable directions.
        prior_std: Standard deviations beforehand, shape (m,), positive.
    """
    postures = unobservable.biases[:, unobservable.n_symmetries :]
    # The scaled biases lie in this range: their covariance is the projector on it.
    basis, _ = np.linalg.qr(postures / prior_std[:, None])
    left: Array = prior_std * np.sqrt(np.sum(basis * basis, axis=1))
    return left


def _find_null_space(matrix: Array) -> Array:
    """Return an orthonormal basis of a square matrix's null space, shape (n, k)."""
    _, values, rows = np.linalg.svd(matrix)
    basis: Array = rows[values < _TOLERANCE * values[0]].T
    return basis
