"""A film of a run, drawn off screen after it."""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path

import mujoco
import numpy as np

from ballsim.errors import MissingDependencyError
from ballsim.simulation import RunResult

__all__ = ["check_video_support", "write_video"]

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


def write_video(result: RunResult, path: Path) -> None:
    """Draw a run in real time and write it as an MP4 file.

    Args:
        result: The run.
        path: The file; replaced if it exists.

    Raises:
        MissingDependencyError: Encoder or off-screen drawing is not available.
    """
    check_video_support()
    encoder = importlib.import_module("imageio_ffmpeg")

    model, series = result.model, result.series
    data = mujoco.MjData(model)
    try:
        renderer = mujoco.Renderer(model, _HEIGHT, _WIDTH)
    except Exception as error:  # each OpenGL back end raises its own
        package = f"off-screen OpenGL, see MUJOCO_GL ({error})"
        raise MissingDependencyError("--video", package) from error
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
        times = np.arange(0.0, result.simulated_time, 1.0 / _FRAME_RATE)
        for row in np.searchsorted(series.time, times).tolist():
            data.qpos[:] = series.qpos[row]
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, _CAMERA)
            writer.send(np.ascontiguousarray(renderer.render()))
        writer.close()
        temporary.replace(path)
    finally:
        renderer.close()
        writer.close()
        temporary.unlink(missing_ok=True)
