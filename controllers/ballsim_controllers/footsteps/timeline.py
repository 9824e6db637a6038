"""What the gait clock foresees: support and landings over the preview's cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim_controllers.body_pendulum import STATE_SIZE
from ballsim_controllers.footsteps.axis_model import SWINGING, SwingCells
from ballsim_controllers.footsteps.gait import LEFT, RIGHT, GaitClock
from ballsim_controllers.frontal.sway import SwayReference
from ballsim_controllers.messages import Array, GaitPhase, IntArray

__all__ = ["Cell", "Landing", "Timeline", "Timelines"]


@dataclass(frozen=True, slots=True)
class Landing:
    """A touchdown to come.

    Attributes:
        foot: 0 = left, 1 = right.
        cell: Cell at whose start the foot lands.
    """

    foot: int
    cell: int


@dataclass(frozen=True, slots=True)
class Cell:
    """Support during one cell.

    Attributes:
        left: Landing that the left foot stands on by then: -1 = where it
            stands now, None = it swings.
        right: The same for the right foot.
    """

    left: int | None
    right: int | None


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """Support over the horizon; a key by identity.

    Attributes:
        cells: One entry per cell.
        landings: Touchdowns within the horizon, in order of time.
        sway_states: Lateral reference at the start of each cell, (N, 7).
        sway_inputs: Lateral CoP reference of each cell, (N,), [m].
        phases: Cell of the half cycle that each cell is, (N,); -1 while standing.
        lift_cells: Cells at whose start a foot leaves the ball.
    """

    cells: tuple[Cell, ...]
    landings: tuple[Landing, ...]
    sway_states: Array
    sway_inputs: Array
    phases: IntArray
    lift_cells: tuple[int, ...] = ()

    @property
    def is_double(self) -> tuple[bool, ...]:
        """Return whether both feet stand, per cell."""
        return tuple(c.left is not None and c.right is not None for c in self.cells)

    @property
    def swings(self) -> tuple[SwingCells, ...]:
        """Return the swings that end within the horizon, in order of time."""
        swings = []
        for index, landing in enumerate(self.landings):
            places = [c.left if landing.foot == LEFT else c.right for c in self.cells]
            first = landing.cell
            while first > 0 and places[first - 1] is None:
                first -= 1
            origin = SWINGING if first == 0 else places[first - 1]
            assert origin is not None
            swings.append(
                SwingCells(landing.foot, origin, index, first, landing.cell - first)
            )
        return tuple(swings)


#: Foot that swings, cells of double support before, of its swing, whether it lifts off.
_Key = tuple[int, int, int, bool]


class Timelines:
    """Timelines by what is left of the present phase; each is made only once.

    Args:
        sway: Periodic lateral reference; its half cycle fixes the durations of
            the phases to come.
        count: Number of cells.
        cell: Length of a cell, [s].
    """

    def __init__(self, sway: SwayReference, count: int, cell: float) -> None:
        """Start with the timeline of a robot that stands."""
        self._sway = sway
        self._count = count
        self._cell = cell
        self._standing = Timeline(
            cells=(Cell(-1, -1),) * count,
            landings=(),
            sway_states=np.zeros((count, STATE_SIZE)),
            sway_inputs=np.zeros(count),
            phases=np.full(count, -1),
        )
        self._walking: dict[_Key, Timeline] = {}

    def look_up(self, clock: GaitClock) -> Timeline:
        """Return what the gait clock foresees: support and lateral reference."""
        if clock.phase == GaitPhase.STAND:
            return self._standing
        remaining = max(round(clock.remaining / self._cell), 1)
        if clock.phase == GaitPhase.DOUBLE:
            single = round(clock.swing_duration / self._cell)
            key = (clock.next_swing, remaining, single, True)
        else:
            swing = RIGHT if clock.phase == GaitPhase.LEFT_SUPPORT else LEFT
            key = (swing, 0, remaining, clock.time_in_phase == 0.0)
        return self._walking.get(key) or self._unroll(key)

    def begin(self, swing: int, duration: float, swing_duration: float) -> Timeline:
        """Return what lies ahead if stepping begins now.

        Args:
            swing: Foot that swings first.
            duration: Double support before it does, [s].
            swing_duration: Time for which it does, [s].
        """
        single = round(swing_duration / self._cell)
        key = (swing, max(round(duration / self._cell), 1), single, True)
        return self._walking.get(key) or self._unroll(key)

    def foresee_all(self) -> list[Timeline]:
        """Return all timelines of standing and of a regular gait."""
        double, half = self._sway.double_cells, len(self._sway.inputs)
        single = half - double
        keys = [
            key
            for swing in (LEFT, RIGHT)
            for key in (
                *((swing, left, single, True) for left in range(1, double + 1)),
                *((swing, 0, left, left == single) for left in range(1, single + 1)),
            )
        ]
        walking = [self._walking.get(key) or self._unroll(key) for key in keys]
        return [self._standing, *walking]

    def _unroll(self, key: _Key) -> Timeline:
        timeline = _unroll(*key, self._sway, self._count)
        self._walking[key] = timeline
        return timeline


def _unroll(
    swing: int,
    double_left: int,
    single_left: int,
    lifts: bool,
    sway: SwayReference,
    count: int,
) -> Timeline:
    """Unroll the gait over the horizon.

    Args:
        swing: Foot that swings, now or next.
        double_left: Cells of double support left before it does.
        single_left: Cells of its swing that are left.
        lifts: Whether it is yet to leave the ball, or does so now.
        sway: Periodic lateral reference.
        count: Number of cells.
    """
    double, half = sway.double_cells, len(sway.inputs)
    standing: list[int | None] = [-1, -1]
    cells: list[Cell] = []
    landings: list[Landing] = []
    picks: list[tuple[int, float]] = []
    lift_cells: list[int] = []
    while len(cells) < count:
        sign = 1.0 if swing == RIGHT else -1.0
        # A long first double support waits at the start of the half cycle.
        indices = [max(double - left, 0) for left in range(double_left, 0, -1)]
        cells += [Cell(standing[LEFT], standing[RIGHT])] * double_left
        standing[swing] = None
        if lifts and len(cells) < count:
            lift_cells.append(len(cells))
        indices += [max(half - left, double) for left in range(single_left, 0, -1)]
        cells += [Cell(standing[LEFT], standing[RIGHT])] * single_left
        picks += [(index, sign) for index in indices]
        if len(cells) < count:
            landings.append(Landing(swing, len(cells)))
            standing[swing] = len(landings) - 1
        swing, lifts = 1 - swing, True
        double_left, single_left = double, half - double
    picks = picks[:count]
    return Timeline(
        cells=tuple(cells[:count]),
        landings=tuple(landings),
        sway_states=np.array([sign * sway.states[i] for i, sign in picks]),
        sway_inputs=np.array([sign * sway.inputs[i] for i, sign in picks]),
        phases=np.array([i for i, _ in picks]),
        lift_cells=tuple(lift_cells),
    )
