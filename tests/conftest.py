"""What holds for the whole test suite."""

from __future__ import annotations

import os

import pytest


def pytest_configure(config: pytest.Config) -> None:
    """Set what must be set before NumPy and Matplotlib are imported.

    The gains that the control laws keep on disk go to pytest's own cache: nothing
    is written to the user's, and the second run of the suite is still quick.
    """
    os.environ["OMP_NUM_THREADS"] = "1"
    os.environ["MPLBACKEND"] = "Agg"
    cache: pytest.Cache | None = getattr(config, "cache", None)
    if cache is not None:
        os.environ["XDG_CACHE_HOME"] = str(cache.mkdir("home"))
