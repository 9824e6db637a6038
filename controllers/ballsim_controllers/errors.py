"""Exceptions of the robot-side package, one base class for all."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["ControllerError", "InvalidSettingError", "UnknownControllerError"]


class ControllerError(Exception):
    """Base of every exception that ``ballsim_controllers`` raises on purpose."""


class InvalidSettingError(ControllerError, ValueError):
    """A setting has a value that the controller cannot work with.

    Args:
        key: Dotted name of the setting.
        value: The offending value.
        valid: Words that say what would be valid.
    """

    def __init__(self, key: str, value: object, valid: str) -> None:
        """Build the message from the key, the value and what is valid."""
        super().__init__(f"{key} = {value!r} is not valid: {valid}")
        self.key = key
        self.value = value
        self.valid = valid


class UnknownControllerError(ControllerError, KeyError):
    """No controller of that name is registered.

    Args:
        name: The name that was asked for.
        available: The names that are registered.
    """

    def __init__(self, name: str, available: Iterable[str]) -> None:
        """Build the message from the name and the registered names."""
        self.name = name
        self.available = sorted(available)
        super().__init__(
            f"unknown controller {name!r}; available: {', '.join(self.available)}"
        )

    def __str__(self) -> str:
        """Return the message without the quotes that ``KeyError`` adds."""
        return str(self.args[0])
