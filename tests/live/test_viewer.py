"""The viewer of a live run: found, started, or refused in one line."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ballsim import cli
from ballsim.errors import BallsimError
from ballsim.live.viewer import LiveView, check_viewer
from ballsim.recording.recorder import RunBlock, RunContext

BINARIES = Path(sys.executable).parent


def test_what_cannot_be_shown_exits_with_2(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """One line on stderr, and nothing is written."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        deaf = f"rerun+http://127.0.0.1:{probe.getsockname()[1]}/proxy"
        cases = [
            (["--live-connect", deaf], "nobody listens"),
            (["--live-connect", "localhost:9876"], "rerun+http://127.0.0.1:9876/proxy"),
            (["--live-connect", "rerun+http://[::1/proxy"], "the address of a rerun"),
        ]
        if sys.platform.startswith("linux"):
            cases.append((["--live"], "needs a display"))
        for words, message in cases:
            assert cli.main(["run", "stand", "--no-log", *words]) == 2
            (line,) = capsys.readouterr().err.splitlines()
            assert message in line
    assert list(tmp_path.iterdir()) == []


def test_viewer_that_listens_is_taken() -> None:
    """Its address is all that is needed."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        url = f"rerun+http://127.0.0.1:{server.getsockname()[1]}/proxy"
        assert check_viewer(url) == url


class _Failing:
    """A recorder whose viewer goes away."""

    def __init__(self) -> None:
        self.calls = 0

    def start(self, context: RunContext) -> None:
        self.calls += 1

    def record(self, block: RunBlock) -> None:
        self.calls += 1
        raise BallsimError("gone")

    def close(self) -> None:
        self.calls += 1


def test_run_goes_on_without_its_viewer() -> None:
    """A viewer that was closed is told of once, and troubled no more."""
    lines: list[str] = []
    recorder = _Failing()
    view = LiveView(recorder, lines.append)
    view.start(None)  # type: ignore[arg-type]
    for _ in range(3):
        view.record(None)  # type: ignore[arg-type]
    view.close()
    assert lines == ["the viewer shows the run no longer: gone"]
    assert recorder.calls == 2


@pytest.fixture(name="server")
def _server(tmp_path: Path) -> Iterator[tuple[str, Callable[[], Path]]]:
    """Give the address of a server, and what ends it and gives what it has got."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    received = tmp_path / "received.rrd"
    words = ["--bind", "127.0.0.1", "--port", str(port), "--save", str(received)]
    process = subprocess.Popen(
        [BINARIES / "rerun", *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )

    def end() -> Path:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
            process.wait(timeout=60)
        return received

    try:
        _wait_for(port)
        yield f"rerun+http://127.0.0.1:{port}/proxy", end
    finally:
        end()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="groups of processes")
def test_live_run_is_streamed_and_repeated(
    tmp_path: Path, server: tuple[str, Callable[[], Path]]
) -> None:
    """The stream that a server gets holds what was typed; the repeat is identical."""
    import ballsim

    url, end_server = server
    words = ["run", "stand", "--duration", "60", "--live-connect", url]
    run = subprocess.Popen(
        [BINARIES / "ballsim", *words, "--out", str(tmp_path / "run"), "--json"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert run.stdin is not None
    assert run.stderr is not None
    while not run.stderr.readline().startswith("live; type help"):
        assert run.poll() is None
    time.sleep(1.0)  # a robot that has not found its balance yet falls
    for line in ("push 60 left", "jump", "target 0.1"):
        run.stdin.write(f"{line}\n")
        run.stdin.flush()
        time.sleep(0.5)
    start = time.monotonic()
    run.stdin.write("quit\n")
    _, replies = run.communicate(timeout=120)
    assert run.returncode == 0, replies
    assert time.monotonic() - start < 30.0  # not the minute that was configured
    assert "'jump' is not valid" in replies
    seen, kept = ballsim.load(end_server()), ballsim.load(tmp_path / "run")
    for result in (seen, kept):
        kinds = [event.kind for event in result.events]
        assert kinds.count("push") == kinds.count("command") == 1
    assert len(seen["truth/cop"]) == len(kept["truth/cop"]) > 200
    assert seen.config.pushes == kept.config.pushes
    assert cli.main(["replay", str(tmp_path / "run")]) == 0


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no terminals")
def test_live_run_at_a_terminal(
    tmp_path: Path, server: tuple[str, Callable[[], Path]]
) -> None:
    """Keys act without Enter; `kill` leaves files and terminal as they should be."""
    import pty
    import termios

    person, program = pty.openpty()
    before = termios.tcgetattr(program)
    words = ["run", "stand", "--duration", "60", "--live-connect", server[0]]
    run = subprocess.Popen(
        [BINARIES / "ballsim", *words, "--out", str(tmp_path / "run"), "--no-log"],
        stdin=program,
        stdout=subprocess.DEVNULL,
        stderr=program,
    )
    try:
        _read_until(person, b"live; keys: arrows push")
        assert not termios.tcgetattr(program)[3] & termios.ICANON
        os.write(person, b"\x1b[D")
        _read_until(person, b"push of 40 N at 90 deg")
        os.write(person, b"target 0.1\n")
        _read_until(person, b"target of 0.1 rad")
        time.sleep(0.2)  # lest the run end before that counts
        run.terminate()
        _read_until(person, b"real time was")
        assert run.wait(timeout=60) == 0
        assert termios.tcgetattr(program) == before
    finally:
        run.kill()
        run.wait()
        os.close(person)
        os.close(program)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["target_ball_angle"] == 0.1
    assert summary["simulated_time"] < 60.0
    assert cli.main(["replay", str(tmp_path / "run")]) == 0


def _read_until(terminal: int, text: bytes) -> None:
    """Read what a terminal shows until a text comes."""
    content, deadline = b"", time.monotonic() + 120.0
    while text not in content:
        left = deadline - time.monotonic()
        assert select.select([terminal], [], [], max(0.0, left))[0], content
        content += os.read(terminal, 4096)


def _wait_for(port: int) -> None:
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("the server does not listen")
