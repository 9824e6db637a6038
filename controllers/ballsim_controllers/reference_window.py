"""A reference together with its future, which the footstep planner looks at."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ballsim_controllers.messages import Array
from ballsim_controllers.reference import ReferenceSample

__all__ = ["ReferenceSource", "ReferenceWindow"]


class ReferenceSource(Protocol):
    """What makes a reference: see `RampReference`."""

    @property
    def is_at_rest(self) -> bool:
        """Return whether the reference has come to rest for good."""
        ...

    @property
    def target(self) -> float:
        """Return where it comes to rest, [rad]."""
        ...

    def advance_into(self, samples: Array, first: int, second: int, dt: float) -> None:
        """Move on by one step and write the reference there into two rows."""
        ...


class ReferenceWindow:
    """A reference with its future: runs ahead of the present by a horizon.

    Args:
        reference: The shaped reference; its aim may change, but it is advanced by
            this class alone.
        start: Where it is at rest now, [rad].
        dt: Control period, [s].
        stride: Control periods between two samples of the future.
        count: Samples of the future, the present included.
    """

    def __init__(
        self,
        reference: ReferenceSource,
        dt: float,
        stride: int,
        count: int,
        start: float = 0.0,
    ) -> None:
        """Fill the window with the reference at rest."""
        self._reference = reference
        self._dt = dt
        self._stride = stride
        # A ring, kept twice in a row: the future is one slice wherever it begins.
        self._size = stride * count
        self._samples = np.array([ReferenceSample(start)] * (2 * self._size))
        self._cursor = 0

    @property
    def present(self) -> ReferenceSample:
        """Return the reference at the present instant."""
        return ReferenceSample(*self._samples[self._cursor].tolist())

    @property
    def position(self) -> float:
        """Return the reference's position at the present instant, [rad]."""
        return float(self._samples.item(self._cursor, 0))

    def follow(self, reference: ReferenceSource) -> None:
        """Let another reference go on where the present one rests.

        Args:
            reference: It starts at rest, where the other one came to rest.
        """
        self._reference = reference

    def advance(self) -> None:
        """Move on by one control period."""
        reference, cursor, size = self._reference, self._cursor, self._size
        reference.advance_into(self._samples, cursor, cursor + size, self._dt)
        self._cursor = (cursor + 1) % size

    def future(self) -> Array:
        """Return position, velocity, acceleration, jerk per sample, (count, 4).

        A view, valid until the next call of ``advance``.
        """
        return self._samples[self._cursor : self._cursor + self._size : self._stride]

    def has_arrived(self, target: float) -> bool:
        """Return whether the present rests at a target, [rad]."""
        return (
            self._reference.is_at_rest
            and self._reference.target == target
            and self._samples.item(self._cursor, 0) == target
            and self._samples.item(self._cursor, 1) == 0.0
        )
