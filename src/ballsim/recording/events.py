"""What happens during a run, in words: gait, commands, pushes, the fall."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from ballsim.config import Config
from ballsim.fall import FallDetector
from ballsim.recording.recorder import RunContext
from ballsim.series import RunSeries
from ballsim.settings import write_table
from ballsim_controllers.messages import GaitPhase
from ballsim_controllers.sensor_names import name_sensors

__all__ = [
    "COMMAND",
    "FALL",
    "GAIT",
    "KIND_OF_LEVEL",
    "LEVELS",
    "PUSH",
    "SENSOR",
    "Event",
    "EventFinder",
]

GAIT, COMMAND, PUSH, SENSOR, FALL = "gait", "command", "push", "sensor", "fall"

LEVELS = {
    GAIT: "DEBUG",
    COMMAND: "INFO",
    PUSH: "WARN",
    SENSOR: "ERROR",
    FALL: "CRITICAL",
}
"""Level of each kind in a text log."""

KIND_OF_LEVEL = {level: kind for kind, level in LEVELS.items()}

_LANDS = {
    int(GaitPhase.LEFT_SUPPORT): "right foot lands",
    int(GaitPhase.RIGHT_SUPPORT): "left foot lands",
}


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happens at an instant.

    Attributes:
        time: When, [s].
        kind: ``gait``, ``command``, ``push``, ``sensor`` or ``fall``.
        text: What, in a few words.
    """

    time: float
    kind: str
    text: str


class EventFinder:
    """Finds the events of a run in its blocks.

    Args:
        context: What does not change during the run.
    """

    def __init__(self, context: RunContext) -> None:
        """Begin before the first phase."""
        self._context = context
        self._phase, self._ill = -1, 0
        self._detector: FallDetector | None = None
        self._last: RunSeries | None = None
        self._scratch = mujoco.MjData(context.model)

    def find(self, series: RunSeries, config: Config) -> list[Event]:
        """Return the events of a block, in the order of their times.

        Args:
            series: The rows that follow those of the block before.
            config: The configuration, with all that was asked for until their end.
        """
        if self._detector is None:
            self._detector = FallDetector.of_start(
                self._context.model,
                self._scratch,
                self._context.ids,
                self._context.config.simulation,
                series.qpos[0],
            )
        self._last = series
        first, stop = series.first_tick, series.first_tick + series.n_ticks
        planned = [
            Event(table.time, kind, _describe(table))
            for kind, tables in (
                (COMMAND, config.command.timeline),
                (PUSH, config.pushes),
            )
            for table in tables
            if first <= config.find_tick(table.time) < stop
        ]
        found = (*planned, *self._find_phases(series), *self._find_outages(series))
        return sorted(found, key=lambda event: event.time)

    def finish(self) -> Event | None:
        """Return the fall that has ended the run, or None if it did not fall.

        The run's last state is judged anew, as the loop did.
        """
        if self._last is None or self._detector is None:
            return None
        series, data = self._last, self._scratch
        data.qpos[:] = series.qpos[-1]
        mujoco.mj_kinematics(self._context.model, data)
        mujoco.mj_comPos(self._context.model, data)
        n_contacts = int(series.contacts.counts[series.n_ticks - 1])
        n = series.contacts.n_contacts
        reason = self._detector.find_reason(series.contacts.geoms[n - n_contacts : n])
        if reason is None:
            return None
        return Event(round(float(series.time[-1]), 9), FALL, f"fell: {reason}")

    def _find_phases(self, series: RunSeries) -> Iterator[Event]:
        telemetry = series.telemetry
        phases, counts = telemetry.phase, telemetry.step_count
        before = np.concatenate([[self._phase], phases[:-1]])
        for row in np.flatnonzero(phases != before).tolist():
            text = GaitPhase(int(phases[row])).name.lower().replace("_", " ")
            landing = _LANDS.get(int(before[row]))
            if landing is not None:
                text = f"{landing}, step {counts[row]}; {text}"
            yield Event(round(float(series.time[row]), 9), GAIT, text)
        self._phase = int(phases[-1])

    def _find_outages(self, series: RunSeries) -> Iterator[Event]:
        """Yield where the set of sensors that the controller does not use changes."""
        ill = series.telemetry.ill_sensors
        if self._ill == 0 and not ill.any():
            return
        before = np.concatenate([[self._ill], ill[:-1]])
        for row in np.flatnonzero(ill != before).tolist():
            names = name_sensors(int(ill[row]))
            text = f"not used: {', '.join(names)}" if names else "all sensors used"
            yield Event(round(float(series.time[row]), 9), SENSOR, text)
        self._ill = int(ill[-1])


def _describe(table: Any) -> str:
    """Return what a table of the configuration says, defaults left out."""
    default = write_table(type(table)())
    words = [
        f"{key} = {value}"
        for key, value in write_table(table).items()
        if value != default[key] and key != "time_s"
    ]
    return ", ".join(words) or "as at the start"
