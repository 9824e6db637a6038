"""Sensors that fail for a while, as the scenario says: ``[[fault]]``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ballsim.errors import ConfigError
from ballsim.settings import Choice, Number, Text, check_table, setting
from ballsim_controllers.messages import Array, IntArray, reading_dtype
from ballsim_controllers.sensor_names import SENSOR_NAMES

__all__ = ["FAULT_KINDS", "FaultConfig", "FaultInjector"]

FAULT_KINDS = ("freeze", "spike", "dropout", "not-a-number")
_TIME = Number(0.0, 1e6, unit="s")
_TOLERANCE = 1e-9  # of a control period


@dataclass(frozen=True, slots=True)
class FaultConfig:
    """A sensor that fails for a while.

    Attributes:
        sensor: What fails: a sensor, an ankle's whole wrench, or all encoders.
        kind: ``freeze``: it repeats its last reading; ``spike``: it reads too much by
            `size`; ``dropout``: it reads zero, as without its cable;
            ``not-a-number``: it reads what is no number.
        time: When that begins, [s].
        duration: How long it lasts, [s]; one reading if 0.
        period: Time after which it comes again, [s]; 0 for never.
        joint: The one joint whose encoder fails, or ``all``.
        size: What a spike adds to each value, in the unit of the sensor: [rad],
            [rad/s], [m/s^2]; of an ankle [N], and as many hundredths of it in [N m].
    """

    sensor: str = setting(Choice(SENSOR_NAMES), "left_ankle", "sensor")
    kind: str = setting(Choice(FAULT_KINDS), "dropout", "kind")
    time: float = setting(_TIME, 3.0, "time_s")
    duration: float = setting(_TIME, 0.05, "duration_s")
    period: float = setting(_TIME, 0.0, "period_s")
    joint: str = setting(Text(), "all", "joint")
    size: float = setting(Number(-1e5, 1e5), 0.0, "size")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)
        if self.period > 0.0 and self.duration >= self.period:
            valid = f"below period_s = {self.period:g}"
            raise ConfigError("duration_s", self.duration, valid)
        if self.kind == "spike" and self.size == 0.0:
            raise ConfigError("size", self.size, "not 0 for a spike")
        if self.sensor != "encoder" and self.joint != "all":
            valid = "'all', or left out, where the sensor is not 'encoder'"
            raise ConfigError("joint", self.joint, valid)


class FaultInjector:
    """Spoils readings, at the sensor: before any delay of the whole reading.

    Args:
        faults: What fails, and when.
        joints: Names of the joints in the order of the readings.
        period: Control period, [s].

    Raises:
        ConfigError: There is no joint of a name.
    """

    def __init__(
        self, faults: Sequence[FaultConfig], joints: Sequence[str], period: float
    ) -> None:
        """Find the places of each fault in a reading."""
        self._period = period
        self._last = np.zeros(0)
        self._faults: list[tuple[FaultConfig, IntArray, Array]] = []
        for i, fault in enumerate(faults):
            if fault.joint not in ("all", *joints):
                valid = f"'all' or one of {', '.join(joints)}"
                raise ConfigError(f"fault.{i}.joint", fault.joint, valid)
            places, sizes = _find_places(fault, joints)
            self._faults.append((fault, places, sizes))

    def apply(self, tick: int, row: Array) -> None:
        """Spoil a reading (in place).

        Args:
            tick: Its number, from 0 on.
            row: The reading as numbers.
        """
        good = row.copy() if len(self._last) == 0 else self._last
        for fault, places, sizes in self._faults:
            if not self._is_on(fault, tick):
                continue
            if fault.kind == "freeze":
                row[places] = good[places]
            elif fault.kind == "spike":
                row[places] += sizes
            else:
                row[places] = math.nan if fault.kind == "not-a-number" else 0.0
        self._last = row.copy()

    def _is_on(self, fault: FaultConfig, tick: int) -> bool:
        since = tick - fault.time / self._period + _TOLERANCE
        if since < 0.0:
            return False
        if fault.period > 0.0:
            since = math.fmod(since, fault.period / self._period)
        return since < max(1.0, fault.duration / self._period - _TOLERANCE)


def _find_places(fault: FaultConfig, joints: Sequence[str]) -> tuple[IntArray, Array]:
    """Return where a fault acts in a reading as numbers, and what a spike adds."""
    dtype, n = reading_dtype(len(joints)), len(joints)
    fields = dtype.fields
    assert fields is not None
    start = {name: entry[1] // 8 for name, entry in fields.items()}
    chosen = range(n) if fault.joint == "all" else [list(joints).index(fault.joint)]
    foot = 3 if fault.sensor == "right_ankle" else 0
    parts: dict[str, list[tuple[str, list[int], float]]] = {
        "encoder": [
            ("joint_positions", list(chosen), 1.0),
            ("joint_velocities", list(chosen), 0.0),
        ],
        "gyro": [("angular_velocity_imu", [0, 1, 2], 1.0)],
        "accelerometer": [("acceleration_imu", [0, 1, 2], 1.0)],
        "ball_gyro": [("angular_velocity_ball", [0, 1, 2], 1.0)],
    }
    ankle = [foot, foot + 1, foot + 2]
    wrench = [("foot_forces", ankle, 1.0), ("foot_torques", ankle, 0.01)]
    places, sizes = [], []
    for name, offsets, share in parts.get(fault.sensor, wrench):
        places += [start[name] + offset for offset in offsets]
        sizes += [share * fault.size] * len(offsets)
    return np.array(places), np.array(sizes)
