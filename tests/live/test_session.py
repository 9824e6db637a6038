"""A run that somebody commands while it goes on, and its repeat from the folder."""

from __future__ import annotations

import json
import os
import signal
import threading
from pathlib import Path

import numpy as np
import pytest

from ballsim.config import Config
from ballsim.config_io import load_config
from ballsim.live.instructions import GoTo, InstructionError, Push, RollAt, Stop
from ballsim.live.operator import Operator
from ballsim.live.pacer import Pacer
from ballsim.live.session import LiveSession
from ballsim.preparation import PreparedRun, prepare
from ballsim.recording.collected import collect_events
from ballsim.recording.recorder import SeriesKeeper
from ballsim.replay import replay
from ballsim.run_files import FinishedRun, run_with_files
from ballsim_controllers.messages import Command


class _Script(Pacer):
    """Lines that come at ticks, and a clock that never lets anybody wait."""

    def __init__(self, lines: dict[int, str]) -> None:
        super().__init__(0.005, print)
        self._lines = lines
        self._due: list[str] = []

    def wait(self, tick: int) -> None:
        self._due = self._lines.get(tick, "").splitlines()

    def poll(self) -> str | None:
        return self._due.pop(0) if self._due else None


def _run(
    folder: Path, lines: dict[int, str], *overrides: str
) -> tuple[FinishedRun, SeriesKeeper, list[str]]:
    config = load_config("walk", ["duration_s=2", *overrides]).config
    prepared, script = prepare(config), _Script(lines)
    replies: list[str] = []
    session = LiveSession(prepared, script, script, replies.append)
    keeper = SeriesKeeper()
    finished = run_with_files(
        prepared, folder, is_logged=False, recorders=[keeper], conductor=session
    )
    return finished, keeper, replies


def test_run_with_an_operator_is_repeated_bit_for_bit(tmp_path: Path) -> None:
    """All that was asked for stands in the folder, from the tick on that it counted."""
    lines = {
        0: "stepping on",
        37: "push 60 left\npush 60 up\npush 30 forwards 0.05 ball",
        60: "target 0.2\nheading 20",
        99: "speed 0.2",
        161: "stop\npush 5 back 3 ear",
        203: "quit\ntarget 3",
    }
    finished, keeper, replies = _run(tmp_path, lines)
    series, config = keeper.series, finished.outcome.config
    assert replay(tmp_path) == finished.summary["trajectory_sha256"]
    again = load_config(tmp_path / "config.toml").config
    assert (again.command, again.pushes) == (config.command, config.pushes)
    # It ended where it was told to, and counts as done.
    assert series.n_ticks == config.n_ticks == 203
    assert finished.summary["simulated_time"] == finished.summary["duration"] == 1.015
    # The scenario's own timeline is over from the first command on.
    ticks = [config.find_tick(point.time) for point in config.command.timeline]
    assert ticks == [0, 60, 99, 161]
    assert series.commands[59] == Command(is_stepping=True)
    turned = np.radians(20.0)
    assert series.commands[60] == Command(0.2, True, heading=turned)
    assert series.commands[99] == Command(0.0, True, 0.2, heading=turned)
    # Pushes act for as long as they last, on what they were meant for.
    assert series.wrenches is not None
    trunk, ball = finished.outcome.ids.body_trunk, finished.outcome.ids.body_ball
    for body, force, first, n in ((trunk, 60.0, 37, 20), (ball, 30.0, 37, 10)):
        sizes = np.linalg.norm(series.wrenches[:, body, :3], axis=1)
        np.testing.assert_array_equal(np.flatnonzero(sizes), first + np.arange(n))
        np.testing.assert_allclose(sizes[first], force, rtol=1e-12)
    events = collect_events(finished.outcome.context, series)
    told = [(event.time, event.kind) for event in events if event.kind != "gait"]
    assert told == [
        *((0.0, "command"), (0.185, "push"), (0.185, "push"), (0.3, "command")),
        *((0.495, "command"), (0.805, "command")),
    ]
    refused = [line for line in replies if "is not valid" in line]
    assert [line.split()[0] for line in refused] == ["0.185", "0.805"]
    assert "body = 'ear' is not valid: one of trunk" in refused[1]


def test_nobody_commands_and_nothing_changes(tmp_path: Path) -> None:
    """Without a line it is the ordinary run, byte for byte."""
    finished, *_ = _run(tmp_path / "live", {}, "duration_s=0.5")
    config = load_config("walk", ["duration_s=0.5"]).config
    plain = run_with_files(prepare(config), tmp_path / "plain", is_logged=False)
    for name in ("config.toml", "controls.npz"):
        files = [(tmp_path / kind / name).read_bytes() for kind in ("live", "plain")]
        assert files[0] == files[1], name
    digest = finished.summary["trajectory_sha256"]
    assert digest == plain.summary["trajectory_sha256"]


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signal_ends_the_run_as_quit_does(tmp_path: Path, name: str) -> None:
    """The files are written; a second one breaks the run off."""
    config = load_config("stand", ["duration_s=2"]).config
    script, number = _Script({}), getattr(signal, name)

    class Interrupted(_Script):
        def wait(self, tick: int) -> None:
            if tick == 30:
                os.kill(os.getpid(), number)

    assert threading.current_thread() is threading.main_thread()
    session = LiveSession(prepare(config), script, Interrupted({}), print)
    before = signal.signal(number, signal.default_int_handler)
    try:
        with session.end_on_signal():
            run_with_files(
                prepare(config), tmp_path, is_logged=False, conductor=session
            )
            summary = json.loads((tmp_path / "summary.json").read_text())
            assert 0.15 <= summary["simulated_time"] <= 0.2
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), number)
        assert signal.getsignal(number) == signal.default_int_handler
        signal.signal(number, signal.SIG_IGN)
        with session.end_on_signal():  # as with nohup: ignored by whoever started us
            assert signal.getsignal(number) == signal.SIG_IGN
    finally:
        signal.signal(number, before)


@pytest.fixture(name="prepared", scope="module")
def _prepared() -> PreparedRun:
    config = load_config("stand", ["duration_s=1"]).config
    return prepare(config)


def test_what_cannot_be_changes_nothing(prepared: PreparedRun) -> None:
    """The configuration stays as it was, and the complaint is one line."""
    operator = Operator(prepared)
    before: Config = operator.config
    for instruction, message in (
        (Push(1e9, 0.0), "force_n = 1000000000.0 is not valid"),
        (Push(10.0, 0.0, body="ear"), "body = 'ear' is not valid: one of trunk"),
        (RollAt(99.0), "ball_speed_rad_s = 99.0 is not valid"),
        (GoTo(1e5, 1.0), "distance_m"),
        (Stop(), "stop is not valid: nothing is known of the ball"),
    ):
        with pytest.raises(InstructionError) as caught:
            operator.act(instruction, 0)
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)
    assert operator.config is before


def test_place_is_that_of_a_distance_and_a_direction(prepared: PreparedRun) -> None:
    """Sideways it is a place, straight ahead an angle of the ball."""
    operator = Operator(prepared)
    operator.act(GoTo(0.3, -0.4), 5)
    operator.act(GoTo(-0.2, 0.0), 7)
    first, second = operator.config.command.timeline
    radius = operator.config.ball.radius
    assert first.find_place(radius) == pytest.approx((0.3, -0.4))
    assert second.target_ball_angle == pytest.approx(-0.2 / radius)
    assert second.find_place(radius) == pytest.approx((-0.2, 0.0))
