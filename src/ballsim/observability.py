"""Which biases the sensors can tell of a robot that stands at rest on the ball.

``python -m ballsim.observability`` prints for each channel the standard deviation of
its bias at switch-on and the part of it that is left once everything is known that
readings at rest can tell anybody who knows the physics: 0 for what is observable, 1 for
what is not. See `ballsim.error_model.observability`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from ballsim.config_io import load_config
from ballsim.error_model.observability import find_unobservable, remaining_std
from ballsim.error_model.sensor_errors import find_sensor_errors
from ballsim.error_model.standing import make_estimator, make_standing_reading
from ballsim.error_model.standing_physics import linearise_physics
from ballsim.errors import ConfigError
from ballsim.module_parser import ModuleParser, list_overrides
from ballsim_controllers.messages import Array

__all__ = ["KnownBias", "analyse", "main"]


class KnownBias(NamedTuple):
    """What is known of a channel's bias.

    Attributes:
        channel: Name of the channel.
        bias_std: Standard deviation at switch-on, in the channel's unit.
        left_std: What is left of it at rest.
    """

    channel: str
    bias_std: float
    left_std: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; see the module.

    Args:
        arguments: Words of the command line, those of the process if None.
    """
    parser = ModuleParser("observability", __doc__)
    parser.add_world("with biases everywhere")
    options = parser.parse_args(arguments)
    try:
        rows = analyse(list_overrides(options))
    except ConfigError as error:
        parser.complain(error)
        return 2
    if options.json:
        print(json.dumps([row._asdict() for row in rows], indent=2))
        return 0
    table = Table(box=None, pad_edge=False)
    table.add_column("channel")
    for head in ("bias", "left", "part"):
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(
            row.channel,
            f"{row.bias_std:.1e}",
            f"{row.left_std:.1e}",
            f"{row.left_std / row.bias_std:.2f}",
        )
    Console(highlight=False, width=100).print(table)
    return 0


def analyse(overrides: Sequence[str]) -> list[KnownBias]:
    """Return what is known of the bias of each channel.

    Args:
        overrides: Texts ``key=value`` for the scenario ``stand``.

    Raises:
        ConfigError: The input is not valid, or a channel has no bias at all.
    """
    config = load_config("stand", overrides).config
    estimator, robot = make_estimator(config)
    reading = make_standing_reading(estimator, robot)
    period = config.simulation.control_period
    prior: Array = find_sensor_errors(config.sensors, reading, period).bias_std
    if not np.all(prior > 0.0):
        valid = "a preset with biases in all sensors"
        raise ConfigError("sensors.preset", config.sensors.preset, valid)
    physics = linearise_physics(config)
    left = remaining_std(find_unobservable(physics), prior)
    return [
        KnownBias(name, float(before), float(after))
        for name, before, after in zip(physics.names, prior, left, strict=True)
    ]


if __name__ == "__main__":
    sys.exit(main())
