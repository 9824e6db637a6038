"""A picture of a run as its film shows it: for the documentation.

``python -m ballsim.recording.film_frame DIR FILE.png`` steps plain MuJoCo through what
the folder of a run holds, and draws off screen; several moments side by side.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from ballsim.errors import MissingDependencyError
from ballsim.module_parser import OneLineParser

if TYPE_CHECKING:
    import mujoco

__all__ = ["main"]

_SIZE = (900, 680)  # height and width, [pixel]
_SIZE_OF_MANY = (450, 340)


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the picture; see the module.

    Args:
        arguments: Words of the command line, those of the process if None.
    """
    parser = OneLineParser(prog="python -m ballsim.recording.film_frame")
    parser.add_argument("folder", metavar="DIR", type=Path, help="folder of the run")
    parser.add_argument("file", metavar="FILE.png", type=Path, help="the picture")
    text = "times shown [s], one after the other"
    parser.add_argument("--moment", type=float, nargs="+", default=[9.72], help=text)
    options = parser.parse_args(arguments)
    if options.moment != sorted(options.moment):
        parser.error("--moment: times that increase are valid")
    os.environ.setdefault("MUJOCO_GL", "egl")  # before MuJoCo is imported
    from ballsim.recording.video import draw_frames  # noqa: PLC0415

    model, states = _find_states(options.folder, options.moment)
    size = _SIZE if len(states) == 1 else _SIZE_OF_MANY
    model.vis.global_.offheight, model.vis.global_.offwidth = size
    try:
        picture = np.hstack(list(draw_frames(model, states, *size)))
    except MissingDependencyError as error:
        parser.error(str(error))
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="PNG", optimize=True)
    options.file.write_bytes(buffer.getvalue())
    print(options.file)
    return 0


def _find_states(
    folder: Path, moments: Sequence[float]
) -> tuple[mujoco.MjModel, list[np.ndarray]]:
    """Return the scene of a run and its states at increasing times in [s]."""
    import mujoco  # noqa: PLC0415

    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    data = mujoco.MjData(model)
    with np.load(folder / "controls.npz") as inputs:
        data.qpos[:], data.qvel[:] = inputs["qpos0"], inputs["qvel0"]
        times, ctrl = inputs["time"], inputs["ctrl"]
        wrenches = inputs.get("xfrc_applied")
    states, first = [], 0
    for last in np.searchsorted(times, np.array(moments) - 1e-9):
        for step in range(first, last):
            data.ctrl[:] = ctrl[step]
            if wrenches is not None:
                data.xfrc_applied[:] = wrenches[step]
            mujoco.mj_step(model, data)
        first = last
        states.append(data.qpos.copy())
    return model, states


if __name__ == "__main__":
    sys.exit(main())
