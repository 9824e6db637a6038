"""Model of one horizontal axis over the cells of a preview."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ballsim_controllers.body_pendulum import BALL, COP, STATE_SIZE
from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.quintic import mean_acceleration
from ballsim_controllers.messages import Array, IntArray

__all__ = [
    "KNOWN_SIZE",
    "ONE",
    "SOLES",
    "STANDING",
    "SWING",
    "SWINGING",
    "AxisModel",
    "CellModel",
    "Prediction",
    "SwingCells",
    "predict",
]

#: Place of the soles (left, right) in what is known at the start of a preview.
SOLES = STATE_SIZE
#: Place of the swinging sole's offset from the ball's centre, velocity, acceleration.
SWING = SOLES + 2
#: Place of a constant 1, by which what lifting the feet does is known.
ONE = SWING + 3
#: Size of what is known: state of the axis, soles, swinging sole, the constant.
KNOWN_SIZE = ONE + 1
#: Origin of a swing: the foot is in the air already, ...
SWINGING = -2
#: ... or stands where it stands now; otherwise a landing.
STANDING = -1


@dataclass(frozen=True, slots=True)
class CellModel:
    """Discrete model of one axis over one cell, with its feedback.

    Attributes:
        transition: State matrix over the cell, shape (7, 7).
        input: Effect of the commanded CoP, shape (7,).
        swing: Effect of the swinging foot's acceleration relative to the ball's
            centre, shape (7,).
        gain: Feedback K of the ideal CoP, shape (7,).
    """

    transition: Array
    input: Array
    swing: Array
    gain: Array

    def pass_load(self) -> CellModel:
        """Return the model of a cell at whose start a foot hands over its load.

        The CoP is where it is commanded at once, ``p := u``: the foot that is left
        bears all, and its sole is there.
        """
        transition, input_ = self.transition.copy(), self.input.copy()
        input_ += transition[:, COP]
        transition[:, COP] = 0.0
        return replace(self, transition=transition, input=input_)


@dataclass(frozen=True, slots=True)
class AxisModel:
    """Model of one axis: the legs weigh differently in single and double support.

    Attributes:
        double: Both feet stand.
        single: One foot swings.
        cell: Length of a cell, [s].
        capture: Capture point of the standing robot by the state, shape (7,): the CoP,
            less twice the ball's place, that keeps the slow unstable mode as it is
            while the ball carries the CoP along.
        lift: Acceleration of a foot along the axis that an upward one is worth, by
            the angular momentum that both take.
        resting: Both feet stand, and no step is wanted: the same model, with the
            trunk's part in the feedback; None where the trunk has none.
        lift_off: The cell in which a foot leaves the ball; None where it is like
            those that follow.
    """

    double: CellModel
    single: CellModel
    cell: float
    capture: Array
    lift: float = 0.0
    resting: CellModel | None = None
    lift_off: CellModel | None = None

    @property
    def first_single(self) -> CellModel:
        """Return the model of the cell in which a foot leaves the ball."""
        return self.single if self.lift_off is None else self.lift_off

    def rest(self) -> AxisModel:
        """Return the model for a robot that is to come to rest."""
        return self if self.resting is None else replace(self, double=self.resting)


@dataclass(frozen=True, slots=True)
class SwingCells:
    """A swing that ends within the horizon.

    Attributes:
        foot: 0 = left, 1 = right.
        origin: SWINGING, STANDING, or the landing that the foot stands on before.
        landing: The landing that ends the swing.
        first: Its first cell.
        count: Its cells; those that are left of a swing under way.
    """

    foot: int
    origin: int
    landing: int
    first: int
    count: int


@dataclass(frozen=True, slots=True)
class Prediction:
    """Motion over N cells under the feedback, ``u_k = r_k + v_k - K_k z_k``.

    All is linear in what is known at the start (`KNOWN_SIZE` columns), in the n
    landings and in r + v (N): the columns of the matrices, in this order.

    Attributes:
        states: z_k, shape (N + 1, 7, KNOWN_SIZE + n + N).
        commands: u_k, shape (N, KNOWN_SIZE + n + N).
        gains: K_k, shape (N, 7).
    """

    states: Array
    commands: Array
    gains: Array


def predict(
    model: AxisModel,
    is_double: Sequence[bool],
    landing_cells: Sequence[int] = (),
    swings: Sequence[SwingCells] = (),
    lifting: Sequence[float] = (),
    lift_cells: Sequence[int] = (),
) -> Prediction:
    """Return the prediction for a sequence of supports.

    Args:
        model: Model and feedback of the axis.
        is_double: Whether both feet stand, per cell.
        landing_cells: Cell at whose start each foot lands.
        swings: The swings that end within the horizon.
        lifting: Upward acceleration in each cell of a whole swing, [m/s^2]; nothing
            for feet that are not lifted.
        lift_cells: Cells at whose start a foot leaves the ball.
    """
    models = (model.single, model.double, model.first_single)
    supports = np.array(is_double, dtype=np.int_)
    supports[list(lift_cells)] = 2
    gains = np.array([models[kind].gain for kind in supports])
    table = [(s.foot, s.origin, s.landing, s.first, s.count) for s in swings]
    states, commands = _predict(
        supports,
        np.array([cell.transition for cell in models]),
        np.array([cell.input for cell in models]),
        np.array([cell.swing for cell in models]),
        np.array([cell.gain for cell in models]),
        np.array((*landing_cells, 0)),  # never without a number
        np.array(table, dtype=np.int_).reshape(len(swings), 5),
        model.lift * np.array(lifting, dtype=np.float64),
        model.cell,
    )
    return Prediction(states, commands, gains)


@compiled
def _predict(
    supports: IntArray,
    transitions: Array,
    inputs: Array,
    reactions: Array,
    gains: Array,
    landing_cells: IntArray,
    swings: IntArray,
    lifting: Array,
    cell: float,
) -> tuple[Array, Array]:
    """Return states and commands of a `Prediction`.

    Args:
        supports: Kind of support of each cell, shape (N,).
        transitions: Per kind of support, shape (3, 7, 7).
        inputs: Per kind of support, shape (3, 7).
        reactions: Effect of the swinging foot per kind of support, shape (3, 7).
        gains: Per kind of support, shape (3, 7).
        landing_cells: Cell of each landing, and a last entry of no meaning.
        swings: Fields of `SwingCells`, shape (m, 5).
        lifting: What lifting the foot is worth in each cell of a whole swing, (l,).
        cell: Length of a cell, [s].
    """
    n, size, n_landings = len(supports), inputs.shape[1], len(landing_cells) - 1
    first_input = KNOWN_SIZE + n_landings
    width = first_input + n
    states, commands = np.zeros((n + 1, size, width)), np.zeros((n, width))
    for i in range(size):
        states[0, i, i] = 1.0
    acceleration = np.empty(width)
    for k in range(n):
        kind = supports[k]
        for i in range(size):
            for j in range(width):
                commands[k, j] -= gains[kind, i] * states[k, i, j]
        commands[k, first_input + k] += 1.0
        acceleration[:] = 0.0
        for i in range(len(swings)):
            end = swings[i, 3] + swings[i, 4]
            if swings[i, 3] <= k < end:
                # Of a swing under way the last cells are left.
                if end - k <= len(lifting):
                    acceleration[ONE] += lifting[len(lifting) - (end - k)]
                _accelerate(acceleration, k, swings[i], landing_cells, states, cell)
        for i in range(size):
            following = states[k + 1, i]
            for j in range(width):
                following[j] = (
                    inputs[kind, i] * commands[k, j]
                    + reactions[kind, i] * acceleration[j]
                )
            for m in range(size):
                for j in range(width):
                    following[j] += transitions[kind, i, m] * states[k, m, j]
    return states, commands


@compiled
def _accelerate(
    acceleration: Array,
    k: int,
    swing: IntArray,
    landing_cells: IntArray,
    states: Array,
    cell: float,
) -> None:
    """Add the swinging foot's mean acceleration relative to the ball in a cell.

    The foot follows the quintic of `swing.advance_swing`. A foot that stands moves
    at the ball's speed relative to the ball's centre: so a swing begins and ends.

    Args:
        acceleration: Gets the acceleration added by the columns of a prediction.
        k: The cell.
        swing: Fields of `SwingCells`, shape (5,).
        landing_cells: Cell of each landing.
        states: States of the prediction up to that of cell k.
        cell: Length of a cell, [s].
    """
    foot, origin, landing, first, count = swing
    duration, start = count * cell, (k - first) * cell
    times = (duration, start, start + cell)
    by_offset = mean_acceleration(1.0, 0.0, 0.0, 0.0, 0.0, *times)
    by_velocity = mean_acceleration(0.0, 1.0, 0.0, 0.0, 0.0, *times)
    by_end_velocity = mean_acceleration(0.0, 0.0, 0.0, 0.0, 1.0, *times)
    acceleration[KNOWN_SIZE + landing] += mean_acceleration(
        0.0, 0.0, 0.0, 1.0, 0.0, *times
    )
    is_new = origin != SWINGING
    for j in range(len(acceleration)):
        speed = states[first, BALL + 1, j]
        acceleration[j] += by_end_velocity * speed
        if is_new:
            acceleration[j] += by_velocity * speed + by_offset * states[first, BALL, j]
    if not is_new:
        acceleration[SWING] += by_offset
        acceleration[SWING + 1] += by_velocity
        acceleration[SWING + 2] += mean_acceleration(0.0, 0.0, 1.0, 0.0, 0.0, *times)
    elif origin == STANDING:
        acceleration[SOLES + foot] += by_offset
        acceleration[BALL] -= 2.0 * by_offset
    else:
        acceleration[KNOWN_SIZE + origin] += by_offset
        for j in range(len(acceleration)):
            acceleration[j] -= by_offset * states[landing_cells[origin], BALL, j]
