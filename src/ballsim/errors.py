"""Exceptions of the simulator, one base class for all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

__all__ = [
    "BallsimError",
    "ConfigError",
    "MissingDependencyError",
    "PhysicsError",
    "ReplayMismatchError",
]


class BallsimError(Exception):
    """Base of every exception that ``ballsim`` raises on purpose."""

    _arguments: tuple[Any, ...] = ()

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what is pickled: an error must come back from another process."""
        return type(self), self._arguments


class ConfigError(BallsimError, ValueError):
    """An input of the user has a value that cannot be worked with.

    Args:
        key: Dotted name of the setting, or the option of the command line.
        value: The offending value.
        valid: Words that say what would be valid, on one line.
        file: File that the value stands in, if any.
    """

    def __init__(
        self, key: str, value: object, valid: str, file: object | None = None
    ) -> None:
        """Build the one-line message from the key, the value and what is valid."""
        where = "" if file is None else f"{file}: "
        message = f"{where}{key} = {value!r} is not valid: {valid}"
        super().__init__(" ".join(message.split()))
        self.key = key
        self.value = value
        self.valid = valid
        self.file = file
        self._arguments = (key, value, valid, file)


class MissingDependencyError(BallsimError):
    """An optional package or program that the request needs is not installed.

    Args:
        feature: What was asked for.
        package: What has to be installed, and how.
    """

    def __init__(self, feature: str, package: str) -> None:
        """Build the message from the feature and the missing package."""
        super().__init__(f"{feature} needs {package}")
        self.feature = feature
        self.package = package
        self._arguments = (feature, package)


class PhysicsError(BallsimError):
    """MuJoCo raised a warning or the state is no longer a number.

    Args:
        reason: What MuJoCo said.
        time: Simulated time, [s].
        last_states: Arrays of the last states before the failure, by name
            (``time``, ``qpos``, ``qvel``, ``ctrl``; one row per physics step).
    """

    def __init__(
        self, reason: str, time: float, last_states: Mapping[str, Any] | None = None
    ) -> None:
        """Build the message from the reason and the time."""
        super().__init__(f"physics failed at t = {time:.3f} s: {reason}")
        self.reason = reason
        self.time = time
        self.last_states: Mapping[str, Any] = {} if last_states is None else last_states
        self._arguments = (reason, time, last_states)


class ReplayMismatchError(BallsimError):
    """A repeated run does not give the trajectory of the first one.

    Args:
        differences: What differs, one phrase each.
    """

    def __init__(self, differences: Iterable[str]) -> None:
        """Build the message from the differences."""
        self.differences = tuple(differences)
        super().__init__("the replay differs: " + "; ".join(self.differences))
        self._arguments = (self.differences,)
