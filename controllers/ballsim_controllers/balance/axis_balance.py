"""Balance controller of one horizontal axis: observer and feedback gains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.balance.mirrored_poles import compute_mirrored_poles
from ballsim_controllers.balance.observer import (
    BallPendulumObserver,
    update_observer,
)
from ballsim_controllers.balance.pole_assignment import place_poles
from ballsim_controllers.body_pendulum import (
    COP,
    STATE_SIZE,
    TILT,
    BodyCoupling,
    TrunkResponse,
    body_matrices,
    capture_point,
)
from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.axis_model import AxisModel, CellModel
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.wheeled_lip import (
    BallPendulumParameters,
    StateMatrices,
    discretise,
)

__all__ = ["AXIS", "AxisBalance", "AxisDesign", "follow_cop", "observe_axis"]

_DOUBLE_FEET = 4.0  # both feet are carried at twice the ball's speed
_SINGLE_FEET = 3.0  # one is, the other swings at the ball's speed on the mean
_LARGEST_ERROR = 0.02  # of the CoP that is made up for, [m]: more is a foot in the air


@dataclass(frozen=True, slots=True)
class AxisDesign:
    """What the balance of one axis is designed from.

    Attributes:
        params: Parameters of robot and ball.
        coupling: Angular momentum of legs and trunk.
        trunk: How the whole-body layer treats the trunk.
        cop_lag: Time constant from the commanded CoP to the CoP, [s].
        cop_lead: What the ankles add to it, and is made up for, [s].
        cop_feedback: Share of the CoP's error that is added to what is asked for.
        feedback_poles: Poles that pendulum and ball shall have, four, [rad/s]; empty
            for the mirror image of the model's unstable modes.
        trunk_poles: The pair that the trunk's tilt shall have while both feet stand
            and no step is wanted, [rad/s]; None to leave the trunk to itself.
        observer_pole: Pole of every channel of the observer, [rad/s].
        are_feet_apart: Whether the CoP jumps when a foot leaves the ball: it comes
            from between the feet, and one sole is left.
        cell: Length of a cell of the preview, [s].
        period: Control period, [s].
    """

    params: BallPendulumParameters
    coupling: BodyCoupling
    trunk: TrunkResponse
    cop_lag: float
    cop_lead: float
    cop_feedback: float
    feedback_poles: tuple[float, ...]
    trunk_poles: tuple[complex, complex] | None
    observer_pole: float
    are_feet_apart: bool
    cell: float
    period: float


#: Observer of one axis, for double and for single support, and what it keeps.
AXIS = np.dtype(
    [
        ("A", np.float64, (2, 4, 4)),
        ("B", np.float64, (2, 4, 3)),
        ("correction", np.float64, (2, 4, 4)),
        ("share", np.float64),  # of the way to a commanded CoP in one period
        ("lead", np.float64),  # of the same way that is asked for ahead of the lag
        ("feedback", np.float64),  # of the CoP's error
        ("jumps", np.int64),  # whether the CoP does as a foot leaves the ball
        ("has_started", np.int64),
        ("estimate", np.float64, 4),
        ("lagged_cop", np.float64),
        ("cop_error", np.float64),  # the lagged CoP less the measured one, [m]
    ]
)


class AxisBalance:
    """Observer and feedback of one axis.

    The poles of the feedback are placed on the discrete model of pendulum and
    ball; the CoP's lag keeps its own. The trunk has a part in observer and
    prediction, and where its poles are given also in the feedback of both feet of a
    robot that is to come to rest: it answers the legs' angular momentum, and left to
    itself sways, and the ball with it. On a single foot, and in a walk, it has none:
    there its motion is the swinging legs', and the soles have no room to answer.

    Args:
        design: What to design from.

    Attributes:
        model: Model and feedback over a cell of the preview.
        record: Observer and its state, shape (1,), dtype `AXIS`.
    """

    def __init__(self, design: AxisDesign) -> None:
        """Place the poles of feedback and observer."""
        double, observer_double = _design(design, _DOUBLE_FEET)
        single, observer_single = _design(design, _SINGLE_FEET)
        A, B = _body_matrices(design, _DOUBLE_FEET)
        capture = capture_point(A, B[:, 0])
        self.model = AxisModel(
            double,
            single,
            design.cell,
            capture,
            design.coupling.lift / design.coupling.leg,
            _design_resting(design),
            single.pass_load() if design.are_feet_apart else None,
        )
        self.record: Record = np.zeros(1, AXIS)
        for i, observer in enumerate((observer_double, observer_single)):
            self.record["A"][0, i] = observer.step.A
            self.record["B"][0, i] = observer.step.B
            self.record["correction"][0, i] = observer.correction
        self.record["share"] = 1.0 - np.exp(-design.period / design.cop_lag)
        self.record["lead"] = design.cop_lead / design.cop_lag
        self.record["feedback"] = design.cop_feedback
        self.record["jumps"] = design.are_feet_apart

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
        inputs = np.array([cop, *tilt])
        return _observe_axis(self.record, measured, inputs, is_single)

    def follow(self, command: float, lifts_off: bool = False) -> float:
        """Advance the lagged CoP towards a command; return the CoP to ask for, [m]."""
        return float(follow_cop(self.record, np.array([command]), lifts_off)[0])


@compiled
def _observe_axis(
    axes: Record, measured: Array, inputs: Array, is_single: bool
) -> Array:
    """Observe a single axis from Python; see `observe_axis`."""
    state = np.empty(STATE_SIZE)
    observe_axis(axes[0], state, measured, inputs, is_single)
    return state


@compiled
def observe_axis(
    axis: Record, state: Array, measured: Array, inputs: Array, is_single: bool
) -> None:
    """Write the state of an axis, one control period after the last call.

    Args:
        axis: Observer of the axis, dtype `AXIS`.
        state: The result (x, x', b, b', p, tilt, tilt rate), shape (7,).
        measured: CoM and ball with their velocities, (x, x', b, b'), (4,).
        inputs: Measured CoP, [m], tilt, [rad], and its rate, [rad/s], shape (3,).
        is_single: True in single support.
    """
    estimate, support = axis["estimate"], 1 if is_single else 0
    if axis["has_started"] == 0:
        axis["has_started"] = 1
        estimate[:] = measured
        axis["lagged_cop"] = inputs[0]
    else:
        estimate[:] = update_observer(
            axis["A"][support],
            axis["B"][support],
            axis["correction"][support],
            estimate,
            measured,
            inputs,
        )
    axis["cop_error"] = axis["lagged_cop"] - inputs[0]
    state[:COP] = estimate
    state[COP] = axis["lagged_cop"]
    state[TILT:] = inputs[1:]


@compiled
def follow_cop(axes: Record, commands: Array, lifts_off: bool) -> Array:
    """Advance the lagged CoPs by one control period towards their commands.

    What is to be asked for is ahead of them by the lead time, ``p + lead p'``: the
    damping of the ankles, which the rolling foot has to overcome, delays it. By how
    much the measured CoP is still off, with this and with feet that take over their
    load late, is added. As a foot leaves the ball, the CoP passes to the other one at
    once, where the feet are apart.

    Args:
        axes: Observers of the axes, shape (n,), dtype `AXIS`.
        commands: Commanded CoP of each axis, shape (n,), [m].
        lifts_off: Whether a foot leaves the ball now.

    Returns:
        The CoPs to ask for, shape (n,), [m].
    """
    result = np.empty(len(commands))
    for i in range(len(commands)):
        axis = axes[i]
        error = clip(axis["cop_error"], -_LARGEST_ERROR, _LARGEST_ERROR)
        share = 1.0 if lifts_off and axis["jumps"] == 1 else axis["share"]
        axis["lagged_cop"] += share * (commands[i] - axis["lagged_cop"])
        result[i] = (
            axis["lagged_cop"]
            + axis["lead"] * (commands[i] - axis["lagged_cop"])
            + axis["feedback"] * error
        )
    return result


def _body_matrices(design: AxisDesign, carried_feet: float) -> tuple[Array, Array]:
    return body_matrices(
        design.params, design.coupling, design.trunk, design.cop_lag, carried_feet
    )


def _design(
    design: AxisDesign, carried_feet: float
) -> tuple[CellModel, BallPendulumObserver]:
    """Return cell model and observer for one kind of support, the trunk left out."""
    A, B = _body_matrices(design, carried_feet)
    cell = _place(design, A, B, _find_poles(design))
    known = StateMatrices(A[:COP, :COP], A[:COP, COP:])
    observer = BallPendulumObserver(known, design.period, design.observer_pole)
    return cell, observer


def _design_resting(design: AxisDesign) -> CellModel | None:
    """Return the cell model of both feet with the trunk's part in the feedback."""
    if design.trunk_poles is None:
        return None
    A, B = _body_matrices(design, _DOUBLE_FEET)
    return _place(design, A, B, (*_find_poles(design), *design.trunk_poles))


def _find_poles(design: AxisDesign) -> tuple[complex, ...]:
    poles = design.feedback_poles or compute_mirrored_poles(design.params)
    return (*poles, -1.0 / design.cop_lag)


def _place(
    design: AxisDesign, A: Array, B: Array, poles: tuple[complex, ...]
) -> CellModel:
    """Return the model over a cell, the first states' poles placed, the rest left."""
    size, whole = len(poles), discretise(A, B, design.cell)
    core = discretise(A[:size, :size], B[:size, :1], design.cell)
    gain = np.zeros(STATE_SIZE)
    discrete = [complex(np.exp(pole * design.cell)) for pole in poles]
    gain[:size] = place_poles(core.A, core.B, discrete)[0]
    return CellModel(whole.A, whole.B[:, 0], whole.B[:, 1], gain)
