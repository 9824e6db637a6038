"""Batched stepping does the same physics, where it says so."""

from __future__ import annotations

from ballsim.bench.batch import SIM_COUNTS, measure_batch
from ballsim.config_io import load_config


def test_batch_repeats_the_run_bit_for_bit() -> None:
    """Loop and Batch end in the run's state for any number of sims and threads."""
    config = load_config("stand", ["duration_s=0.04"]).config
    rows = measure_batch(config, threads=(1, 2), repeats=1)
    assert len(rows) == len(SIM_COUNTS) * (1 + 2 + 2)
    for row in rows:
        assert row["is_identical"] or row["way"] == "rollout"
        assert row["us_per_sim_tick"] > 0.0
