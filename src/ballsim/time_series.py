"""Quantities over time, as results of a run offer them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ballsim_controllers.messages import Array

__all__ = ["TimeSeries"]

_MOST_NAMES = 6  # in the representation


@dataclass(frozen=True, slots=True)
class TimeSeries:
    """A quantity over time, with one or more components of the same unit.

    Attributes:
        path: What it is called, such as ``truth/ball/angle``.
        unit: Unit of the values.
        description: What it is, in which frame.
        columns: Names of the components.
        time: Times of the rows, shape (n,), [s].
        values: Shape (n, n_columns); NaN where there is nothing.

    Examples:
        >>> import numpy as np
        >>> time = np.array([0.0, 0.5])
        >>> values = np.array([[0.0, 1.0], [0.2, 1.1]])
        >>> cop = TimeSeries("cop", "m", "CoP", ("forward", "left"), time, values)
        >>> cop["left"].tolist()
        [1.0, 1.1]
        >>> cop
        <TimeSeries cop [m]: forward, left; 2 rows, 0 to 0.5 s>
    """

    path: str
    unit: str
    description: str
    columns: tuple[str, ...]
    time: Array
    values: Array

    def __repr__(self) -> str:
        """Return what it is, on one line, without its values."""
        span = f", {self.time[0]:g} to {self.time[-1]:g} s" if len(self) else ""
        n = len(self.columns)
        names = ", ".join(self.columns) if n <= _MOST_NAMES else f"{n} components"
        return (
            f"<TimeSeries {self.path} [{self.unit}]: {names}; {len(self)} rows{span}>"
        )

    def __getitem__(self, column: str) -> Array:
        """Return a component by its name, shape (n,).

        Raises:
            KeyError: There is no such component; the message names those there are.
        """
        try:
            index = self.columns.index(column)
        except ValueError:
            names = ", ".join(self.columns)
            raise KeyError(f"{column!r}; {self.path} has {names}") from None
        values: Array = self.values[:, index]
        return values

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.time)

    def at(self, times: Array) -> Array:
        """Return the values at other times, by linear interpolation.

        Args:
            times: Shape (m,), [s].

        Returns:
            Shape (m, n_columns).
        """
        columns = [np.interp(times, self.time, column) for column in self.values.T]
        return np.column_stack(columns)

    def frame(self) -> Any:
        """Return a pandas DataFrame: a column for each component, time as index."""
        import pandas as pd  # noqa: PLC0415 - slow

        index = pd.Index(self.time, name="time_s")
        return pd.DataFrame(self.values, index=index, columns=list(self.columns))
