r"""The paper's loop without its planner: linear, hence judged by eigenvalues.

The feet realise the ideal CoP, but late: the plant's theta_2 is the estimate's,
a number of steps ago. Without any delay the loop has the poles of A - B K and
the echo zeros of F; with one it keeps neither.
"""

from __future__ import annotations

import numpy as np

from ballsim.paper.planar_plant import PlanarPlant, PlanarState
from ballsim_controllers.balance.paper_controller import PaperBalanceController
from ballsim_controllers.messages import Array

__all__ = ["loop_growth", "loop_matrix", "tolerated_delay"]

_N_ESTIMATE = 6
_N_PLANT = 5


def loop_matrix(
    balance: PaperBalanceController, dt: float, delay_ticks: int = 0
) -> Array:
    """Return the matrix of one step of the loop.

    Controller and plant are linear: their matrices are what they do to unit
    vectors. The state is the estimate (6), the plant (z1, z3, z1', z3',
    theta_2), and the contacts on their way, oldest first.

    Args:
        balance: Balance controller.
        dt: Step, [s].
        delay_ticks: Steps from the ideal theta_2 to the plant's.

    Returns:
        Matrix, shape (11 + delay_ticks, 11 + delay_ticks).
    """
    n = _N_ESTIMATE + _N_PLANT + delay_ticks
    plant = PlanarPlant(balance.params)
    columns = [_step(balance, plant, dt, unit) for unit in np.eye(n)]
    return np.array(columns).T


def _step(
    balance: PaperBalanceController, plant: PlanarPlant, dt: float, state: Array
) -> Array:
    """Return the state one step later."""
    before = state[:_N_ESTIMATE]
    z1, z3, w1, w3, contact = state[_N_ESTIMATE : _N_ESTIMATE + _N_PLANT].tolist()
    pending = state[_N_ESTIMATE + _N_PLANT :].tolist()
    present = PlanarState((z1, z3), (w1, w3), contact)
    estimate = balance.update(before, plant.angles(present), 0.0, dt)
    pending.append(float(estimate[1]))
    after = plant.step(present, pending.pop(0), dt)
    moved = (*after.reduced, *after.reduced_rates, after.contact)
    return np.array([*estimate, *moved, *pending])


def loop_growth(
    balance: PaperBalanceController, dt: float, delay_ticks: int = 0
) -> float:
    """Return the growth rate of the loop's fastest growing mode.

    Args:
        balance: Balance controller.
        dt: Step, [s].
        delay_ticks: Steps from the ideal theta_2 to the plant's.

    Returns:
        log |largest eigenvalue| / dt, [1/s]; negative if the loop is stable.
    """
    eigenvalues = np.linalg.eigvals(loop_matrix(balance, dt, delay_ticks))
    return float(np.log(np.abs(eigenvalues).max()) / dt)


def tolerated_delay(
    balance: PaperBalanceController, dt: float = 1e-3, most_ticks: int = 50
) -> float | None:
    """Return the longest delay of the CoP with which the loop is stable.

    Args:
        balance: Balance controller.
        dt: Step of the loop, which is the resolution of the result, [s].
        most_ticks: Longest delay that is tried, in steps.

    Returns:
        The delay, [s]; None if the loop is unstable even without one.

    Source:
        "Delay" of simplified-model.md section 6.
    """
    for ticks in range(most_ticks + 1):
        if loop_growth(balance, dt, ticks) >= 0.0:
            return None if ticks == 0 else (ticks - 1) * dt
    return most_ticks * dt
