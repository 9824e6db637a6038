"""The contacts of a run: as many rows per tick as there are contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim_controllers.messages import Array

__all__ = ["ContactSeries"]

IntArray = npt.NDArray[np.int32]
_FIRST_CONTACTS_PER_TICK = 4
_ARRAYS = ("_positions", "_frames", "_wrenches", "_geoms")


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
        self._wrenches = np.empty((capacity, 6))  # in the contact's axes
        self._geoms: IntArray = np.empty((capacity, 2), dtype=np.int32)

    @classmethod
    def join(cls, parts: Sequence[ContactSeries]) -> ContactSeries:
        """Return the contacts of several series, one after the other."""
        whole = cls(0)
        whole.counts = np.concatenate([part.counts for part in parts])
        whole.n_contacts = sum(part.n_contacts for part in parts)
        for name in _ARRAYS:
            arrays = [getattr(part, name)[: part.n_contacts] for part in parts]
            setattr(whole, name, np.concatenate(arrays))
        return whole

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> ContactSeries:
        """Return the contacts that have been taken apart by `to_arrays`.

        Args:
            arrays: Its arrays, used without a copy; others are ignored.
        """
        whole = cls(0)
        whole.counts = arrays["counts"]
        whole.n_contacts = len(arrays["_geoms"])
        for name in _ARRAYS:
            setattr(whole, name, arrays[name])
        return whole

    def to_arrays(self, n_ticks: int) -> dict[str, npt.NDArray[Any]]:
        """Return all contacts as contiguous arrays, without a copy.

        Args:
            n_ticks: Ticks that are filled.
        """
        arrays = {name: getattr(self, name)[: self.n_contacts] for name in _ARRAYS}
        return {"counts": self.counts[:n_ticks], **arrays}

    def store(self, row: int, model: mujoco.MjModel, data: Any) -> IntArray:
        """Copy the contacts of the last physics step.

        Returns:
            The geoms of each contact, shape (n, 2).
        """
        n: int = data.ncon
        start = self.n_contacts
        stop = self.n_contacts = start + n
        if stop > len(self._positions):
            self._grow()
        contact, wrenches = data.contact, self._wrenches
        contact_force = mujoco.mj_contactForce
        geoms: IntArray = contact.geom
        self._positions[start:stop] = contact.pos
        self._frames[start:stop] = contact.frame
        self._geoms[start:stop] = geoms
        for i in range(n):
            contact_force(model, data, i, wrenches[start + i])
        self.counts[row] = n
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
        return self._wrenches[: self.n_contacts, 0]

    def compute_forces(self) -> Array:
        """Return forces on the second geoms in the true world, shape (n, 3), [N]."""
        n = self.n_contacts
        frames = self._frames[:n].reshape(-1, 3, 3)  # rows: the contact's axes
        forces: Array = np.einsum("nij,ni->nj", frames, self._wrenches[:n, :3])
        return forces

    def _grow(self) -> None:
        for name in _ARRAYS:
            old = getattr(self, name)
            setattr(self, name, np.concatenate([old, np.empty_like(old)]))
