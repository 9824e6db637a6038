"""Time series of a run: arrays made before the loop and filled row by row."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim_controllers.messages import Array, SensorReading, Telemetry

__all__ = ["ContactSeries", "ReadingSeries", "RunSeries", "TelemetrySeries"]

IntArray = npt.NDArray[np.int32]
_FIRST_CONTACTS_PER_TICK = 4


def _unset(*shape: int) -> Array:
    return np.full(shape, np.nan)


class ReadingSeries:
    """Sensor readings, one row per tick; fields as in SensorReading."""

    def __init__(self, n_ticks: int, n_joints: int) -> None:
        """Make the arrays."""
        self.joint_positions = np.empty((n_ticks, n_joints))
        self.joint_velocities = np.empty((n_ticks, n_joints))
        self.angular_velocity_imu = np.empty((n_ticks, 3))
        self.acceleration_imu = np.empty((n_ticks, 3))
        self.foot_forces = np.empty((n_ticks, 2, 3))
        self.foot_torques = np.empty((n_ticks, 2, 3))
        self.angular_velocity_ball = np.empty((n_ticks, 3))

    def store(self, tick: int, reading: SensorReading) -> None:
        """Copy one reading."""
        self.joint_positions[tick] = reading.joint_positions
        self.joint_velocities[tick] = reading.joint_velocities
        self.angular_velocity_imu[tick] = reading.angular_velocity_imu
        self.acceleration_imu[tick] = reading.acceleration_imu
        self.foot_forces[tick] = reading.foot_forces
        self.foot_torques[tick] = reading.foot_torques
        self.angular_velocity_ball[tick] = reading.angular_velocity_ball


class TelemetrySeries:
    """What the controller reports, in its own world; NaN where it reports nothing.

    Fields as in Telemetry and StateEstimate.
    """

    def __init__(self, n_ticks: int, n_joints: int) -> None:
        """Make the arrays."""
        self.quaternion_trunk_to_world = _unset(n_ticks, 4)
        self.angular_velocity_trunk_in_trunk = _unset(n_ticks, 3)
        self.position_trunk_in_world = _unset(n_ticks, 3)
        self.linear_velocity_trunk_in_world = _unset(n_ticks, 3)
        self.position_com_in_world = _unset(n_ticks, 3)
        self.linear_velocity_com_in_world = _unset(n_ticks, 3)
        self.position_ball_in_world = _unset(n_ticks, 3)
        self.linear_velocity_ball_in_world = _unset(n_ticks, 3)
        self.angular_velocity_ball_in_world = _unset(n_ticks, 3)
        self.contacts_in_world = _unset(n_ticks, 2, 3)
        self.normal_forces = _unset(n_ticks, 2)
        self.cop_in_world = _unset(n_ticks, 2)
        self.phase: IntArray = np.zeros(n_ticks, dtype=np.int32)
        self.step_count: IntArray = np.zeros(n_ticks, dtype=np.int32)
        self.ideal_cop = _unset(n_ticks, 2)
        self.commanded_cop = _unset(n_ticks, 2)
        self.target_com = _unset(n_ticks, 3)
        self.target_soles = _unset(n_ticks, 2, 3)
        self.reference_ball_angle = _unset(n_ticks)
        self.joint_torques = _unset(n_ticks, n_joints)

    def store(self, tick: int, telemetry: Telemetry) -> None:
        """Copy one report."""
        e = telemetry.estimate
        self.quaternion_trunk_to_world[tick] = e.quaternion_trunk_to_world
        self.angular_velocity_trunk_in_trunk[tick] = e.angular_velocity_trunk_in_trunk
        self.position_trunk_in_world[tick] = e.position_trunk_in_world
        self.linear_velocity_trunk_in_world[tick] = e.linear_velocity_trunk_in_world
        self.position_com_in_world[tick] = e.position_com_in_world
        self.linear_velocity_com_in_world[tick] = e.linear_velocity_com_in_world
        self.position_ball_in_world[tick] = e.position_ball_in_world
        self.linear_velocity_ball_in_world[tick] = e.linear_velocity_ball_in_world
        self.angular_velocity_ball_in_world[tick] = e.angular_velocity_ball_in_world
        self.contacts_in_world[tick] = e.contacts_in_world
        self.normal_forces[tick] = e.normal_forces
        self.cop_in_world[tick] = e.cop_in_world
        self.phase[tick] = telemetry.phase
        self.step_count[tick] = telemetry.step_count
        self.ideal_cop[tick] = telemetry.ideal_cop
        self.commanded_cop[tick] = telemetry.commanded_cop
        self.target_com[tick] = telemetry.target_com
        self.target_soles[tick] = telemetry.target_soles
        self.reference_ball_angle[tick] = telemetry.reference_ball_angle
        self.joint_torques[tick] = telemetry.joint_torques


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
