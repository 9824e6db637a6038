"""``ballsim run``: from the words of the command line to the files of the run.

Heavy imports happen inside, so that the recording's process starts before them and
loads its libraries beside ours.
"""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ballsim.errors import ConfigError

if TYPE_CHECKING:
    from ballsim.recording.recorder import Recorder
    from ballsim.run_files import FinishedRun

__all__ = ["RunOptions", "run_command"]

_SLOW_START = "compiling the controller: a minute or two, once for each installation"


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What is asked for.

    Attributes:
        scenario: Name of a scenario, or path of a TOML file.
        overrides: ``key=value``, each changing a value.
        out: Folder of the files; None for the next free one.
        is_logged: True to write the recording.
        has_video: True to write a film.
        is_live: True to run at real time, in a viewer and with an operator.
        viewer: Address of that viewer; None to start one.
        command_line: What was typed, for the summary.
    """

    scenario: str
    overrides: tuple[str, ...]
    out: Path | None
    is_logged: bool
    has_video: bool
    is_live: bool
    viewer: str | None
    command_line: str


def run_command(asked: RunOptions) -> FinishedRun:
    """Run a scenario and write its files.

    Args:
        asked: What is asked for.

    Raises:
        ConfigError: An input is not valid; nothing is written then.
        MissingDependencyError: Film or viewer cannot be.
        PhysicsError: The physics failed; the folder holds the last states.
    """
    film = None
    if asked.has_video:
        os.environ.setdefault("MUJOCO_GL", "egl")  # before MuJoCo is imported
        from ballsim.recording.video import Film, check_video_support

        check_video_support()
        film = Film()
    from ballsim.config_io import load_config
    from ballsim.recording.encoder_process import EncoderProcess

    loaded = load_config(asked.scenario, asked.overrides)
    recorders: list[Recorder] = [] if film is None else [film]
    with contextlib.ExitStack() as stack:
        encoder = live = None
        if asked.is_logged:
            encoder = stack.enter_context(EncoderProcess())
        if asked.is_live:
            from ballsim.live.command import LiveRun

            live = LiveRun(asked.viewer)
            stack.callback(live.view.close)
            recorders.append(live.view)
        from ballsim.console import explain_delay, make_progress
        from ballsim.preparation import prepare
        from ballsim.run_files import VIDEO_FILE, choose_out_dir, run_with_files

        try:
            with explain_delay(_SLOW_START, patience=4.0):
                prepared = prepare(loaded.config)
        except ConfigError as error:
            raise loaded.source.locate(error) from None
        folder = asked.out or choose_out_dir(loaded.config.scenario)
        progress = conductor = None
        if live is None:
            progress = stack.enter_context(make_progress(loaded.config))
        else:
            conductor = stack.enter_context(live.conduct(prepared))
        finished = run_with_files(
            prepared,
            folder,
            is_logged=asked.is_logged,
            progress=progress,
            command=asked.command_line,
            recorders=recorders,
            encoder=encoder,
            conductor=conductor,
        )
    if film is not None:
        film.write(folder / VIDEO_FILE)
    return finished
