"""Time series of a run: arrays that the loop fills row by row."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any, Self

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim.contact_series import ContactSeries
from ballsim_controllers.messages import (
    ESTIMATE,
    Array,
    Command,
    Record,
    SensorReading,
    Telemetry,
    reading_dtype,
    telemetry_dtype,
)

__all__ = [
    "LiveState",
    "ReadingSeries",
    "RunSeries",
    "StateSeries",
    "TelemetrySeries",
]

_ESTIMATE_NAMES = frozenset(ESTIMATE.names or ())
_STATE_ARRAYS = ("_time", "_qpos", "_qvel")  # one row more than there are ticks
_TICK_ARRAYS = ("_ctrl", "_actuator_forces", "_ball_positions", "_targets")


class _Rows:
    """One row per tick; the fields of the rows are attributes.

    Attributes:
        rows: Shape (n_ticks,), the records of the messages.
    """

    def __init__(self, n_ticks: int, dtype: np.dtype[np.void]) -> None:
        """Make the rows."""
        self.rows: Record = np.empty(n_ticks, dtype)

    def __getattr__(self, name: str) -> npt.NDArray[Any]:
        """Return a field of all rows, without a copy."""
        try:
            column: npt.NDArray[Any] = self.rows[name]
            return column
        except ValueError:
            raise AttributeError(name) from None


class ReadingSeries(_Rows):
    """Sensor readings, fields as in SensorReading."""

    def __init__(self, n_ticks: int, n_joints: int) -> None:
        """Make the rows."""
        super().__init__(n_ticks, reading_dtype(n_joints))

    def store(self, row: int, reading: SensorReading) -> None:
        """Copy one reading."""
        self.rows[row] = reading.record[0]


class TelemetrySeries(_Rows):
    """What the controller reports, in its own world; NaN where it reports nothing.

    Fields as in Telemetry and StateEstimate.
    """

    def __init__(self, n_ticks: int, n_joints: int) -> None:
        """Make the rows."""
        super().__init__(n_ticks, telemetry_dtype(n_joints))
        self._blank = _blank_telemetry(n_joints)

    def __getattr__(self, name: str) -> npt.NDArray[Any]:
        """Return a field of all rows or of their estimates, without a copy."""
        rows = self.rows["estimate"] if name in _ESTIMATE_NAMES else self.rows
        try:
            column: npt.NDArray[Any] = rows[name]
            return column
        except ValueError:
            raise AttributeError(name) from None

    def store(self, row: int, telemetry: Telemetry | None) -> None:
        """Copy one report."""
        record = self._blank if telemetry is None else telemetry.record
        self.rows[row] = record[0]


@functools.cache
def _blank_telemetry(n_joints: int) -> Record:
    blank: Record = np.zeros(1, telemetry_dtype(n_joints))
    for rows in (blank, blank["estimate"]):
        for name in rows.dtype.names or ():
            if name != "estimate" and rows[name].dtype == np.float64:
                rows[name] = np.nan
    return blank


class LiveState:
    """Views of what a series copies from the live data; MuJoCo writes into them.

    Args:
        model: The compiled scene.
        data: Its live data.
        body_ball: Id of the ball.
    """

    __slots__ = (
        "actuator_forces",
        "ball",
        "data",
        "model",
        "qpos",
        "qvel",
        "sensordata",
    )

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, body_ball: int
    ) -> None:
        """Take the views."""
        self.model, self.data = model, data
        self.qpos: Array = data.qpos
        self.qvel: Array = data.qvel
        self.actuator_forces: Array = data.actuator_force
        self.sensordata: Array = data.sensordata
        self.ball: Array = data.xpos[body_ball]


class RunSeries:
    """Everything of a run that changes with time: a block of it, or all of it.

    One row for each control period. It holds the state at its tick, the reading
    that the controller got there, what it answered, and (actuator forces,
    contacts, ball's place with them) what the last physics step of the period
    that follows computed. The states have one row more: that after the last tick.

    Attributes:
        holds_all: False where all but states and actuator inputs is left out.
        first_tick: Tick of the first row.
        n_ticks: Rows that are filled.
        time: Shape (n + 1,), [s].
        qpos: State in the true world, shape (n + 1, nq).
        qvel: Velocity, shape (n + 1, nv).
        ctrl: Actuator inputs that the controller sent, shape (n, nu).
        actuator_forces: Joint torques, shape (n, nu), [N m].
        ball_positions: Ball's centre at the time of the contacts, shape (n, 3).
        wrenches: Wrenches applied to the bodies, shape (n, nbody, 6), [N], [N m];
            None in all blocks of a run that never pushes.
        target_ball_angles: What was asked for, shape (n,), [rad].
        readings: Sensor readings.
        telemetry: What the controller reported.
        contacts: Contacts.
        commands: What the operator asked for, of each tick that is filled; it does
            not go into arrays.
    """

    holds_all = True

    def __init__(
        self,
        n_ticks: int,
        model: mujoco.MjModel,
        first_tick: int = 0,
        is_pushed: bool = False,
    ) -> None:
        """Make the arrays for at most so many ticks."""
        self.first_tick, self.n_ticks = first_tick, 0
        self._model = model
        self._time = np.empty(n_ticks + 1)
        self._qpos = np.empty((n_ticks + 1, model.nq))
        self._qvel = np.empty((n_ticks + 1, model.nv))
        self._ctrl = np.empty((n_ticks, model.nu))
        self._actuator_forces = np.empty((n_ticks, model.nu))
        self._ball_positions = np.empty((n_ticks, 3))
        self._targets = np.empty(n_ticks)
        self.wrenches: Array | None = None
        n_rows = n_ticks if self.holds_all else 0
        if is_pushed and self.holds_all:
            self.wrenches = np.zeros((n_ticks, model.nbody, 6))
        self.readings = ReadingSeries(n_rows, model.nu)
        self.telemetry = TelemetrySeries(n_rows, model.nu)
        self.contacts = ContactSeries(n_rows)
        self.commands: list[Command] = []

    @classmethod
    def join(cls, blocks: Sequence[RunSeries]) -> Self:
        """Return the series of blocks that follow one another, at least one."""
        first, n_ticks = blocks[0], sum(block.n_ticks for block in blocks)
        whole = cls(n_ticks, first._model, first.first_tick)
        whole.n_ticks, row = n_ticks, 0
        for block in blocks:
            for name in _STATE_ARRAYS:
                last = row + block.n_ticks
                rows = getattr(block, name)[: block.n_ticks + 1]
                getattr(whole, name)[row : last + 1] = rows
            row = last
        for name in _TICK_ARRAYS:
            arrays = [getattr(block, name)[: block.n_ticks] for block in blocks]
            np.concatenate(arrays, out=getattr(whole, name))
        if first.wrenches is not None:
            wrenches = [b.wrenches for b in blocks if b.wrenches is not None]
            whole.wrenches = np.concatenate(wrenches)
        whole.readings.rows = np.concatenate([b.readings.rows for b in blocks])
        whole.telemetry.rows = np.concatenate([b.telemetry.rows for b in blocks])
        whole.contacts = ContactSeries.join([block.contacts for block in blocks])
        whole.commands = [command for block in blocks for command in block.commands]
        return whole

    @classmethod
    def from_arrays(
        cls,
        model: mujoco.MjModel,
        first_tick: int,
        arrays: Mapping[str, npt.NDArray[Any]],
    ) -> Self:
        """Return the series that has been taken apart by `to_arrays`.

        Args:
            model: The compiled scene.
            first_tick: Tick of the first row.
            arrays: Its arrays, used without a copy.
        """
        series = cls(0, model, first_tick)
        series.n_ticks = len(arrays["_ctrl"])
        for name in (*_STATE_ARRAYS, *_TICK_ARRAYS):
            setattr(series, name, arrays[name])
        series.wrenches = arrays.get("wrenches")
        for part in (series.readings, series.telemetry):
            part.rows = arrays[type(part).__name__].view(part.rows.dtype)
        series.contacts = ContactSeries.from_arrays(arrays)
        return series

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return all rows that are filled as contiguous arrays, without a copy.

        The records of the messages are bytes: their types are known, and large.
        """
        n = self.n_ticks
        arrays = {name: getattr(self, name)[: n + 1] for name in _STATE_ARRAYS}
        arrays |= {name: getattr(self, name)[:n] for name in _TICK_ARRAYS}
        if self.wrenches is not None:
            arrays["wrenches"] = self.wrenches[:n]
        for part in (self.readings, self.telemetry):
            arrays[type(part).__name__] = part.rows[:n].view(np.uint8)
        return arrays | self.contacts.to_arrays(n)

    def begin_next(self) -> Self:
        """Return the series that follows: empty, but for the state at its start."""
        n, is_pushed = self.n_ticks, self.wrenches is not None
        first_tick = self.first_tick + n
        following = type(self)(len(self._ctrl), self._model, first_tick, is_pushed)
        following._time[0] = self._time[n]
        following._qpos[0] = self._qpos[n]
        following._qvel[0] = self._qvel[n]
        return following

    def trim(self) -> None:
        """End the series: rows that are not filled are dropped everywhere."""
        n = self.n_ticks
        self.readings.rows = self.readings.rows[:n]
        self.telemetry.rows = self.telemetry.rows[:n]
        self.contacts.counts = self.contacts.counts[:n]
        if self.wrenches is not None:
            self.wrenches = self.wrenches[:n]

    def store_state(self, row: int, live: LiveState) -> None:
        """Copy a state."""
        self._time[row] = live.data.time
        self._qpos[row] = live.qpos
        self._qvel[row] = live.qvel

    def store_inputs(
        self,
        row: int,
        reading: SensorReading,
        report: Telemetry | None,
        ctrl: Array,
        target_ball_angle: float,
        wrenches: Array | None = None,
    ) -> None:
        """Copy what the controller got at a tick, what it sent, and what pushes."""
        self.readings.store(row, reading)
        self.telemetry.store(row, report)
        self._ctrl[row] = ctrl
        self._targets[row] = target_ball_angle
        if self.wrenches is not None and wrenches is not None:
            self.wrenches[row] = wrenches

    def store_effects(self, row: int, live: LiveState) -> npt.NDArray[np.int32]:
        """Copy what the last physics step after a tick computed, and the state then.

        Returns:
            The geoms of each contact, shape (n, 2).
        """
        self._actuator_forces[row] = live.actuator_forces
        self._ball_positions[row] = live.ball
        geoms = self.contacts.store(row, live.model, live.data)
        self.store_state(row + 1, live)
        self.n_ticks = row + 1
        return geoms

    @property
    def time(self) -> Array:
        """Return the times."""
        return self._time[: self.n_ticks + 1]

    @property
    def qpos(self) -> Array:
        """Return the states."""
        return self._qpos[: self.n_ticks + 1]

    @property
    def qvel(self) -> Array:
        """Return the velocities."""
        return self._qvel[: self.n_ticks + 1]

    @property
    def ctrl(self) -> Array:
        """Return the actuator inputs."""
        return self._ctrl[: self.n_ticks]

    @property
    def actuator_forces(self) -> Array:
        """Return the joint torques."""
        return self._actuator_forces[: self.n_ticks]

    @property
    def ball_positions(self) -> Array:
        """Return the ball's places at the times of the contacts."""
        return self._ball_positions[: self.n_ticks]

    @property
    def target_ball_angles(self) -> Array:
        """Return what was asked for."""
        return self._targets[: self.n_ticks]


class StateSeries(RunSeries):
    """States and actuator inputs only, all else is left out."""

    holds_all = False

    def store_inputs(
        self,
        row: int,
        reading: SensorReading,
        report: Telemetry | None,
        ctrl: Array,
        target_ball_angle: float,
        wrenches: Array | None = None,
    ) -> None:
        """Copy what acts from a tick on."""
        self._ctrl[row] = ctrl

    def store_effects(self, row: int, live: LiveState) -> npt.NDArray[np.int32]:
        """Copy the state after a tick.

        Returns:
            The geoms of each contact, shape (n, 2).
        """
        self.store_state(row + 1, live)
        self.n_ticks = row + 1
        geoms: npt.NDArray[np.int32] = live.data.contact.geom
        return geoms
