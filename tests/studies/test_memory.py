"""A worker may do thousands of runs: it must not grow."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import pytest

# Live memory is what the C library has handed out and not got back; what it holds
# besides moves by tens of megabytes as free pieces are used up and joined again.
CODE = """
import ctypes
import dataclasses
import gc
import sys

from ballsim.config_io import load_config
from ballsim.studies.single_run import Task, run_chunk

NAMES = "arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost"


class Mallinfo(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in NAMES.split()]


mallinfo = ctypes.CDLL(None).mallinfo2
mallinfo.restype = Mallinfo
radii = (0.25, 0.5, 0.75, 1.0)
words = [["duration_s=0.1", f"ball.radius_m={radius}"] for radius in radii]
configs = [load_config("stand", given).config for given in words]
kept = []
for seed in range(500):
    config = dataclasses.replace(configs[seed % 4], seed=seed)
    outcomes = run_chunk([Task(0, config)], 60.0)
    if LEAK:
        kept.append(bytearray(LEAK))
    if seed in (149, 499):
        gc.collect()
        found = mallinfo()
        print(found.uordblks + found.hblkhd, sys.getallocatedblocks())
"""
N_RUNS = 350  # between the two looks


def _measure(leak: int) -> tuple[float, float]:
    """Return by how many bytes and by how many Python objects each run grows."""
    words = [sys.executable, "-c", f"LEAK = {leak}\n{CODE}"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    before, after = (map(int, line.split()) for line in done.stdout.splitlines())
    size, objects = (b - a for a, b in zip(before, after, strict=True))
    return size / N_RUNS, objects / N_RUNS


@pytest.mark.slow
@pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="needs glibc 2.33 or newer"
)
def test_worker_does_not_grow_over_500_runs() -> None:
    """From the 150th to the 500th run the live memory stays the same.

    A kilobyte a run would be noticed: that much on purpose is.
    """
    size, objects = _measure(0)
    assert size < 512.0
    assert objects < 2.0
    assert _measure(1024)[0] > 512.0
