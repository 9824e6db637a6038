"""A film of a run, drawn off screen after it."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim.errors import MissingDependencyError
from ballsim.recording.recorder import RunBlock, RunContext
from ballsim_controllers.messages import Array

__all__ = ["Film", "check_video_support", "draw_frames"]

_FRAME_RATE = 30  # [1/s]
_WIDTH, _HEIGHT = 1280, 720
_CAMERA = "tracking"


def check_video_support() -> None:
    """Check that a film can be made.

    Raises:
        MissingDependencyError: The encoder is not installed.
    """
    if importlib.util.find_spec("imageio_ffmpeg") is None:
        package = "the package imageio-ffmpeg (pip install imageio-ffmpeg)"
        raise MissingDependencyError("--video", package)


class Film:
    """Keeps the states that a film of a run shows, and draws it afterwards."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._context: RunContext | None = None
        self._states: list[Array] = []

    @property
    def n_frames(self) -> int:
        """Return the number of frames so far."""
        return len(self._states)

    def start(self, context: RunContext) -> None:
        """Remember what does not change."""
        self._context = context

    def record(self, block: RunBlock) -> None:
        """Keep the state of each frame in a block."""
        series = block.series
        while (time := self.n_frames / _FRAME_RATE) <= series.time[-1]:
            row = int(np.searchsorted(series.time, time))
            self._states.append(series.qpos[row].copy())

    def close(self) -> None:
        """Do nothing."""

    def write(self, path: Path) -> None:
        """Draw the run in real time and write it as an MP4 file.

        Args:
            path: The file; replaced if it exists.

        Raises:
            MissingDependencyError: Encoder or off-screen drawing is not available.
        """
        assert self._context is not None
        _write_video(self._context.model, self._states, path)


def draw_frames(
    model: mujoco.MjModel, states: Iterable[Array], height: int, width: int
) -> Iterator[npt.NDArray[np.uint8]]:
    """Yield pictures of states, drawn off screen.

    Args:
        model: The compiled scene.
        states: Its states, qpos.
        height: Height of the pictures, [pixel].
        width: Their width, [pixel].

    Yields:
        Pictures, shape (height, width, 3).

    Raises:
        MissingDependencyError: Off-screen drawing is not available.
    """
    data = mujoco.MjData(model)
    try:
        renderer = mujoco.Renderer(model, height, width)
    except Exception as error:  # each OpenGL back end raises its own
        package = f"off-screen OpenGL, see MUJOCO_GL ({error})"
        raise MissingDependencyError("--video", package) from error
    try:
        for qpos in states:
            data.qpos[:] = qpos
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, _CAMERA)
            yield np.ascontiguousarray(renderer.render())
    finally:
        renderer.close()


def _write_video(model: mujoco.MjModel, states: Sequence[Array], path: Path) -> None:
    check_video_support()
    encoder = importlib.import_module("imageio_ffmpeg")
    frames = draw_frames(model, states, _HEIGHT, _WIDTH)
    temporary = path.with_name(f".{path.name}")  # keeps the suffix, for the encoder
    writer = encoder.write_frames(
        str(temporary),
        (_WIDTH, _HEIGHT),
        fps=_FRAME_RATE,
        quality=7,
        macro_block_size=8,
    )
    writer.send(None)
    try:
        for frame in frames:
            writer.send(frame)
        writer.close()
        temporary.replace(path)
    finally:
        writer.close()
        temporary.unlink(missing_ok=True)
