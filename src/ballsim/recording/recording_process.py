"""Hands a run to a process of its own that writes the recording."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from ballsim.config import Config
from ballsim.recording.encoder_process import EncoderProcess
from ballsim.recording.recorder import RunBlock, RunContext

__all__ = ["RecordingProcess"]


class RecordingProcess:
    """Writes what `RerunRecorder` would, but costs the loop a copy of the rows only.

    The model is compiled again there, and what was true is computed again: the loop
    may not have done so, and then need not.

    Args:
        target: The file, which is replaced if it exists, or the address of a viewer.
        encoder: A process that has been started already, None to start one.
    """

    def __init__(
        self, target: Path | str, encoder: EncoderProcess | None = None
    ) -> None:
        """Start the process, if need be."""
        self._target = target.absolute() if isinstance(target, Path) else target
        self._config: Config | None = None
        self._encoder = EncoderProcess() if encoder is None else encoder

    def start(self, context: RunContext) -> None:
        """Send what does not change."""
        fields = {
            field.name: getattr(context, field.name)
            for field in dataclasses.fields(context)
            if field.name != "model"
        }
        self._config = context.config
        self._encoder.send({"target": self._target, **fields})

    def record(self, block: RunBlock) -> None:
        """Send the rows of a block.

        Raises:
            BallsimError: The recording has failed.
        """
        series, config = block.series, block.context.config
        has_changed = config is not self._config
        self._config = config
        self._encoder.send(
            {
                "first_tick": series.first_tick,
                "arrays": series.to_arrays(),
                "wall_time": block.wall_time,
                "config": config if has_changed else None,
            }
        )

    def close(self) -> None:
        """Wait until the file is complete; may be called again.

        Raises:
            BallsimError: The recording has failed.
        """
        self._encoder.close()

    @property
    def cpu_time(self) -> float:
        """Return what it took in the other process, once it is closed, [s]."""
        return self._encoder.cpu_time
