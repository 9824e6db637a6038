"""``controls.npz``: what each ``mj_step`` was given, written without holding it all."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from ballsim.recording.recorder import RunBlock, RunContext
from ballsim.spool import Spool, write_array
from ballsim_controllers.messages import Array

__all__ = ["ControlsRecorder"]


class ControlsRecorder:
    """Spools the inputs of a run into its folder, to write them out at its end.

    Set-points that act late are written where they acted. A drive closes its loop on
    its encoder, MuJoCo's on the joint's angle: they are written less what the encoder
    reads too much.

    Args:
        folder: Folder of the run; it exists when the run starts.
    """

    def __init__(self, folder: Path) -> None:
        """Remember the folder."""
        self._folder = folder
        self._spools: dict[str, Spool] = {}
        self._context: RunContext | None = None
        self._start: dict[str, Array] = {}
        self._is_pushed = False

    def start(self, context: RunContext) -> None:
        """Remember what does not change."""
        self._context = context

    def record(self, block: RunBlock) -> None:
        """Spool the inputs of a block."""
        series, self._context = block.series, block.context
        arrays = {"ctrl": block.context.find_inputs(series.ctrl)}
        if series.wrenches is not None:
            arrays["xfrc_applied"] = series.wrenches
            self._is_pushed = self._is_pushed or bool(series.wrenches.any())
        if block.is_first:
            self._start = {"qpos0": series.qpos[0], "qvel0": series.qvel[0]}
            for name, rows in arrays.items():
                self._spools[name] = Spool(self._folder, rows.shape[1:])
        for name, rows in arrays.items():
            self._spools[name].append(rows)

    def close(self) -> None:
        """Do nothing yet: the run's end is not the end of the spool."""

    def write(self, file: IO[bytes]) -> None:
        """Write the archive as ``numpy.savez_compressed`` would, and drop the spool.

        Args:
            file: Open for writing.
        """
        assert self._context is not None
        config = self._context.config
        n, timestep = config.n_substeps, config.scene.timestep
        late = {"ctrl": config.n_late_steps}
        spools, n_steps = self._spools, n * self._spools["ctrl"].n_rows
        if not self._is_pushed and not config.pushes:  # nobody made use of the chance
            spools.pop("xfrc_applied", None)
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            times: Array = timestep * np.arange(n_steps, dtype=np.float64)
            write_array(archive, "time", (n_steps,), iter([times]))
            for name, spool in spools.items():
                repeated = (np.repeat(rows, n, axis=0) for rows in spool.read())
                acting = _delay(repeated, late.get(name, 0), n_steps)
                write_array(archive, name, (n_steps, *spool.shape), acting)
            for name, row in self._start.items():
                write_array(archive, name, row.shape, iter([row]))
        for spool in spools.values():
            spool.close()


def _delay(parts: Iterator[Array], n_late: int, n_rows: int) -> Iterator[Array]:
    """Yield the first row so many times, then all rows, but no more than n_rows."""
    for part in parts:
        if n_late > 0:
            yield np.repeat(part[:1], min(n_late, n_rows), axis=0)
            n_rows, n_late = max(0, n_rows - n_late), 0
        yield part[:n_rows]
        n_rows -= len(part[:n_rows])
