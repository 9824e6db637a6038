"""Gait phases and events, as a time line and in words."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ballsim.recording.block import Block
from ballsim.recording.columns import make_texts
from ballsim.recording.events import LEVELS, Event, EventFinder
from ballsim.recording.palette import LEFT, RIGHT, Colour
from ballsim.recording.palette import PUSH as PUSH_COLOUR
from ballsim.recording.paths import EVENTS_PATH, FALL_PATH, PHASE_PATH
from ballsim.recording.recorder import RunContext
from ballsim.recording.tracks import TIMELINE, time_column
from ballsim_controllers.messages import GaitPhase

__all__ = ["EventLog", "PhaseLog"]

_PHASE_COLOURS: dict[str, Colour] = {
    GaitPhase.STAND.name: (110, 110, 120),
    GaitPhase.DOUBLE.name: (190, 190, 200),
    GaitPhase.LEFT_SUPPORT.name: LEFT,
    GaitPhase.RIGHT_SUPPORT.name: RIGHT,
}
_STATE = rr.StateChange.descriptor_state()
_TEXT = rr.TextLog.descriptor_text()
_LEVEL = rr.TextLog.descriptor_level()


class PhaseLog:
    """The gait phase, where it changes."""

    def __init__(self) -> None:
        """Begin before the first phase."""
        self._phase = -1

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Log colours and labels."""
        phases = rr.StateConfiguration(
            values=list(_PHASE_COLOURS),
            labels=[name.lower().replace("_", " ") for name in _PHASE_COLOURS],
            colors=list(_PHASE_COLOURS.values()),
        )
        stream.log(PHASE_PATH, phases, static=True)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log the changes of a block."""
        phases = block.telemetry.phase
        before = np.concatenate([[self._phase], phases[:-1]])
        rows = np.flatnonzero(phases != before)
        self._phase = int(phases[-1])
        if rows.size > 0:
            names = [GaitPhase(phase).name for phase in phases[rows].tolist()]
            time = time_column(block.time[rows])
            stream.send_columns(PHASE_PATH, time, [make_texts(_STATE, names)])

    def finish(self, stream: rr.RecordingStream) -> None:
        """Do nothing."""


class EventLog:
    """What happens, in words; a fall also where it happens."""

    def __init__(self) -> None:
        """Prepare to start."""
        self._finder: EventFinder | None = None
        self._last: Block | None = None

    def start(self, stream: rr.RecordingStream, context: RunContext) -> None:
        """Prepare to find the events."""
        self._finder = EventFinder(context)
        label = rr.Points3D.from_fields(
            colors=[PUSH_COLOUR], radii=[0.02], show_labels=True
        )
        stream.log(FALL_PATH, label, static=True)

    def send(self, stream: rr.RecordingStream, block: Block) -> None:
        """Log the events of a block."""
        assert self._finder is not None
        self._last = block
        found = self._finder.find(block.series, block.context.config)
        self._send(stream, found)

    def finish(self, stream: rr.RecordingStream) -> None:
        """Log the fall, if there was one."""
        fall = self._finder.finish() if self._finder is not None else None
        if fall is None or self._last is None:
            return
        self._send(stream, [fall])
        place = self._last.series.qpos[-1, self._last.context.ids.qpos_trunk][:3]
        stream.set_time(TIMELINE, duration=fall.time)
        stream.log(FALL_PATH, rr.Points3D([place], labels=[fall.text]))

    def _send(self, stream: rr.RecordingStream, events: list[Event]) -> None:
        if events:
            time = time_column(np.array([event.time for event in events]))
            texts = make_texts(_TEXT, [event.text for event in events])
            levels = make_texts(_LEVEL, [LEVELS[event.kind] for event in events])
            stream.send_columns(EVENTS_PATH, time, [texts, levels])
