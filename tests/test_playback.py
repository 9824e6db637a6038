"""``readings.npz``: the controller, fed from the file, gives the same joint targets."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.preparation import prepare
from ballsim.recording.recorder import SeriesKeeper
from ballsim.run_files import READINGS_FILE, run_with_files
from ballsim.series import RunSeries
from ballsim_controllers.commands import (
    Circle,
    Command,
    FigureEight,
    FloorPath,
    WayPoints,
)
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.playback import find_difference, main, play
from ballsim_controllers.recorded_readings import describe_commands, load_readings


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RunSeries]:
    """Return the readings of a noisy run whose commands change, and its series."""
    folder = tmp_path_factory.mktemp("run")
    overrides = ["duration_s=2.5", "sensors.preset=mid", "target_angle=1", "seed=3"]
    keeper = SeriesKeeper()
    run_with_files(
        prepare(load_config("roll-to", overrides).config),
        folder,
        is_logged=False,
        recorders=[keeper],
    )
    return folder / READINGS_FILE, keeper.series


def test_file_holds_what_the_controller_got(run: tuple[Path, RunSeries]) -> None:
    """Readings and targets of each tick, and the command that was given then."""
    file, series = run
    recorded = load_readings(file)
    assert len(recorded) == series.n_ticks == 500
    assert recorded.readings.tobytes() == series.readings.rows.tobytes()
    np.testing.assert_array_equal(recorded.joint_targets, series.ctrl)
    pairs = list(recorded.ticks())
    assert [command for _, command in pairs] == series.commands
    assert len(set(series.commands)) > 1
    assert pairs[7][0].record.tobytes() == series.readings.rows[7].tobytes()


@pytest.mark.parametrize(
    "path", [Circle(-1.5), FigureEight(2.0, 1.0), WayPoints(((0.0, 0.0), (1.0, 0.5)))]
)
def test_file_holds_any_path(
    run: tuple[Path, RunSeries], tmp_path: Path, path: FloorPath
) -> None:
    """A command with a path comes back as it was given."""
    commands = [Command(path=path, path_speed=0.1), Command(heading=0.3)]
    with np.load(run[0]) as archive:
        arrays = dict(archive) | {"commands": np.array(describe_commands(commands))}
    np.savez(tmp_path / "path.npz", **arrays)
    assert load_readings(tmp_path / "path.npz").commands == commands


def test_playback_reproduces_every_bit(run: tuple[Path, RunSeries]) -> None:
    """The controller sees nothing but the file."""
    recorded = load_readings(run[0])
    answers = play(recorded)
    assert answers.tobytes() == recorded.joint_targets.tobytes()
    assert find_difference(recorded, answers) is None


def test_playback_needs_no_simulator(run: tuple[Path, RunSeries]) -> None:
    """The command runs in a process that never imports the simulator."""
    code = (
        "import sys; from ballsim_controllers.playback import main; "
        f"code = main([{str(run[0])!r}]); "
        "assert 'ballsim' not in sys.modules; sys.exit(code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "identical: 500 ticks, 18 joint targets each\n"


def test_playback_notices_one_bit(
    run: tuple[Path, RunSeries], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A reading that differs by a bit gives another answer, which is named."""
    with np.load(run[0]) as archive:
        arrays = dict(archive)
    arrays["joint_positions"][300, 4] = np.nextafter(
        arrays["joint_positions"][300, 4], 9.0
    )
    np.savez(tmp_path / "other.npz", **arrays)
    assert main([str(tmp_path / "other.npz")]) == 4
    message = capsys.readouterr().err
    assert "first at 1.5 s" in message
    assert message.count("\n") == 1


_ARRAY = io.BytesIO()
np.save(_ARRAY, np.zeros(3))


@pytest.mark.parametrize("content", [b"", b"no archive", _ARRAY.getvalue()])
def test_bad_file_takes_one_line(
    tmp_path: Path, content: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is no recording is bad input, like a file that is not there."""
    file = tmp_path / "bad.npz"
    file.write_bytes(content)
    for path in (file, tmp_path / "none.npz"):
        assert main([str(path)]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_file_that_lacks_something_is_refused(
    run: tuple[Path, RunSeries], tmp_path: Path
) -> None:
    """A missing array is named."""
    with np.load(run[0]) as archive:
        arrays = {k: v for k, v in archive.items() if k != "command_of_tick"}
    np.savez(tmp_path / "less.npz", **arrays)
    with pytest.raises(InvalidSettingError, match="command_of_tick"):
        load_readings(tmp_path / "less.npz")
