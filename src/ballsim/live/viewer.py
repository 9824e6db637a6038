"""The viewer of a live run: one that runs already, or one that is started."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from urllib.parse import urlsplit

from ballsim.errors import BallsimError, ConfigError, MissingDependencyError
from ballsim.recording.recorder import Recorder, RunBlock, RunContext

__all__ = ["LiveView", "check_viewer", "start_viewer"]

_SCHEMES = ("rerun", "rerun+http", "rerun+https")
_PORT = 9876  # rerun's own
_PATIENCE = 30.0  # until a viewer that is started listens, [s]
_SETTLING_TIME = 1.5  # in which one that cannot draw has ended, [s]
_PAUSE = 0.2  # [s]
_TIMEOUT = 3.0  # of a try to connect, [s]


class LiveView:
    """Shows a run; if the viewer goes away the run goes on without it.

    Args:
        recorder: Who sends the run there.
        notify: Called with a line if that fails.
    """

    def __init__(self, recorder: Recorder, notify: Callable[[str], None]) -> None:
        """Remember who sends."""
        self._recorder: Recorder | None = recorder
        self._notify = notify

    def start(self, context: RunContext) -> None:
        """Send what does not change."""
        self._try(lambda recorder: recorder.start(context))

    def record(self, block: RunBlock) -> None:
        """Send a block."""
        self._try(lambda recorder: recorder.record(block))

    def close(self) -> None:
        """End."""
        self._try(lambda recorder: recorder.close())

    def _try(self, action: Callable[[Recorder], None]) -> None:
        if self._recorder is None:
            return
        try:
            action(self._recorder)
        except BallsimError as error:
            self._recorder = None
            self._notify(f"the viewer shows the run no longer: {error}")


def check_viewer(url: str) -> str:
    """Return the address of a viewer or a server that listens.

    Args:
        url: The address, such as ``rerun+http://127.0.0.1:9876/proxy``.

    Raises:
        ConfigError: It is no such address, or nobody listens there.
    """
    key, where = "--live-connect", "command line"
    example = f"such as rerun+http://127.0.0.1:{_PORT}/proxy"
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port or _PORT
    except ValueError:
        host = None
    if not host or parts.scheme not in _SCHEMES or parts.path != "/proxy":
        raise ConfigError(key, url, f"the address of a rerun viewer, {example}", where)
    if not _is_listening(host, port):
        valid = "the address of a rerun viewer that runs; nobody listens at this one"
        raise ConfigError(key, url, valid, where)
    return url


def start_viewer(environment: Mapping[str, str] = os.environ) -> str:
    """Start rerun's native viewer; it outlives the run.

    Args:
        environment: Variables of the process.

    Returns:
        Its address.

    Raises:
        MissingDependencyError: There is no viewer or no display, or it does not start.
    """
    has_display = environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not has_display:
        package = "a display (DISPLAY or WAYLAND_DISPLAY), or --live-connect URL"
        raise MissingDependencyError("--live", package)
    beside_python = str(Path(sys.executable).parent)
    viewer = shutil.which("rerun", path=beside_python) or shutil.which("rerun")
    if viewer is None:
        raise MissingDependencyError("--live", "the rerun viewer (rerun-sdk)")
    port = _find_free_port()
    words = [viewer, "--bind", "127.0.0.1", "--port", str(port), "--expect-data-soon"]
    process = subprocess.Popen(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    deadline = time.monotonic() + _PATIENCE
    while time.monotonic() < deadline and process.poll() is None:
        if _is_listening("127.0.0.1", port):
            # It listens before it has a window.
            deadline = min(deadline, time.monotonic() + _SETTLING_TIME)
        time.sleep(_PAUSE)
    if process.poll() is None and _is_listening("127.0.0.1", port):
        return f"rerun+http://127.0.0.1:{port}/proxy"
    if process.poll() is None:
        _kill(process)
    package = "a rerun viewer that starts, and this one does not: try `rerun` by itself"
    raise MissingDependencyError("--live", package)


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End a process that has a session of its own, and what it has started."""
    if sys.platform == "win32":
        process.kill()
    else:  # the command `rerun` waits for another process, which is the viewer
        os.killpg(process.pid, signal.SIGKILL)


def _find_free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _is_listening(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host, port), timeout=_TIMEOUT):
            return True
    except OSError:
        return False
