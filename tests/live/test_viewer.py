"""The viewer of a live run: found, started, or refused in one line."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ballsim import cli
from ballsim.errors import BallsimError
from ballsim.live.viewer import LiveView, check_viewer
from ballsim.recording.recorder import RunBlock, RunContext


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


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="groups of processes")
def test_live_run_is_streamed_and_repeated(tmp_path: Path) -> None:
    """The stream that a server gets holds what was typed; the repeat is identical."""
    import ballsim

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    received, binaries = tmp_path / "received.rrd", Path(sys.executable).parent
    words = ["--bind", "127.0.0.1", "--port", str(port), "--save", str(received)]
    server = subprocess.Popen(
        [binaries / "rerun", *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        _wait_for(port)
        url = f"rerun+http://127.0.0.1:{port}/proxy"
        words = ["run", "stand", "--duration", "60", "--live-connect", url]
        run = subprocess.Popen(
            [binaries / "ballsim", *words, "--out", str(tmp_path / "run"), "--json"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert run.stdin is not None
        assert run.stderr is not None
        while not run.stderr.readline().startswith("live; type help"):
            assert run.poll() is None
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
    finally:
        os.killpg(server.pid, signal.SIGINT)
        server.wait(timeout=60)
    seen, kept = ballsim.load(received), ballsim.load(tmp_path / "run")
    for result in (seen, kept):
        kinds = [event.kind for event in result.events]
        assert kinds.count("push") == kinds.count("command") == 1
    assert len(seen["truth/cop"]) == len(kept["truth/cop"]) > 200
    assert seen.config.pushes == kept.config.pushes
    assert cli.main(["replay", str(tmp_path / "run")]) == 0


def _wait_for(port: int) -> None:
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("the server does not listen")
