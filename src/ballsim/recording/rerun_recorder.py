"""Writes a run to a rerun recording while it goes on.

Blocks of rows are sent as columns: logging tick by tick costs a hundred times as
much in Python. Several blocks go together, because each chunk of a recording costs
a kilobyte and some time, however few its rows.
"""

from __future__ import annotations

from pathlib import Path

import rerun as rr

from ballsim.config import Config
from ballsim.config_io import format_config
from ballsim.recording.arrows import ContactArrows, PushArrows
from ballsim.recording.ball_top import BallTop
from ballsim.recording.block import compute_block
from ballsim.recording.blueprint import make_blueprint
from ballsim.recording.curves import BoundLines, Curves, LimitLines, SpeedCurve
from ballsim.recording.event_log import EventLog, PhaseLog
from ballsim.recording.footprints import Footprints
from ballsim.recording.marks import Marks
from ballsim.recording.paths import CONFIG_PATH
from ballsim.recording.poses import Poses
from ballsim.recording.recorder import RunBlock, RunContext
from ballsim.recording.tracks import Track
from ballsim.series import RunSeries

__all__ = ["RerunRecorder"]

_CHUNK_PERIOD = 20.0  # [s]

# The index of a recording is kept in memory until its end. A longer one has none:
# `rerun rrd optimize` makes it, the viewer does without.
_INDEXED_DURATION = 120.0  # [s]

_WRITER_PERIOD = 0.005  # rerun's writer is a thread beside ours, [s]
_FLUSH_TIMEOUT = 10.0  # [s]


class RerunRecorder:
    """Streams a run into an .rrd file that is readable up to a crash, or to a viewer.

    A viewer gets each block at once.

    Args:
        target: The file, which is replaced if it exists, or the address of a viewer.
    """

    def __init__(self, target: Path | str) -> None:
        """Remember the target; it is opened by `start`."""
        self._target = target
        self._first_config: Config | None = None
        self._config: Config | None = None
        self._stream: rr.RecordingStream | None = None
        self._speed = SpeedCurve()
        poses = Poses()
        self._tracks: tuple[Track, ...] = (
            poses,
            BallTop(poses),
            Footprints(),
            Marks(),
            ContactArrows(),
            PushArrows(),
            Curves(),
            LimitLines(),
            BoundLines(),
            PhaseLog(),
            EventLog(),
        )
        self._waiting: list[RunBlock] = []
        self._n_waiting = 0

    def start(self, context: RunContext) -> None:
        """Open the file or the viewer, and log what does not change."""
        config = self._config = self._first_config = context.config
        batcher = rr.ChunkBatcherConfig(flush_tick=_WRITER_PERIOD)
        stream = rr.RecordingStream("ballsim", batcher_config=batcher)
        stream.set_log_tick_enabled(False)
        stream.set_log_time_enabled(False)
        self._open(stream, context)
        name = f"{config.scenario}, seed {config.seed}, ball {config.ball.radius:g} m"
        stream.send_recording_name(name)
        self._stream = stream
        for track in self._tracks:
            track.start(stream, context)
        self._speed.start(stream)
        _log_config(stream, config)
        stream.flush(timeout_sec=_FLUSH_TIMEOUT)

    def record(self, block: RunBlock) -> None:
        """Take the rows of a block, and send them when there are enough."""
        self._waiting.append(block)
        self._speed.add(block)
        self._n_waiting += block.series.n_ticks
        config = self._config = block.context.config
        is_shown = isinstance(self._target, str)
        if is_shown or self._n_waiting >= config.count_ticks(_CHUNK_PERIOD):
            self._send()

    def close(self) -> None:
        """Finish the file.

        Raises:
            RuntimeError: It cannot be written: the disk is full, for instance.
        """
        if self._stream is None:
            return
        self._send()
        stream, self._stream = self._stream, None
        if self._config is not None and self._config is not self._first_config:
            _log_config(stream, self._config)
        for track in self._tracks:
            track.finish(stream)
        stream.flush(timeout_sec=_FLUSH_TIMEOUT)
        stream.disconnect()

    def _open(self, stream: rr.RecordingStream, context: RunContext) -> None:
        if isinstance(self._target, str):
            blueprint = make_blueprint(context, is_live=True)
            stream.connect_grpc(self._target, default_blueprint=blueprint)
            return
        stream.save(
            self._target,
            default_blueprint=make_blueprint(context),
            write_footer=context.config.duration <= _INDEXED_DURATION,
        )

    def _send(self) -> None:
        """Send all rows that wait."""
        stream, blocks = self._stream, self._waiting
        assert stream is not None
        if not blocks:
            return
        first = blocks[0]
        series = first.series
        if len(blocks) > 1:
            series = RunSeries.join([block.series for block in blocks])
        shown = compute_block(RunBlock(blocks[-1].context, series, first.scratch))
        for track in self._tracks:
            track.send(stream, shown)
        self._speed.send(stream)
        self._waiting, self._n_waiting = [], 0
        # Else all of a run could queue up in memory.
        stream.flush(timeout_sec=_FLUSH_TIMEOUT)


def _log_config(stream: rr.RecordingStream, config: Config) -> None:
    text = f"```toml\n{format_config(config)}```"
    document = rr.TextDocument(text, media_type="text/markdown")
    stream.log(CONFIG_PATH, document, static=True)
