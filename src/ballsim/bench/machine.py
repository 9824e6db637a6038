"""The machine that the figures come from."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

from ballsim.metrics import collect_versions

__all__ = ["count_cores", "describe_machine", "read_load"]


def count_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def describe_machine() -> dict[str, Any]:
    """Return processor, cores, system and versions."""
    return {
        "cpu": _cpu_name(),
        "cores": count_cores(),
        "system": f"{platform.system()} {platform.release()}",
        "versions": collect_versions(),
    }


def read_load() -> float | None:
    """Return how many processes wanted to run over the last minute."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def _cpu_name() -> str:
    """Return the processor's name; only Linux tells it in a file."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    for line in lines:
        key, _, value = line.partition(":")
        if key.strip() == "model name":
            return value.strip()
    return platform.processor() or platform.machine()
