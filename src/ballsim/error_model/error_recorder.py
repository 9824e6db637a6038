"""Keeps the errors of the state estimate of a run."""

from __future__ import annotations

import numpy as np

from ballsim.estimate_errors import compute_error_components
from ballsim.recording.recorder import RunBlock, RunContext
from ballsim_controllers.messages import Array

__all__ = ["ErrorRecorder"]


class ErrorRecorder:
    """Keeps the errors at all ticks, components as in `find_components`."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._times: list[Array] = []
        self._errors: list[Array] = []
        self._contact_before: tuple[Array, Array] | None = None

    def start(self, context: RunContext) -> None:
        """Do nothing."""

    def record(self, block: RunBlock) -> None:
        """Add the rows of a block."""
        series, contact = block.series, block.contact
        self._times.append(np.array(series.time[:-1]))
        self._errors.append(
            compute_error_components(series, block.truth, contact, self._contact_before)
        )
        self._contact_before = (
            contact.normal_forces[-1],
            contact.cop_to_ball_in_world[-1],
        )

    def close(self) -> None:
        """Do nothing."""

    @property
    def time(self) -> Array:
        """Return the times of the ticks, shape (n,), [s]."""
        return np.concatenate(self._times)

    @property
    def errors(self) -> Array:
        """Return the errors, shape (n, n_components)."""
        return np.concatenate(self._errors)
