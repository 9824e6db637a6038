"""Time series of a run: arrays made before the loop and filled row by row."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim_controllers.messages import (
    ESTIMATE,
    Array,
    Record,
    SensorReading,
    Telemetry,
    reading_dtype,
    telemetry_dtype,
)

__all__ = ["ContactSeries", "ReadingSeries", "RunSeries", "TelemetrySeries"]

IntArray = npt.NDArray[np.int32]
_FIRST_CONTACTS_PER_TICK = 4
_ESTIMATE_NAMES = frozenset(ESTIMATE.names or ())


class _Rows:
    """One row per tick; the fields of the rows are attributes.

    Attributes:
        rows: Shape (n_ticks,), the records of the messages.
    """

    def __init__(self, n_ticks: int, dtype: np.dtype[np.void]) -> None:
        """Make the rows."""
        self.rows: Record = np.zeros(n_ticks, dtype)

    def __getattr__(self, name: str) -> npt.NDArray[Any]:
        """Return a field of all rows, without a copy."""
        try:
            return self.rows[name]
        except ValueError:
            raise AttributeError(name) from None


class ReadingSeries(_Rows):
    """Sensor readings, fields as in SensorReading."""

    def __init__(self, n_ticks: int, n_joints: int) -> None:
        """Make the rows."""
        super().__init__(n_ticks, reading_dtype(n_joints))

    def store(self, tick: int, reading: SensorReading) -> None:
        """Copy one reading."""
        self.rows[tick] = reading.record[0]


class TelemetrySeries(_Rows):
    """What the controller reports, in its own world; NaN where it reports nothing.

    Fields as in Telemetry and StateEstimate.
    """

    def __init__(self, n_ticks: int, n_joints: int) -> None:
        """Make the rows."""
        super().__init__(n_ticks, telemetry_dtype(n_joints))
        for rows in (self.rows, self.rows["estimate"]):
            for name in rows.dtype.names or ():
                if name != "estimate" and rows[name].dtype == np.float64:
                    rows[name] = np.nan

    def __getattr__(self, name: str) -> npt.NDArray[Any]:
        """Return a field of all rows or of their estimates, without a copy."""
        rows = self.rows["estimate"] if name in _ESTIMATE_NAMES else self.rows
        try:
            return rows[name]
        except ValueError:
            raise AttributeError(name) from None

    def store(self, tick: int, telemetry: Telemetry) -> None:
        """Copy one report."""
        self.rows[tick] = telemetry.record[0]


class ContactSeries:
    """Contacts of each tick, one after the other (ragged).

    Attributes:
        counts: Contacts of each tick, shape (n_ticks,).
        n_contacts: Contacts so far.
    """

    def __init__(self, n_ticks: int) -> None:
        """Make the arrays."""
        capacity = n_ticks * _FIRST_CONTACTS_PER_TICK
        self.counts: IntArray = np.zeros(n_ticks, dtype=np.int32)
        self.n_contacts = 0
        self._positions = np.empty((capacity, 3))
        self._frames = np.empty((capacity, 9))
        self._forces = np.empty((capacity, 3))
        self._geoms: IntArray = np.empty((capacity, 2), dtype=np.int32)
        self._buffer = np.zeros(6)

    def store(self, tick: int, model: mujoco.MjModel, data: Any) -> IntArray:
        """Copy the contacts of the last physics step.

        Returns:
            The geoms of each contact, shape (n, 2).
        """
        n: int = data.ncon
        start, stop = self.n_contacts, self.n_contacts + n
        if stop > len(self._positions):
            self._grow()
        contact = data.contact
        geoms: IntArray = contact.geom
        self._positions[start:stop] = contact.pos
        self._frames[start:stop] = contact.frame
        self._geoms[start:stop] = geoms
        for i in range(n):
            mujoco.mj_contactForce(model, data, i, self._buffer)
            self._forces[start + i] = self._buffer[:3]
        self.counts[tick] = n
        self.n_contacts = stop
        return geoms

    @property
    def positions(self) -> Array:
        """Return the points in the true world, shape (n, 3), [m]."""
        return self._positions[: self.n_contacts]

    @property
    def geoms(self) -> IntArray:
        """Return both geoms of each contact, shape (n, 2)."""
        return self._geoms[: self.n_contacts]

    @property
    def normal_forces(self) -> Array:
        """Return the normal forces, shape (n,), [N]."""
        return self._forces[: self.n_contacts, 0]

    def compute_forces(self, start: int = 0, stop: int | None = None) -> Array:
        """Return the forces on the second geoms in the true world, shape (n, 3), [N].

        Args:
            start: First contact.
            stop: One past the last contact, all if None.
        """
        stop = self.n_contacts if stop is None else stop
        frames = self._frames[start:stop].reshape(-1, 3, 3)  # rows: contact's axes
        forces: Array = np.einsum("nij,ni->nj", frames, self._forces[start:stop])
        return forces

    def _grow(self) -> None:
        for name in ("_positions", "_frames", "_forces", "_geoms"):
            old = getattr(self, name)
            setattr(self, name, np.concatenate([old, np.empty_like(old)]))


class RunSeries:
    """Everything of a run that changes with time, one row per control period.

    Row k holds the state at tick k, the reading that the controller got there,
    what it answered, and (actuator forces, contacts, ball's place with them)
    what the last physics step of the period that follows computed.

    Attributes:
        n_ticks: Rows that are filled.
        time: Shape (n + 1,), [s].
        qpos: State in the true world, shape (n + 1, nq); the last row is the end.
        qvel: Velocity, shape (n + 1, nv).
        ctrl: Actuator inputs, shape (n, nu).
        actuator_forces: Joint torques, shape (n, nu), [N m].
        ball_positions: Ball's centre at the time of the contacts, shape (n, 3).
        wrenches: Wrenches applied to the bodies, shape (n, nbody, 6), or None.
        target_ball_angles: What was asked for, shape (n,), [rad].
        readings: Sensor readings.
        telemetry: What the controller reported.
        contacts: Contacts.
    """

    def __init__(self, n_ticks: int, model: mujoco.MjModel) -> None:
        """Make the arrays."""
        self.n_ticks = 0
        self._time = np.empty(n_ticks + 1)
        self._qpos = np.empty((n_ticks + 1, model.nq))
        self._qvel = np.empty((n_ticks + 1, model.nv))
        self._ctrl = np.empty((n_ticks, model.nu))
        self._actuator_forces = np.empty((n_ticks, model.nu))
        self._ball_positions = np.empty((n_ticks, 3))
        self._targets = np.empty(n_ticks)
        self.wrenches: Array | None = None
        self.readings = ReadingSeries(n_ticks, model.nu)
        self.telemetry = TelemetrySeries(n_ticks, model.nu)
        self.contacts = ContactSeries(n_ticks)

    def store_state(self, tick: int, data: Any) -> None:
        """Copy the state at a tick."""
        self._time[tick] = data.time
        self._qpos[tick] = data.qpos
        self._qvel[tick] = data.qvel

    def store_inputs(self, tick: int, ctrl: Array, target_ball_angle: float) -> None:
        """Copy what acts from a tick on."""
        self._ctrl[tick] = ctrl
        self._targets[tick] = target_ball_angle

    def store_effects(self, tick: int, data: Any, body_ball: int) -> None:
        """Copy what the last physics step after a tick computed."""
        self._actuator_forces[tick] = data.actuator_force
        self._ball_positions[tick] = data.xpos[body_ball]
        self.n_ticks = tick + 1

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
