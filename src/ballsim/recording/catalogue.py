"""All signals of a run."""

from __future__ import annotations

from ballsim.recording.control_signals import make_control_signals, make_sensor_signals
from ballsim.recording.recorder import RunContext
from ballsim.recording.signals import Signal
from ballsim.recording.state_signals import make_state_signals

__all__ = ["make_signals"]


def make_signals(context: RunContext) -> tuple[Signal, ...]:
    """Return every signal that a run's log has.

    Args:
        context: What does not change during the run.
    """
    return (
        *make_state_signals(context),
        *make_control_signals(),
        *make_sensor_signals(context),
    )
