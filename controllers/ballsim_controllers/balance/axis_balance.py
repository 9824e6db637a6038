"""Balance controller of one horizontal axis: observer and feedback gains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.balance.mirrored_poles import compute_mirrored_poles
from ballsim_controllers.balance.observer import BallPendulumObserver
from ballsim_controllers.balance.pole_assignment import place_poles
from ballsim_controllers.body_pendulum import (
    STATE_SIZE,
    TILT,
    BodyCoupling,
    TrunkResponse,
    body_matrices,
)
from ballsim_controllers.footsteps.axis_model import AxisModel, CellModel
from ballsim_controllers.messages import Array
from ballsim_controllers.wheeled_lip import (
    BallPendulumParameters,
    StateMatrices,
    discretise,
)

__all__ = ["AxisBalance", "AxisDesign"]

_DOUBLE_FEET = 4.0  # both feet are carried at twice the ball's speed
_SINGLE_FEET = 3.0  # one is, the other swings at the ball's speed on the mean
_COP = 4  # place of the CoP in the state


@dataclass(frozen=True, slots=True)
class AxisDesign:
    """What the balance of one axis is designed from.

    Attributes:
        params: Parameters of robot and ball.
        coupling: Angular momentum of legs and trunk.
        trunk: How the whole-body layer treats the trunk.
        cop_lag: Time constant from the commanded CoP to the CoP, [s].
        feedback_poles: Four poles of the feedback, [rad/s]; empty for the
            mirror image of the model's unstable modes.
        observer_pole: Pole of every channel of the observer, [rad/s].
        cell: Length of a cell of the preview, [s].
        period: Control period, [s].
    """

    params: BallPendulumParameters
    coupling: BodyCoupling
    trunk: TrunkResponse
    cop_lag: float
    feedback_poles: tuple[float, ...]
    observer_pole: float
    cell: float
    period: float


class AxisBalance:
    """Observer and feedback of one axis.

    The poles of the feedback are placed on the discrete model of pendulum and
    ball with the trunk held; the CoP's lag keeps its own. The trunk has no
    part in the feedback, but in observer and prediction.

    Args:
        design: What to design from.
    """

    def __init__(self, design: AxisDesign) -> None:
        """Place the poles of feedback and observer."""
        double, observer_double = _design(design, _DOUBLE_FEET)
        single, observer_single = _design(design, _SINGLE_FEET)
        self.model = AxisModel(double=double, single=single)
        self._observers = (observer_double, observer_single)
        self._share = 1.0 - float(np.exp(-design.period / design.cop_lag))
        self._estimate: Array | None = None
        self._inputs = np.zeros(3)  # CoP, tilt, tilt rate
        #: CoP that follows the command with the lag of the ankles, [m].
        self.lagged_cop = 0.0

    def observe(
        self, measured: Array, cop: float, tilt: tuple[float, float], is_single: bool
    ) -> Array:
        """Return the state, one control period after the last call.

        Args:
            measured: CoM and ball with their velocities, (x, x', b, b'), (4,).
            cop: Measured CoP, [m].
            tilt: Trunk's tilt, [rad], and its rate, [rad/s], positive where its
                top moves against the axis.
            is_single: True in single support.

        Returns:
            State (x, x', b, b', p, tilt, tilt rate), shape (7,).
        """
        inputs = self._inputs
        inputs[0], inputs[1], inputs[2] = cop, *tilt
        if self._estimate is None:
            self._estimate = measured.copy()
            self.lagged_cop = cop
        else:
            observer = self._observers[int(is_single)]
            self._estimate = observer.update(self._estimate, measured, inputs)
        state = np.empty(STATE_SIZE)
        state[:_COP] = self._estimate
        state[_COP] = self.lagged_cop
        state[TILT:] = inputs[1:]
        return state

    def follow(self, command: float) -> float:
        """Advance the lagged CoP by one control period towards a command, [m]."""
        self.lagged_cop += self._share * (command - self.lagged_cop)
        return self.lagged_cop


def _design(
    design: AxisDesign, carried_feet: float
) -> tuple[CellModel, BallPendulumObserver]:
    """Return cell model and observer for one kind of support."""
    A, B = body_matrices(
        design.params, design.coupling, design.trunk, design.cop_lag, carried_feet
    )
    poles = design.feedback_poles or compute_mirrored_poles(design.params)
    wanted = (*poles, -1.0 / design.cop_lag)
    core = discretise(A[:TILT, :TILT], B[:TILT], design.cell)
    gain = np.zeros(STATE_SIZE)
    discrete = [float(np.exp(pole * design.cell)) for pole in wanted]
    gain[:TILT] = place_poles(core.A, core.B, discrete)[0]
    whole = discretise(A, B, design.cell)
    known = StateMatrices(A[:_COP, :_COP], A[:_COP, _COP:])
    observer = BallPendulumObserver(known, design.period, design.observer_pole)
    return CellModel(whole.A, whole.B[:, 0], gain), observer
