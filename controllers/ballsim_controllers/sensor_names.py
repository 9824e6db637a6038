"""What can fail on its own: names of sensors, and sets of them as bits."""

from __future__ import annotations

__all__ = ["SENSOR_NAMES", "name_sensors"]

SENSOR_NAMES = (
    "encoder",
    "gyro",
    "accelerometer",
    "left_ankle",
    "right_ankle",
    "ball_gyro",
)


def name_sensors(bits: int) -> tuple[str, ...]:
    """Return the names of a set of sensors: bit i stands for name i."""
    return tuple(name for i, name in enumerate(SENSOR_NAMES) if bits >> i & 1)
