"""The time series of the log: the one list of what is recorded, with units.

Nothing here knows how a recording is written or shown, so that a run that was kept
in memory and one that is read back from its file offer the same series.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ballsim.recording.block import Block
from ballsim.recording.palette import Colour
from ballsim_controllers.messages import Array

__all__ = ["FORWARD_LEFT", "FORWARD_LEFT_UP", "Signal"]

FORWARD_LEFT = ("forward", "left")
FORWARD_LEFT_UP = (*FORWARD_LEFT, "up")


@dataclass(frozen=True, slots=True)
class Signal:
    """A quantity with one or more components of the same unit.

    Attributes:
        path: Entity path: ``/truth``, ``/estimate``, ``/control`` or ``/sensors``,
            then what it is.
        unit: Unit of all components.
        description: What it is, in which frame.
        columns: Names of the components.
        colours: Colour of each component.
        is_slow: True if it is logged at the slow rows only.
        compute: Returns the values, shape (n, n_columns).
    """

    path: str
    unit: str
    description: str
    columns: tuple[str, ...]
    colours: tuple[Colour, ...]
    is_slow: bool
    compute: Callable[[Block], Array]

    @property
    def kind(self) -> str:
        """Return the first part of the path: truth, estimate, control, sensors."""
        return self.path.split("/")[1]

    @property
    def line_names(self) -> list[str]:
        """Return what the legend calls each component."""
        is_error = self.path.startswith("/estimate/error/")
        if self.kind in ("truth", "estimate") and not is_error:
            return [f"{column}, {self.kind}" for column in self.columns]
        return [column.replace("_", " ") for column in self.columns]
