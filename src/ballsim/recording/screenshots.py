"""Pictures of the recording in the viewer, a tab each: for the documentation.

``python -m ballsim.recording.screenshots DIR OUT`` needs a Vulkan driver, which may be
one for the processor (Debian's ``mesa-vulkan-drivers``), and no display.
"""

from __future__ import annotations

import io
import socket
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image
from rerun.experimental import ViewerClient

from ballsim.module_parser import OneLineParser
from ballsim.recording.blueprint import TABS
from ballsim.recording.tracks import TIMELINE

__all__ = ["main", "take_screenshots"]

_MENU_HEIGHT = 38  # of the bar that tells about the machine, [pixel]
_PATIENCE = 30.0  # until a tab is drawn, [s]
_PAUSE = 0.7  # between two looks, [s]
_COLOURS = 256  # a quarter of the size, and nothing to be seen of it


def take_screenshots(recording: Path, moment: float) -> Iterator[tuple[str, bytes]]:
    """Yield name and PNG of each tab.

    Args:
        recording: The ``.rrd`` file.
        moment: Where the cursor stands, [s].

    Raises:
        RuntimeError: The viewer cannot draw, or a tab is never complete.
    """
    viewer = str(Path(sys.executable).parent / "rerun")
    with ViewerClient.spawn(
        headless=True,
        port=_find_free_port(),
        hide_welcome_screen=True,
        executable_path=viewer,
    ) as client:
        client.open(str(recording.absolute()))
        table = _wait_for_blueprint(client)
        tabs = _find_tabs(table)
        for name, content in zip(TABS, tabs["contents"], strict=True):
            tabs["active_tab"] = content
            client.set_blueprint(table, of="recording")
            client.set_time(TIMELINE, duration=moment, play_state="paused")
            yield name, _finish(_wait_for_picture(client))


def main(arguments: list[str] | None = None) -> int:
    """Write the pictures of a run.

    Args:
        arguments: Words of the command line, those of the process if None.
    """
    parser = OneLineParser(prog="python -m ballsim.recording.screenshots")
    parser.add_argument("folder", metavar="DIR", type=Path, help="folder of the run")
    parser.add_argument("out", metavar="OUT", type=Path, help="folder of the pictures")
    parser.add_argument("--moment", type=float, default=10.0, help="time shown [s]")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    for name, content in take_screenshots(options.folder / "run.rrd", options.moment):
        file = options.out / f"tab-{name.replace(' ', '-')}.png"
        file.write_bytes(content)
        print(file)
    return 0


def _find_free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _wait_for_blueprint(client: ViewerClient) -> dict[str, Any]:
    deadline = time.monotonic() + _PATIENCE
    while time.monotonic() < deadline:
        try:
            table: dict[str, Any] = client.get_blueprint().blueprint
        except ConnectionError:  # nothing is loaded yet
            time.sleep(_PAUSE)
            continue
        if any(key.startswith("/container") for key in table):
            return table
        time.sleep(_PAUSE)
    raise RuntimeError("the viewer does not show the recording")


def _find_tabs(table: dict[str, Any]) -> dict[str, Any]:
    for key, value in table.items():
        if key.startswith("/container"):
            content: dict[str, Any] = value["ContainerBlueprint"]
            if content.get("container_kind") == "Tabs":
                return content
    raise RuntimeError("the recording has no tabs")


def _wait_for_picture(client: ViewerClient) -> Image.Image:
    """Return the picture once two of them are equal."""
    deadline, before = time.monotonic() + _PATIENCE, b""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "tab.png"
        while time.monotonic() < deadline:
            time.sleep(_PAUSE)
            client.save_screenshot(str(file))
            content = file.read_bytes()
            if content == before:
                return Image.open(io.BytesIO(content)).convert("RGB")
            before = content
    raise RuntimeError("a tab is never complete")


def _finish(picture: Image.Image) -> bytes:
    """Return a picture without the menu, as PNG."""
    cut = picture.crop((0, _MENU_HEIGHT, *picture.size))
    buffer = io.BytesIO()
    cut.quantize(_COLOURS).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


if __name__ == "__main__":
    sys.exit(main())
