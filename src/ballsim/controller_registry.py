"""Controllers by name: the entry points of the group ``ballsim.controllers``."""

from __future__ import annotations

import functools
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from typing import cast

from ballsim_controllers.errors import UnknownControllerError
from ballsim_controllers.messages import Controller, ControllerSetup

__all__ = [
    "ControllerFactory",
    "find_controller_factory",
    "list_controllers",
]

GROUP = "ballsim.controllers"
ControllerFactory = Callable[[ControllerSetup], Controller]


def list_controllers() -> dict[str, str]:
    """Return the registered controllers: where each is made, by name."""
    return {name: entry.value for name, entry in sorted(_entries().items())}


def find_controller_factory(name: str) -> ControllerFactory:
    """Return what builds a controller.

    Args:
        name: Registered name.

    Raises:
        UnknownControllerError: No controller of that name is registered.
    """
    entries = _entries()
    if name not in entries:
        raise UnknownControllerError(name, entries)
    return cast(ControllerFactory, entries[name].load())


@functools.cache
def _entries() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}
