"""The recording's own process: the same columns, and no failure is lost."""

from __future__ import annotations

import dataclasses
import os
import signal
import threading
import time
from collections import namedtuple
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ballsim import cli
from ballsim.config_io import load_config
from ballsim.errors import BallsimError, PhysicsError
from ballsim.plant import Plant
from ballsim.preparation import prepare
from ballsim.recording import encoder, encoder_process
from ballsim.recording.encoder_process import EncoderProcess
from ballsim.recording.frames import read_frame, unpack_frame, write_frame
from ballsim.recording.paths import SPEED_PATH
from ballsim.recording.recording_process import RecordingProcess
from ballsim.run_files import RECORDING_FILE, run_with_files
from ballsim.series import RunSeries
from ballsim.simulation import run, run_prepared

pytest.importorskip("rerun")

CONFIG = load_config("roll-to", ["duration_s=0.9"]).config


def _read(file: Path) -> dict[tuple[str, str], list[Any]]:
    """Return all values of a recording by entity and column, in the order of time."""
    from rerun.chunk import RrdReader

    rows: dict[tuple[str, str], list[tuple[int, Any]]] = {}
    for chunk in RrdReader(file).stream():
        batch = chunk.to_record_batch()
        names = set(batch.schema.names)
        is_timed = "sim_time" in names
        n = batch.num_rows
        times = (
            batch.column("sim_time").cast("int64").to_pylist() if is_timed else [0] * n
        )
        for name in names:
            if ":" not in name or name == "RecordingInfo:start_time":
                continue
            if str(chunk.entity_path) == SPEED_PATH:
                continue
            key = (str(chunk.entity_path), name)
            values = batch.column(name).to_pylist()
            rows.setdefault(key, []).extend(zip(times, values, strict=True))
    return {
        key: [repr(value) for _, value in sorted(pairs, key=lambda pair: pair[0])]
        for key, pairs in rows.items()
    }


def test_recording_is_that_of_the_loop_itself(tmp_path: Path) -> None:
    """Every column of every entity holds what a recorder here would write."""
    from ballsim.recording.rerun_recorder import RerunRecorder

    run_prepared(prepare(CONFIG), RerunRecorder(tmp_path / "here.rrd"))
    run_prepared(prepare(CONFIG), RecordingProcess(tmp_path / "there.rrd"))
    here, there = _read(tmp_path / "here.rrd"), _read(tmp_path / "there.rrd")
    assert len(here) > 50
    assert set(here) == set(there)
    assert [key for key in here if here[key] != there[key]] == []


def test_series_comes_back_from_its_arrays() -> None:
    """Nothing of a block is lost on the way, pushes included."""
    overrides = ["duration_s=0.1", "simulation.control_period_s=0.002"]
    result = run(load_config("stand", overrides).config)
    series = result.series
    series.wrenches = np.ones((series.n_ticks, result.model.nbody, 6))
    arrays = series.to_arrays()
    again = RunSeries.from_arrays(result.model, 7, arrays)
    assert (again.first_tick, again.n_ticks) == (7, series.n_ticks)
    assert again.contacts.n_contacts == series.contacts.n_contacts > 0
    assert np.array_equal(again.readings.rows, series.readings.rows)
    assert again.telemetry.rows.tobytes() == series.telemetry.rows.tobytes()
    for name, array in again.to_arrays().items():
        assert array.tobytes() == arrays[name].tobytes(), name


def test_frames_pass_a_pipe_that_is_smaller() -> None:
    """A message of any size comes whole; one that is cut off is the end."""
    reader, writer = os.pipe()
    message = {"rows": np.arange(3e5), "odd": np.arange(3, dtype=np.uint8), "none": 0}
    thread = threading.Thread(target=write_frame, args=(writer, message))
    thread.start()
    came = unpack_frame(read_frame(reader))
    thread.join()
    assert all(np.array_equal(came[name], message[name]) for name in message)
    write_frame(writer, {"rows": np.arange(10.0)})
    cut = os.read(reader, 10_000)[:-1]
    os.write(writer, cut)
    os.close(writer)
    with pytest.raises(EOFError):
        read_frame(reader)
    os.close(reader)


def test_failure_there_is_one_error_here(tmp_path: Path) -> None:
    """What the process could not do is said by our own error, once."""
    recording = RecordingProcess(tmp_path / "nowhere" / "run.rrd")
    with pytest.raises(BallsimError, match=r"the recording failed: .*No such file"):
        run_prepared(prepare(CONFIG), recording)
    recording.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
def test_full_disk_is_one_error(tmp_path: Path) -> None:
    """A disk without space ends in an error, not in silence."""
    recording = RecordingProcess(Path("/dev/full"))
    with pytest.raises(BallsimError, match="No space left"):
        run_prepared(prepare(CONFIG), recording)


def test_process_that_is_killed_is_one_error(tmp_path: Path) -> None:
    """The loop goes no further than the pipe is long, and tells what happened."""
    encoder = EncoderProcess()
    os.kill(encoder._process.pid, signal.SIGKILL)
    with pytest.raises(BallsimError, match="died: Killed"):
        run_with_files(prepare(CONFIG), tmp_path, encoder=encoder)


def _break_at(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    step = Plant.step

    def break_late(plant: Plant, *inputs: Any) -> Any:
        if plant.time > 0.85:
            raise error
        return step(plant, *inputs)

    monkeypatch.setattr(Plant, "step", break_late)


@pytest.mark.parametrize("error", [PhysicsError("test", 0.85), KeyboardInterrupt()])
def test_recording_is_finished_after_a_failure(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A loop that fails or is interrupted leaves a complete recording."""
    _break_at(monkeypatch, error)
    with pytest.raises(type(error)):
        run_with_files(prepare(CONFIG), tmp_path)
    rows = _read(tmp_path / RECORDING_FILE)["/truth/cop", "Scalars:scalars"]
    assert len(rows) >= round(0.8 / CONFIG.simulation.control_period)


def test_interrupt_does_not_end_the_process(tmp_path: Path) -> None:
    """SIGINT is none of its business: neither its group gets it nor it heeds it."""
    encoder = EncoderProcess()
    pid = encoder._process.pid
    assert os.getpgid(pid) != os.getpgid(0)
    recording = RecordingProcess(tmp_path / "run.rrd", encoder)
    recording.start(run(dataclasses.replace(CONFIG, duration=0.1)).context)
    deadline = time.monotonic() + 60.0
    while not (tmp_path / "run.rrd").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(pid, signal.SIGINT)
    recording.close()
    assert encoder._process.returncode == 0


def test_unused_process_ends(tmp_path: Path) -> None:
    """A run that never starts leaves no process."""
    with EncoderProcess() as encoder:
        pass
    assert encoder._process.returncode is not None


def test_no_log_starts_no_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``--no-log`` neither needs nor starts it."""
    monkeypatch.setattr(
        encoder_process.EncoderProcess,
        "__init__",
        lambda _: pytest.fail("started a process"),
    )
    words = ["run", "stand", "--duration", "0.1", "--no-log", "--out", str(tmp_path)]
    assert cli.main(words) == 0
    assert not (tmp_path / RECORDING_FILE).exists()


def test_halt_is_explained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk is called full only if it is."""
    target = tmp_path / "log.rrd"
    assert "overloaded" in encoder.explain_halt(target)
    assert "viewer" in encoder.explain_halt("rerun+http://127.0.0.1:9876/proxy")
    usage = namedtuple("usage", "total used free")(100 << 30, 100 << 30, 1 << 20)
    monkeypatch.setattr(encoder.shutil, "disk_usage", lambda path: usage)
    assert encoder.explain_halt(target).endswith("the disk is full")
