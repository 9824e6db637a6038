"""A worker may do thousands of runs: it must not grow."""

from __future__ import annotations

import subprocess
import sys

import pytest

CODE = """
import dataclasses
import os

from ballsim.config_io import load_config
from ballsim.studies.single_run import Task, run_chunk

config = load_config("stand", ["duration_s=0.1"]).config
page = os.sysconf("SC_PAGE_SIZE")
for seed in range(500):
    run_chunk([Task(0, dataclasses.replace(config, seed=seed))], 60.0)
    if seed in (150, 499):
        with open("/proc/self/statm") as file:
            print(int(file.read().split()[1]) * page / 1e6)
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_worker_does_not_grow_over_500_runs() -> None:
    """From the 150th to the 500th run the memory grows by less than 25 MB.

    The allocator moves by 15 MB; each run that was kept would add 16 MB.
    """
    words = [sys.executable, "-c", CODE]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    before, after = map(float, done.stdout.split())
    assert after - before < 25.0
