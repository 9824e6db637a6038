"""The process that writes a recording: ``python -m ballsim.recording.encoder``.

On its input it gets frames: first the target and what does not change during the run,
then the blocks. It works until the input ends, and then tells in JSON on its output
what that took, or why it failed.
"""

from __future__ import annotations

import json
import os
import queue
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ballsim.recording.frames import read_frame, unpack_frame

__all__ = ["explain_halt", "main"]

# What waits here: the imports take as long as many blocks. A run that is still faster
# than its recording has to wait.
_MOST_WAITING = 100  # blocks
_PATIENCE = 60.0  # with one block, or with the end of the file, [s]
_FULL = 64 << 20  # with less left of it a disk is full, [bytes]
_PATIENCE_LIVE = 15.0  # less than a live run can go on without us, [s]
_SWITCH_INTERVAL = 2e-4  # who reads must not wait for who encodes, [s]
_NICENESS = 5  # where cores are few the loop goes first
_NO_FRAME = None


def main() -> int:
    """Write the recording that the input asks for.

    Returns:
        Exit code: 0 done, 1 failed.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.setswitchinterval(_SWITCH_INTERVAL)
    os.nice(_NICENESS)
    output = os.dup(1)
    os.dup2(2, 1)  # whatever prints would disturb the report
    frames: queue.Queue[list[memoryview] | None] = queue.Queue(_MOST_WAITING)
    threading.Thread(target=_receive, args=(frames,), daemon=True).start()
    watchdog = _Watchdog(output)
    try:
        cpu_time = _record(map(unpack_frame, iter(frames.get, _NO_FRAME)), watchdog)
    except Exception as error:
        return _report(output, 1, error=_describe(error))
    return _report(output, 0, cpu_time=cpu_time)


class _Watchdog:
    """Ends the process if the writer hangs, as rerun's does when a disk is full.

    Args:
        output: Where the report goes.
    """

    def __init__(self, output: int) -> None:
        self._output = output
        self._target: object = None
        self._timer: threading.Timer | None = None

    def watch(self, target: object) -> None:
        """Tell where the recording goes: to a file, or to a viewer by its address."""
        self._target = target

    def expect(self) -> None:
        """Allow some time until the next call of this or of `rest`."""
        self.rest()
        patience = _PATIENCE_LIVE if isinstance(self._target, str) else _PATIENCE
        self._timer = threading.Timer(patience, self._give_up)
        self._timer.daemon = True
        self._timer.start()

    def rest(self) -> None:
        """Allow any time."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _give_up(self) -> None:
        _report(self._output, 1, error=explain_halt(self._target))
        os._exit(1)


def explain_halt(target: object) -> str:
    """Return why nothing gets on, as far as can be told.

    Args:
        target: File that is written, or address of a viewer.
    """
    if not isinstance(target, Path):
        return "the viewer does not answer"
    free = shutil.disk_usage(target.absolute().parent).free
    if free < _FULL:
        return "the file cannot be written; the disk is full"
    cause = f"nothing written for {_PATIENCE:.0f} s, though {free >> 20} MiB are free"
    return f"{cause}; is the machine overloaded?"


def _receive(frames: queue.Queue[list[memoryview] | None]) -> None:
    """Put all frames of the input into a queue, and a mark behind them."""
    try:
        while True:
            frames.put(read_frame(0))
    except EOFError:
        frames.put(_NO_FRAME)


def _record(frames: Iterator[dict[str, Any]], watchdog: _Watchdog) -> float:
    """Write a recording, and return the CPU time that it took, [s]."""
    from dataclasses import replace  # noqa: PLC0415 - as what follows

    import mujoco  # noqa: PLC0415 - heavy: the input is read meanwhile

    from ballsim.recording.recorder import RunBlock, RunContext  # noqa: PLC0415
    from ballsim.recording.rerun_recorder import RerunRecorder  # noqa: PLC0415
    from ballsim.scene import compile_scene  # noqa: PLC0415
    from ballsim.series import RunSeries  # noqa: PLC0415

    fields = next(frames, None)
    start = time.process_time()
    if fields is None:
        return 0.0
    target = fields.pop("target")
    watchdog.watch(target)
    recorder = RerunRecorder(target)
    model = compile_scene(fields["scene_xml"])
    context, scratch = RunContext(model=model, **fields), mujoco.MjData(model)
    watchdog.expect()
    recorder.start(context)
    watchdog.rest()
    for frame in frames:
        wall_time, config = frame.pop("wall_time"), frame.pop("config")
        if config is not None:
            context = replace(context, config=config)
        series = RunSeries.from_arrays(model, **frame)
        watchdog.expect()
        recorder.record(RunBlock(context, series, scratch, wall_time))
        watchdog.rest()
    watchdog.expect()
    recorder.close()
    watchdog.rest()
    return time.process_time() - start


def _describe(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def _report(output: int, code: int, **answer: Any) -> int:
    os.write(output, json.dumps(answer).encode())
    return code


if __name__ == "__main__":
    # Rerun's clean-up waits without end for a writer that has failed.
    os._exit(main())
