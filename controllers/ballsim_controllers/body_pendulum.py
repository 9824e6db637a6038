r"""Wheeled LIP with legs and trunk: what the massless model leaves out.

The legs follow the ball. Their angular momentum about the CoM must come from
somewhere: from the trunk, which then tilts, or from the horizontal contact
force, which then deviates from the pendulum's and kicks the ball. The
whole-body layer shares it between the two by least squares
(`whole_body.forces`), which makes the body linear again, with the trunk's tilt
as two more states.

With the pendulum's acceleration :math:`a = (g / h)(x - p)`, the trunk's wanted
acceleration :math:`q = -k \varphi - d \dot\varphi` and
:math:`\tau = (\epsilon_b \ddot b - \epsilon_x a + \eta q) / (1 + \epsilon_x)`,

.. math::

    \ddot x &= a + (1 - s) \tau \\
    \ddot b &= c [(p - b) - (2 r_0 / g) \ddot x] \\
    \ddot\varphi &= q - (s / \eta') \tau, \qquad
    s = w \eta'^2 / (1 + w \eta'^2), \quad \eta' = \eta / (1 + \epsilon_x) .

Symbols: x CoM, b ball's centre, p CoP, :math:`\varphi` tilt of the trunk
(positive where its top moves against the axis), :math:`\epsilon` angular
momentum of the legs and :math:`\eta` of the trunk per speed, over
:math:`m h`; s share of the trunk, w price of a deviation of the CoM.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.wheeled_lip import BallPendulumParameters

__all__ = [
    "BALL",
    "COM",
    "COP",
    "STATE_SIZE",
    "TILT",
    "BodyCoupling",
    "SettledMotion",
    "TrunkResponse",
    "body_matrices",
    "capture_point",
    "compute_coupling",
]

#: States: x, x', b, b', p, tilt, tilt rate.
STATE_SIZE = 7
#: Place of the CoM's position in the state.
COM = 0
#: Place of the ball's position in the state.
BALL = 2
#: Place of the CoP in the state.
COP = 4
#: Place of the trunk's tilt in the state.
TILT = 5


@dataclass(frozen=True, slots=True)
class BodyCoupling:
    """Angular momentum about the CoM along one axis, over m h.

    Attributes:
        leg: Of one leg, per speed of its foot relative to the CoM.
        lift: Of one leg, per upward speed of its foot relative to the CoM; the part
            that both legs have alike.
        trunk: Of the trunk, per angular velocity, feet and CoM held, [m].
    """

    leg: float
    trunk: float
    lift: float = 0.0


@dataclass(frozen=True, slots=True)
class TrunkResponse:
    """How the whole-body layer treats the trunk.

    Attributes:
        stiffness: k, [1/s^2].
        damping: d, [1/s].
        compliance: w, price of a deviation of the CoM's acceleration over one
            of the trunk's angular acceleration, [rad^2/m^2].
    """

    stiffness: float
    damping: float
    compliance: float


def compute_coupling(
    robot_model: RobotModel, qpos: Array, com_height: float
) -> tuple[BodyCoupling, BodyCoupling]:
    """Return the coupling along and across the heading for a standing pose.

    Args:
        robot_model: The robot; its data are overwritten.
        qpos: The pose, trunk upright, shape (nq,).
        com_height: Height of the CoM over the soles, [m].

    Returns:
        Sagittal and lateral coupling.
    """
    robot, nv = robot_model, robot_model.model.nv
    robot.update(qpos, np.zeros(nv))
    jacobians = [robot.point_jacobian(i, robot.feet[i].position) for i in range(2)]

    def angular_momentum(base: Array, feet: Array) -> tuple[Array, Array]:
        velocity = np.zeros(nv)
        velocity[:6] = base
        for i, leg in enumerate(robot.leg_dofs):
            rest = feet[i] - jacobians[i][:, :6] @ base
            velocity[leg] = np.linalg.solve(jacobians[i][:, leg], rest)
        robot.update(qpos, velocity)
        com = robot.com_velocity()
        return com, robot.data.subtree_angmom[0].copy()

    scale = 1.0 / (robot.mass * com_height)
    result = []
    for axis, about, sign in ((0, 1, -1.0), (1, 0, 1.0)):
        feet = np.zeros((2, 6))
        feet[:, axis] = 1.0
        com, momentum = angular_momentum(np.zeros(6), feet)
        leg = 0.5 * sign * momentum[about] / (1.0 - com[axis])
        feet[:] = 0.0
        feet[:, 2] = 1.0
        com, momentum = angular_momentum(np.zeros(6), feet)
        # Lifting moves the CoM along the axis, too; seen from it the feet move back.
        shift = 2.0 * leg * com[axis]
        lift = 0.5 * (sign * momentum[about] + shift) / (1.0 - com[2])
        # A turn of the trunk with the feet held moves the CoM; seen from the
        # CoM the feet then move backwards, which is the legs' part.
        base = np.zeros(6)
        base[3 + about] = 1.0
        com, momentum = angular_momentum(base, np.zeros((2, 6)))
        trunk = sign * momentum[about] + 2.0 * leg * com[axis]
        result.append(BodyCoupling(leg * scale, abs(trunk) * scale, lift * scale))
    return result[0], result[1]


def body_matrices(
    params: BallPendulumParameters,
    coupling: BodyCoupling,
    trunk: TrunkResponse,
    cop_lag: float,
    carried_feet: float,
) -> tuple[Array, Array]:
    """Return the continuous model of one axis.

    Args:
        params: Parameters of robot and ball.
        coupling: Angular momentum of legs and trunk.
        trunk: How the trunk is treated.
        cop_lag: Time constant from the commanded CoP to the CoP, [s].
        carried_feet: Sum of both feet's speeds over that of the ball's centre:
            2 for each standing foot, 1 for a swinging one, on the mean.

    Returns:
        A, shape (7, 7), and B, shape (7, 2), for the state
        (x, x', b, b', p, tilt, tilt rate), the commanded CoP and the acceleration of
        a swinging foot relative to the ball's centre.
    """
    g, r0 = params.gravity, params.ball.radius
    w2, c = params.natural_frequency_squared, params.ball_stiffness
    leg_ball = carried_feet * coupling.leg
    leg_com = 2.0 * coupling.leg
    eta = coupling.trunk / (1.0 + leg_com)
    weight = trunk.compliance * eta * eta
    rest = 1.0 / (1.0 + weight)  # 1 - s
    lean = trunk.compliance * eta * rest  # s / eta'
    wanted = np.zeros(STATE_SIZE)
    wanted[5], wanted[6] = -trunk.stiffness, -trunk.damping
    lip, spring = np.zeros(STATE_SIZE), np.zeros(STATE_SIZE)
    lip[0], lip[4] = w2, -w2
    spring[2], spring[4] = -c, c
    # tau = pull b'' + given @ state
    pull = leg_ball / (1.0 + leg_com)
    given = eta * wanted - leg_com / (1.0 + leg_com) * lip
    # Rows of (x'', b''): left @ (x'', b'') = right @ state.
    reaction = coupling.leg / (1.0 + leg_com)
    left = np.array([[1.0, -rest * pull], [2.0 * r0 * c / g, 1.0]])
    right = np.vstack((lip + rest * given, spring))
    com, ball = np.linalg.solve(left, right)
    kick = np.linalg.solve(left, [rest * reaction, 0.0])
    A = np.zeros((STATE_SIZE, STATE_SIZE))
    A[0, 1] = A[2, 3] = A[5, 6] = 1.0
    A[1], A[3] = com, ball
    A[4, 4] = -1.0 / cop_lag
    A[6] = wanted - lean * (pull * ball + given)
    B = np.zeros((STATE_SIZE, 2))
    B[4, 0] = 1.0 / cop_lag
    B[[1, 3], 1] = kick
    B[6, 1] = -lean * (pull * kick[1] + reaction)
    return A, B


def capture_point(A: Array, B: Array) -> Array:
    r"""Return the capture point of the standing robot as a function of the state.

    With the CoP at q on the carried soles, :math:`u = q + 2 b`, the slow unstable
    mode :math:`l^T z` of rate :math:`\lambda` grows by

    .. math:: (l^T z)' = \lambda \, l^T z + l^T B \, q = l^T B \, (q - \kappa^T z).

    The soles can bring the robot back if, and only if, they reach beyond
    :math:`\kappa^T z` for long enough.

    Args:
        A: State matrix, shape (7, 7), see `body_matrices`.
        B: Effect of the commanded CoP, shape (7,).

    Returns:
        kappa, shape (7,).
    """
    held = A.copy()
    held[:, BALL] += 2.0 * B
    values, vectors = np.linalg.eig(held.T)
    unstable = [i for i in range(len(values)) if values[i].real > 1e-6]
    slow = min(unstable, key=lambda i: float(values[i].real))
    left = vectors[:, slow].real
    kappa: Array = -values[slow].real * left / (left @ B)
    return kappa


class SettledMotion:
    """States and CoP commands of a smoothly accelerating roll.

    The legs' and the trunk's part is left out: it vanishes at constant
    acceleration but for the feet's mean speed, which is that of the ball.

    Args:
        params: Parameters of robot and ball.
        cop_lag: Time constant from the commanded CoP to the CoP, [s].
    """

    def __init__(self, params: BallPendulumParameters, cop_lag: float) -> None:
        """Compute how far CoP and CoM lead the ball per acceleration."""
        lead = 1.0 / params.ball_stiffness + 2.0 * params.ball.radius / params.gravity
        self._leads = (lead, lead + params.com_height / params.gravity, cop_lag)

    def follow(
        self, motion: Array, scale: float = 1.0, shift: float = 0.0
    ) -> tuple[Array, Array]:
        """Return states and commanded CoP for a motion of the ball.

        Args:
            motion: Place, velocity, acceleration (and more, not used) per instant,
                shape (n, 3 or more).
            scale: Metres per unit of the motion: 1, or the ball's radius.
            shift: Added to every place, [m].

        Returns:
            States, shape (n, 7), and commanded CoP, shape (n,), [m].
        """
        states, inputs = np.zeros((len(motion), STATE_SIZE)), np.empty(len(motion))
        _settle(states, inputs, motion, scale, shift, *self._leads)
        return states, inputs


@compiled
def _settle(
    states: Array,
    inputs: Array,
    motion: Array,
    scale: float,
    shift: float,
    cop_lead: float,
    com_lead: float,
    cop_lag: float,
) -> None:
    """Write states, shape (n, 7), zero so far, and commanded CoP, shape (n,), [m]."""
    for k in range(len(motion)):
        position, velocity = scale * motion[k, 0] + shift, scale * motion[k, 1]
        acceleration = scale * motion[k, 2]
        cop = position + cop_lead * acceleration
        states[k, COM] = position + com_lead * acceleration
        states[k, COM + 1] = states[k, BALL + 1] = velocity
        states[k, BALL] = position
        states[k, COP] = cop
        inputs[k] = cop + cop_lag * velocity
