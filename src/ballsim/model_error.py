"""What the simulated robot has and its controller's model has not."""

from __future__ import annotations

from typing import Any

import numpy as np

from ballsim.errors import ConfigError

__all__ = ["apply_model_error"]


def apply_model_error(
    spec: Any, trunk: str, mass_scale: float, com_offset: tuple[float, float, float]
) -> None:
    """Change masses and CoM of the robot in a scene.

    The controller's model is compiled from the robot's own file and stays nominal.

    Args:
        spec: The scene, not yet compiled; left alone if nothing is asked for.
        trunk: Name of the robot's floating base.
        mass_scale: Factor on all masses and moments of inertia.
        com_offset: How far the CoM of the whole robot is moved, in the frame of
            the trunk, shape (3,), [m]. The trunk's CoM is moved by so much more as
            the robot is heavier than its trunk; moments of inertia about the CoM of
            each body stay as they are.

    Raises:
        ConfigError: A body of the robot has no masses of its own in the MJCF.
    """
    if mass_scale == 1.0 and not any(com_offset):
        return
    base = spec.body(trunk)
    bodies = [base, *base.find_all("body")]
    for body in bodies:
        if not body.explicitinertial:
            valid = f"1, because body '{body.name}' has no <inertial> in the MJCF"
            raise ConfigError("robot.mass_scale", mass_scale, valid)
        body.mass = mass_scale * body.mass
        body.inertia = mass_scale * np.array(body.inertia)
        body.fullinertia = mass_scale * np.array(body.fullinertia)
    total = sum(body.mass for body in bodies)
    base.ipos = np.array(base.ipos) + total / base.mass * np.array(com_offset)
