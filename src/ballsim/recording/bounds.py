"""How large the errors of the state estimate should be: three sigma, over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim.config import Config
from ballsim.recording.signals import FORWARD_LEFT_UP
from ballsim_controllers.messages import Array

__all__ = ["BOUNDS", "ErrorBounds", "compute_bounds", "has_bounds"]

_WIDTH = 3.0  # standard deviations
_ANGLES = ("ball_forward", "ball_left", "roll", "pitch", "yaw")
_ESTIMATING = ("wheeled-lip", "paper")  # controllers whose estimator is known


@dataclass(frozen=True, slots=True)
class ErrorBounds:
    """Bounds of the errors of a series below ``/estimate/error``.

    Attributes:
        path: Entity path.
        unit: Unit.
        description: What is bounded.
        columns: ``<component>_low`` of all components, then ``<component>_high``.
    """

    path: str
    unit: str
    description: str
    columns: tuple[str, ...]


def _name_ends(components: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{name}_{end}" for end in ("low", "high") for name in components)


BOUNDS = (
    ErrorBounds(
        "/limits/estimate/angles",
        "rad",
        "three sigma of the errors of ball angle and attitude, as the sensors' figures "
        "predict them for a robot that stands",
        _name_ends(_ANGLES),
    ),
    ErrorBounds(
        "/limits/estimate/com",
        "m",
        "likewise of the CoM from the ball's centre",
        _name_ends(FORWARD_LEFT_UP),
    ),
)


def has_bounds(config: Config) -> bool:
    """Return True if the controller of a run has the estimator that is known."""
    return config.controller.name in _ESTIMATING


def compute_bounds(config: Config) -> tuple[Array, dict[str, Array]]:
    """Return the times of the bounds, shape (n,), [s], and their values by path.

    Args:
        config: The run.
    """
    from ballsim.error_model.sigmas import predict_errors  # noqa: PLC0415 - slow

    prediction = predict_errors(config)
    time = prediction.time[prediction.time < config.duration]
    tilt = prediction.sigma("trunk_tilt_rad", time)[:, :2]
    ball = prediction.sigma("ball_position_m", time)[:, :2] / config.ball.radius
    yaw = prediction.sigma("trunk_yaw_rad", time)
    sigmas = (
        np.hstack([ball, tilt, yaw]),
        prediction.sigma("com_to_ball_m", time),
    )
    values = {
        bounds.path: _WIDTH * np.hstack([-sigma, sigma])
        for bounds, sigma in zip(BOUNDS, sigmas, strict=True)
    }
    return time, values
