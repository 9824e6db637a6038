"""Real kills and a real cluster: whatever happens, the same rows."""

from __future__ import annotations

import os
import random
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ballsim.studies.ledger import LEDGER_FILE

pytestmark = pytest.mark.slow

WriteStudy = Callable[..., Path]
STUDY = """
scenario = "roll-to"
duration_s = 1.0
seeds = 6
keep_recordings = "none"

[[factors]]
key = "scene.sole_friction"
values = [0.01, 0.1, 1.0]
harder = "low"

[[factors]]
key = "ball.radius_m"
values = [0.25, 0.5]
"""
N_RUNS = 36


def _command(file: Path, out: Path, *words: str) -> list[str]:
    code = "from ballsim.cli import main; raise SystemExit(main())"
    return [sys.executable, "-c", code, "study", str(file), "--out", str(out), *words]


def _run(file: Path, out: Path, *words: str) -> bytes:
    subprocess.run(_command(file, out, *words), check=True, stdout=subprocess.DEVNULL)
    return (out / "results.parquet").read_bytes()


def _count(out: Path) -> int:
    connection = sqlite3.connect(out / LEDGER_FILE)
    count: int = connection.execute("SELECT count(*) FROM runs").fetchone()[0]
    connection.close()
    return count


def _wait_for_growth(out: Path, n_bytes: int) -> None:
    """Wait until a number of bytes was written since the ledger was opened."""
    log = out / f"{LEDGER_FILE}-wal"
    while not log.exists():
        time.sleep(0.02)
    start = log.stat().st_size
    while log.stat().st_size < start + n_bytes:
        time.sleep(0.02)


def _is_running(session: int) -> bool:
    """Return True if a process of a session is there and no zombie."""
    words = ["ps", "-s", str(session), "-o", "stat="]
    listed = subprocess.run(words, capture_output=True, text=True, check=False).stdout
    return any(not state.startswith("Z") for state in listed.split())


def test_three_kills_change_nothing(write_study: WriteStudy, tmp_path: Path) -> None:
    """Each kill loses the runs in flight at most and leaves no worker behind."""
    file = write_study(STUDY)
    expected = _run(file, tmp_path / "whole", "--workers", "2")
    out, generator, counts = tmp_path / "killed", random.Random(4), [0]
    for _ in range(3):
        process = subprocess.Popen(
            _command(file, out, "--workers", "2"),
            start_new_session=True,
            stderr=subprocess.DEVNULL,
        )
        _wait_for_growth(out, generator.randrange(1, 100_000))
        process.send_signal(signal.SIGKILL)
        process.wait()
        for _ in range(100):
            if not _is_running(process.pid):
                break
            time.sleep(0.1)
        assert not _is_running(process.pid)
        counts.append(_count(out))
    assert counts == sorted(counts)
    assert 0 < counts[-1] < N_RUNS
    assert _run(file, out, "--workers", "1") == expected


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """Start a Dask scheduler and two workers, as a user would."""
    pytest.importorskip("distributed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    program = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address]
    commands = [
        [*program, "--host", address, "--no-dashboard"],
        *[[*worker, "--nthreads", "1", "--no-dashboard"]] * 2,
    ]
    log = (tmp_path / "cluster.log").open("w")
    processes = [
        subprocess.Popen(
            command,
            cwd=tmp_path,
            stdout=log,
            stderr=log,
            start_new_session=True,
            env={**os.environ, "DASK_TEMPORARY_DIRECTORY": str(tmp_path)},
        )
        for command in commands
    ]
    try:
        yield address
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
        log.close()


def test_cluster_gives_the_rows_of_one_worker(
    scheduler: str, write_study: WriteStudy, tmp_path: Path
) -> None:
    """A Dask cluster, one process and two: the same bytes."""
    file = write_study(STUDY)
    contents = [
        _run(file, tmp_path / "cluster", "--scheduler", scheduler),
        _run(file, tmp_path / "one", "--workers", "1"),
        _run(file, tmp_path / "two", "--workers", "2"),
    ]
    assert contents[0] == contents[1] == contents[2]


def test_cluster_survives_a_run_that_hangs(
    scheduler: str, write_study: WriteStudy, tmp_path: Path
) -> None:
    """An hour of simulation with a limit of seconds: recorded, the rest is done."""
    text = 'scenario = "stand"\nseeds = 1\nmetrics = []\nrun_limit_s = 8.0\n'
    text += '[[factors]]\nkey = "duration_s"\nvalues = [0.1, 3600.0]\n'
    out = tmp_path / "out"
    _run(write_study(text), out, "--scheduler", scheduler)
    connection = sqlite3.connect(out / LEDGER_FILE)
    rows = connection.execute("SELECT status, attempts FROM runs ORDER BY cell")
    assert rows.fetchall() == [("finished", 1), ("timeout", 2)]
    connection.close()
