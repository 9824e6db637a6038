"""Peak memory of a run against its length, each run in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["MemoryUse", "measure_memory"]

_MEBIBYTE = 2.0**20


@dataclass(frozen=True, slots=True)
class MemoryUse:
    """What one run needed.

    Attributes:
        duration: Time that was asked for, [s].
        simulated_time: Time that was simulated: less if the robot fell, [s].
        is_logged: True if the rerun recording was written.
        peak_memory: Most memory that the process held at once, [MiB].
        recording_size: Size of the recording, [MiB]; 0 without one.
        wall_time: Time that the loop took, [s].
    """

    duration: float
    simulated_time: float
    is_logged: bool
    peak_memory: float
    recording_size: float
    wall_time: float


def measure_memory(
    durations: Sequence[float], is_logged: bool, scenario: str = "stand"
) -> list[MemoryUse]:
    """Measure the peak memory of runs with all their files.

    Args:
        durations: Simulated times, [s].
        is_logged: True to write the rerun recording too.
        scenario: Name of the scenario.

    Returns:
        One for each duration.
    """
    return [_measure(duration, is_logged, scenario) for duration in durations]


def _measure(duration: float, is_logged: bool, scenario: str) -> MemoryUse:
    with tempfile.TemporaryDirectory(prefix="ballsim-memory-") as folder:
        task = {"scenario": scenario, "duration": duration, "is_logged": is_logged}
        arguments = [sys.executable, "-m", __name__, json.dumps(task), folder]
        output = subprocess.run(
            arguments, check=True, stdout=subprocess.PIPE, text=True
        ).stdout
    return MemoryUse(**json.loads(output))


def _run_task(task: dict[str, object], folder: Path) -> dict[str, object]:
    """Run here, and return the fields of a `MemoryUse`."""
    from ballsim.config_io import load_config  # noqa: PLC0415 - in the child only
    from ballsim.preparation import prepare  # noqa: PLC0415
    from ballsim.run_files import RECORDING_FILE, run_with_files  # noqa: PLC0415

    overrides = [f"duration_s={task['duration']}"]
    config = load_config(str(task["scenario"]), overrides).config
    is_logged = bool(task["is_logged"])
    outcome = run_with_files(prepare(config), folder, is_logged).outcome
    recording = folder / RECORDING_FILE
    size = recording.stat().st_size if recording.exists() else 0
    return {
        "duration": config.duration,
        "simulated_time": outcome.simulated_time,
        "is_logged": is_logged,
        "peak_memory": _read_peak_memory(),
        "recording_size": size / _MEBIBYTE,
        "wall_time": outcome.wall_time,
    }


def _read_peak_memory() -> float:
    """Return the most memory that this process held at once, [MiB].

    Linux counts in ``ru_maxrss`` what the parent held at the fork, so its own
    high-water mark is read where there is one.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) / 1024.0
    import resource  # noqa: PLC0415 - not on every system

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (_MEBIBYTE if sys.platform == "darwin" else 1024.0)


if __name__ == "__main__":
    print(json.dumps(_run_task(json.loads(sys.argv[1]), Path(sys.argv[2]))))
