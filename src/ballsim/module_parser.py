"""Command lines of ``python -m ballsim.NAME``: what several of them share."""

from __future__ import annotations

import argparse
import sys
from typing import NoReturn

__all__ = ["ModuleParser", "OneLineParser", "list_overrides"]

_BAD_INPUT = 2


class OneLineParser(argparse.ArgumentParser):
    """A parser whose complaints take one line."""

    def error(self, message: str) -> NoReturn:
        """Complain and exit."""
        self.exit(_BAD_INPUT, f"{self.prog}: {message}\n")


class ModuleParser(OneLineParser):
    """The command line of a module; any value of the configuration can be set.

    Args:
        name: Name of the module in this package.
        text: Its docstring; the first line tells what it does.
    """

    def __init__(self, name: str, text: str) -> None:
        """Add ``--set``."""
        super().__init__(
            prog=f"python -m ballsim.{name}", description=text.splitlines()[0]
        )
        self.add_argument(
            "--set",
            action="append",
            default=[],
            metavar="KEY=VALUE",
            dest="overrides",
            help="change one value, dotted key; repeatable",
        )

    def add_seeds(self) -> None:
        """Add ``--seeds``."""
        text = "seeds 0 to N - 1"
        self.add_argument("--seeds", type=int, default=10, metavar="N", help=text)

    def add_world(self, sensors: str) -> None:
        """Add ``--sensors``, ``--ball-radius``, and ``--json`` for the answer.

        Args:
            sensors: What presets it works with.
        """
        add = self.add_argument
        add("--sensors", default="mid", metavar="PRESET", help=sensors)
        add("--ball-radius", default=0.5, type=float, metavar="R", help="[m]")
        add("--json", action="store_true", help="JSON on stdout, nothing else")

    def complain(self, error: Exception) -> None:
        """Say on stderr what went wrong, on one line."""
        print(f"{self.prog.split()[-1]}: {error}", file=sys.stderr)


def list_overrides(options: argparse.Namespace) -> list[str]:
    """Return the options of `ModuleParser.add_world` as texts ``key=value``."""
    return [
        f"sensors.preset={options.sensors}",
        f"ball.radius_m={options.ball_radius}",
        *options.overrides,
    ]
