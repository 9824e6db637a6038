"""The recording in rerun's web viewer, in a real browser without a display."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from websockets.sync.client import connect

import ballsim

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PATIENCE = 150.0  # the browser draws without a graphics card, [s]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium"),
]


@pytest.fixture
def start() -> Iterator[Callable[..., tuple[subprocess.Popen[str], str]]]:
    """Start programs, wait for a line of theirs, and end them after the test."""
    running: list[subprocess.Popen[str]] = []

    def launch(words: list[str], pattern: str) -> str:
        process = subprocess.Popen(
            words,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "BROWSER": "true", "NO_COLOR": "1"},
        )
        running.append(process)
        assert process.stdout is not None
        for line in process.stdout:
            plain = re.sub(r"\x1b\[[0-9;]*m", "", line)
            if match := re.search(pattern, plain):
                return match[1]
        raise AssertionError(f"{words[0]} ended without a word")

    yield launch
    for process in running:
        process.terminate()
        process.wait(timeout=20)


def _call(socket: Any, number: int, method: str, **parameters: Any) -> Any:
    socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
    while True:
        answer = json.loads(socket.recv(timeout=PATIENCE))
        if answer.get("id") == number:
            return answer["result"]


def _shows_robot_and_ball(picture: np.ndarray) -> bool:
    """Return True if the 3-D view has a ball in two tones, and a white robot above."""
    height, width = picture.shape[:2]
    view = picture[height // 7 : int(0.8 * height), : int(0.45 * width)].astype(int)
    red, green, blue = np.moveaxis(view, -1, 0)
    is_red = (red > 150) & (green < 110) & (blue < 90)
    is_cream = (red > 170) & (green > 140) & (blue > 90) & (red - blue > 40)
    is_white = (view.min(axis=-1) > 170) & (np.ptp(view, axis=-1) < 30)
    if is_red.sum() < 1000 or is_cream.sum() < 1000 or is_white.sum() < 1000:
        return False
    middle = {
        name: np.argwhere(mask).mean(axis=0)
        for name, mask in (("ball", is_red | is_cream), ("robot", is_white))
    }
    return bool(
        middle["robot"][0] < middle["ball"][0] - 0.1 * height
        and abs(middle["robot"][1] - middle["ball"][1]) < 0.1 * width
    )


def test_web_viewer_draws_robot_and_ball(
    start: Callable[..., str], tmp_path: Path
) -> None:
    """`ballsim view --web`: the page shows the scene, not only a frame around it."""
    ballsim.run("step", out=tmp_path / "run", duration=1.0)
    words = [sys.executable, "-m", "ballsim", "view", "--web", str(tmp_path / "run")]
    url = start(words, r"connect at (\S+)")
    assert url.startswith("http://127.0.0.1:")
    socket_url = start(
        [
            CHROMIUM or "",
            *("--headless=new", "--no-sandbox", "--use-gl=angle"),
            *("--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
            *("--remote-debugging-port=0", "--window-size=1280,800"),
            *(f"--user-data-dir={tmp_path / 'profile'}", "about:blank"),
        ],
        r"DevTools listening on (ws://\S+)",
    )
    port = re.search(r":(\d+)/", socket_url)
    assert port is not None
    with urllib.request.urlopen(f"http://127.0.0.1:{port[1]}/json") as answer:
        pages = [page for page in json.load(answer) if page["type"] == "page"]
    deadline, number = time.monotonic() + PATIENCE, 1
    with connect(pages[0]["webSocketDebuggerUrl"], max_size=None) as socket:
        _call(socket, number, "Page.navigate", url=url)
        while time.monotonic() < deadline:
            time.sleep(3.0)
            number += 1
            shot = _call(socket, number, "Page.captureScreenshot", format="png")
            image = Image.open(io.BytesIO(base64.b64decode(shot["data"])))
            if _shows_robot_and_ball(np.asarray(image.convert("RGB"))):
                return
    pytest.fail("the web viewer never showed robot and ball")
