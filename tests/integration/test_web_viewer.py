"""The recording in rerun's web viewer, in a real browser without a display."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import mujoco
import numpy as np
import pytest
from PIL import Image
from rerun.chunk import RrdReader
from websockets.sync.client import connect

import ballsim
from ballsim.reference import format_signals

DOCS = Path(__file__).resolve().parents[2] / "docs"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PATIENCE = 150.0  # the browser draws without a graphics card, [s]
_ENVIRONMENT = {"BROWSER": "true", "NO_COLOR": "1", "RUST_LOG": "info"}

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium")


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
            env={**os.environ, **_ENVIRONMENT},
            start_new_session=True,
        )
        running.append(process)
        assert process.stdout is not None
        for line in process.stdout:
            plain = re.sub(r"\x1b\[[0-9;]*m", "", line)
            if match := re.search(pattern, plain):
                return match[1]
        raise AssertionError(f"{words[0]} ended without a word")

    yield launch
    for process in running:  # `rerun` starts another process, Chromium many
        os.killpg(process.pid, signal.SIGTERM)
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


@pytest.fixture(name="run", scope="module")
def _run(tmp_path_factory: pytest.TempPathFactory) -> ballsim.RunResult:
    """A run in which all happens that can be drawn, but for a fall."""
    folder = tmp_path_factory.mktemp("run")
    changes = {"force": 20, "push.0.time_s": 0.6, "push.0.time_spread_s": 0}
    start = {"command.timeline.0.time_s": 0.2, "duration": 1.5}
    ballsim.run("push-stepping", out=folder, **changes, **start)
    return ballsim.load(folder)


@pytest.fixture(name="url")
def _url(start: Callable[..., str], run: ballsim.RunResult) -> str:
    """What `ballsim view --web` tells to open."""
    words = [sys.executable, "-m", "ballsim", "view", "--web", str(run.folder)]
    return start(words, r"connect at (\S+)")


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_web_viewer_gets_every_documented_entity(
    start: Callable[..., str], run: ballsim.RunResult, url: str, tmp_path: Path
) -> None:
    """What the page is served is read back whole: series, events, what is drawn."""
    (address,) = parse_qs(urlsplit(url).query)["url"]
    received = tmp_path / "received.rrd"
    viewer = str(Path(sys.executable).parent / "rerun")
    options = ("--bind", "127.0.0.1", "--port", "auto", "--save", str(received))
    start([viewer, *options, address], r"(Saving incoming log stream)")
    documented = set(re.findall(r"^\| `([\w/]+)` \|", format_signals(), re.M))
    documented.add("performance/realtime_factor")
    seen = _load_whole(received, run)
    assert set(seen.signals) == documented
    for path in documented:
        assert len(seen[path]) > 0
        assert np.array_equal(seen[path].values, run[path].values, equal_nan=True)
        assert seen[path].description == run[path].description
    assert seen.events == run.events
    assert {event.kind for event in seen.events} == {"gait", "command", "push"}
    assert seen.config == run.config
    entities = {str(chunk.entity_path) for chunk in RrdReader(received).stream()}
    table = (DOCS / "reference" / "recording.md").read_text(encoding="utf-8")
    trees = re.findall(r"`(/[a-z_/]+)`", table)
    assert len(trees) > 10
    for tree in trees:
        assert any(f"{path}/".startswith(f"{tree}/") for path in entities), tree
    things = (
        "floor",
        "ball",
        "com",
        "cop",
        "targets",
        "landings",
        "contacts",
        "pushes",
    )
    assert {f"/world/{thing}" for thing in things} <= entities
    model = mujoco.MjModel.from_xml_path(str(run.folder / "scene.xml"))
    bodies = {model.body(i).name for i in range(1, model.nbody)}
    assert bodies <= {path.rpartition("/")[2] for path in entities}


def _load_whole(received: Path, run: ballsim.RunResult) -> ballsim.RunResult:
    """Return what has been received once it has all rows of a run."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        time.sleep(1.0)
        try:
            seen = ballsim.load(received)
        except ballsim.ConfigError:  # it has just begun
            continue
        if all(
            len(seen.signals.get(path, ())) >= len(run[path]) for path in run.signals
        ):
            return seen
    pytest.fail("the server never gave all of the recording")


def test_web_viewer_draws_robot_and_ball(
    start: Callable[..., str], url: str, tmp_path: Path
) -> None:
    """`ballsim view --web`: the page shows the scene, not only a frame around it."""
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
