"""Humanoids that stand and walk on a free rolling ball, in full MuJoCo physics.

Three lines to a first result::

    import ballsim

    run = ballsim.run("walk", target_angle=1)
    print(run.summary["ball_angle_error"], run["truth/ball/angle"]["forward"])

What is offered here is imported when it is used first, so that ``import ballsim``
takes no time.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ballsim.api import StudyResult, load, run, study
    from ballsim.errors import BallsimError, ConfigError
    from ballsim.run_result import RunResult
    from ballsim.time_series import TimeSeries

__all__ = [
    "BallsimError",
    "ConfigError",
    "RunResult",
    "StudyResult",
    "TimeSeries",
    "__version__",
    "load",
    "run",
    "study",
]

__version__ = "0.1.0"

_HOMES = {
    "BallsimError": "ballsim.errors",
    "ConfigError": "ballsim.errors",
    "RunResult": "ballsim.run_result",
    "StudyResult": "ballsim.api",
    "TimeSeries": "ballsim.time_series",
    "load": "ballsim.api",
    "run": "ballsim.api",
    "study": "ballsim.api",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for the first time."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return what is there and what would be imported."""
    return sorted({*globals(), *_HOMES})
