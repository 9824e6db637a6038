r"""How late readings may be before the linear balance loop is unstable.

``python -m ballsim.delay_margin`` prints for each ball the largest delay of all
readings, in whole control periods, that the loop of `balance` bears on paper: the
pendulum on the ball with legs, trunk and the CoP's lag, the observers, which get
readings that are d periods old, and the feedback, held over a cell of the preview,

.. math::
    z_{k+1} = A z_k + B u_k, \quad
    \hat x_k = (I - L) (A_o \hat x_{k-1} + B_o w_{k-d}) + L x_{k-d}, \quad
    u_k = -K (\hat x_k, p_k, \theta_{k-d}, \dot\theta_{k-d}) \text{ each cell.}

With the last d states as part of the state this is periodic with the cell, and stable
while the spectral radius of its product over a cell is below 1. Below the balance
there are the loops of the whole-body layer, accelerations :math:`-k e - d \dot e` of
trunk, height and swinging foot, each with the delay margin of a double integrator,

.. math::
    \omega^2 = \tfrac12 \left(d^2 + \sqrt{d^4 + 4 k^2}\right), \quad
    T = \arctan(d \omega / k) / \omega .

Soles have no edges here, the loops do not disturb each other, and errors of the
sensors do not count: what holds in full is less.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from ballsim.config import Config
from ballsim.config_io import load_config
from ballsim.error_model.standing import make_estimator
from ballsim.errors import ConfigError
from ballsim.module_parser import ModuleParser
from ballsim_controllers.balance.design import design_balance
from ballsim_controllers.body_pendulum import (
    COP,
    STATE_SIZE,
    TrunkResponse,
    body_matrices,
    compute_coupling,
)
from ballsim_controllers.messages import Array, BallParameters
from ballsim_controllers.settings import WheeledLipSettings, load_settings
from ballsim_controllers.wheeled_lip import BallPendulumParameters, discretise

__all__ = ["find_margins", "main", "pd_margin", "spectral_radius"]

_RADII = (0.25, 0.5, 0.75, 1.0)  # the paper's balls, [m]
_AXES = ("along", "across")
_CARRIED_FEET = {"both feet": 4.0, "one foot": 3.0}  # see `body_matrices`
_MOST = 40  # control periods
_LOOPS = {  # of the whole-body layer: stiffness and damping among the settings
    "swinging foot": ("swing_stiffness", "swing_damping"),
    "its attitude": ("swing_rotation_stiffness", "swing_rotation_damping"),
    "trunk": ("trunk_stiffness", "trunk_damping"),
    "height": ("height_stiffness", "height_damping"),
}


def pd_margin(stiffness: float, damping: float) -> float:
    """Return the delay that a double integrator under feedback bears, [s].

    Args:
        stiffness: k, [1/s^2], positive.
        damping: d, [1/s].
    """
    square = 0.5 * (damping**2 + math.hypot(damping**2, 2.0 * stiffness))
    crossover = math.sqrt(square)
    return math.atan(damping * crossover / stiffness) / crossover


def spectral_radius(
    plant: tuple[Array, Array],
    observer: tuple[Array, Array, Array],
    gain: Array,
    stride: int,
    delay: int,
) -> float:
    """Return the spectral radius of the loop over a cell; see the module.

    Args:
        plant: A, shape (7, 7), and B, shape (7, 1), over a control period.
        observer: A_o, B_o and L over a control period, shapes (4, 4), (4, 3), (4, 4).
        gain: K, shape (7,).
        stride: Control periods in a cell.
        delay: Age of the readings in control periods.
    """
    (A, B), (Ao, Bo, L) = plant, observer
    n, m = STATE_SIZE, COP
    k = n * (delay + 1)  # z now and at the last d periods, observer, command
    size = k + m + 1
    # What the controller gets: z of d periods ago, the state before the observer moves.
    old = np.zeros((n, size))
    old[:, k - n : k] = np.eye(n)
    keep = np.eye(m) - L
    see = keep @ Bo @ old[COP:] + L @ old[:COP]
    see[:, k : k + m] += keep @ Ao
    sees = np.eye(size)
    sees[k : k + m] = see
    command = np.eye(size)
    row = np.zeros(size)
    row[k : k + m] = -gain[:COP]
    row[COP] = -gain[COP]
    row -= gain[COP + 1 :] @ old[COP + 1 :]
    command[-1] = row
    moves = np.zeros((size, size))
    moves[:n, :n], moves[:n, -1:] = A, B
    moves[n:k, : k - n] = np.eye(k - n)
    moves[k:, k:] = np.eye(m + 1)
    product = moves @ command @ sees
    for _ in range(stride - 1):
        product = moves @ sees @ product
    return float(np.abs(np.linalg.eigvals(product)).max())


def find_margins(config: Config) -> dict[tuple[str, str], int]:
    """Return the largest stable delay by feet and axis, [control periods].

    -1 where the loop is not stable without a delay either.

    Args:
        config: A run with the controller ``wheeled-lip``.
    """
    period = config.simulation.control_period
    estimator, robot = make_estimator(config)
    settings = _load_settings(config)
    ball = BallParameters(
        config.ball.radius, config.ball.mass, config.ball.moment_of_inertia
    )
    height = estimator.nominal_com_height
    params = BallPendulumParameters(ball, robot.mass, height, robot.gravity)
    posture = estimator.stance.qpos
    axes = design_balance(settings, robot, params, posture, period)
    couplings = compute_coupling(robot, posture, params.com_height)
    forces = settings.forces
    compliances = (forces.pitch_compliance, forces.roll_compliance)
    stride = round(settings.rates.preview_period_s / period)
    margins = {}
    for name, axis, coupling, compliance in zip(
        _AXES, axes, couplings, compliances, strict=True
    ):
        trunk = TrunkResponse(forces.trunk_stiffness, forces.trunk_damping, compliance)
        for i, (feet, carried) in enumerate(_CARRIED_FEET.items()):
            lag = settings.balance.cop_lag_s
            A, B = body_matrices(params, coupling, trunk, lag, carried)
            plant = discretise(A, B[:, :1], period)
            record = axis.record[0]
            observer = (record["A"][i], record["B"][i], record["correction"][i])
            model = axis.model.double if i == 0 else axis.model.single
            delay = -1
            while delay < _MOST and (
                spectral_radius(
                    (plant.A, plant.B), observer, model.gain, stride, delay + 1
                )
                < 1.0
            ):
                delay += 1
            margins[feet, name] = delay
    return margins


def _load_settings(config: Config) -> WheeledLipSettings:
    own = config.controller.settings
    return load_settings(WheeledLipSettings, "wheeled-lip", own)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; see the module.

    Args:
        arguments: Words of the command line, those of the process if None.
    """
    parser = ModuleParser("delay_margin", __doc__)
    text = "radii of the balls, [m]"
    parser.add_argument(
        "--radii", nargs="+", type=float, default=_RADII, metavar="R", help=text
    )
    options = parser.parse_args(arguments)
    table = Table(box=None, pad_edge=False)
    for head in ("radius m", "feet", *(f"{axis} ms" for axis in _AXES)):
        table.add_column(head, justify="right")
    try:
        for radius in options.radii:
            given = [f"ball.radius_m={radius}", *options.overrides]
            config = load_config("stand", given).config
            period = 1e3 * config.simulation.control_period
            margins = find_margins(config)
            for feet in _CARRIED_FEET:
                delays = (f"{period * margins[feet, axis]:g}" for axis in _AXES)
                table.add_row(f"{radius:g}", feet, *delays)
    except ConfigError as error:
        parser.complain(error)
        return 2
    console = Console(highlight=False, width=100)
    console.print(table)
    forces = _load_settings(config).forces
    for loop, (stiffness, damping) in _LOOPS.items():
        margin = pd_margin(getattr(forces, stiffness), getattr(forces, damping))
        console.print(f"{loop}: {1e3 * margin:.0f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
