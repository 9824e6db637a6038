"""Colours of the log: one for each role, the same in 3-D view and plots."""

from __future__ import annotations

__all__ = [
    "ACTUAL",
    "COMMANDED",
    "CONTACT",
    "ERROR_COLOURS",
    "ESTIMATE",
    "IDEAL",
    "LEFT",
    "MEASURED",
    "PUSH",
    "REFERENCE",
    "RIGHT",
    "SUPPORT",
    "TARGET",
    "TRUTH",
    "Colour",
    "joint_colours",
    "name_joint_colours",
    "pale",
]

Colour = tuple[int, int, int]

TRUTH: Colour = (235, 235, 235)
ACTUAL: Colour = TRUTH
ESTIMATE: Colour = (255, 152, 0)
MEASURED: Colour = ESTIMATE
IDEAL: Colour = (76, 175, 255)
COMMANDED: Colour = (205, 120, 255)
REFERENCE: Colour = IDEAL
TARGET: Colour = (120, 220, 110)
CONTACT: Colour = (255, 214, 10)
SUPPORT: Colour = (250, 250, 210)
PUSH: Colour = (255, 64, 200)
LEFT: Colour = (255, 92, 92)
RIGHT: Colour = (90, 210, 200)
#: Of the components of an error.
ERROR_COLOURS: tuple[Colour, ...] = (LEFT, RIGHT, ESTIMATE, TRUTH, (120, 220, 110))

_JOINTS: dict[str, Colour] = {
    "red": (255, 92, 92),
    "orange": (255, 178, 62),
    "yellow": (240, 235, 90),
    "green": (110, 215, 110),
    "blue": (90, 180, 255),
    "violet": (200, 130, 255),
}


def pale(colour: Colour) -> Colour:
    """Return the tint of a colour that stands for the truth behind an estimate."""
    red, green, blue = ((channel + 2 * 255) // 3 for channel in colour)
    return red, green, blue


def joint_colours(n: int) -> list[Colour]:
    """Return colours for n joints."""
    colours = list(_JOINTS.values())
    return [colours[i % len(colours)] for i in range(n)]


def name_joint_colours(n: int) -> list[str]:
    """Return what the colours for n joints are called."""
    names = list(_JOINTS)
    return [names[i % len(names)] for i in range(n)]
