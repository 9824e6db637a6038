"""Settings of the controllers: a shipped preset, overridden by the user's table."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Any, TypeVar, get_type_hints

from ballsim_controllers.errors import InvalidSettingError

__all__ = [
    "BalanceSettings",
    "EstimationSettings",
    "ForceSettings",
    "GaitSettings",
    "PlannerSettings",
    "RateSettings",
    "ReferenceSettings",
    "WheeledLipSettings",
    "load_settings",
]


@dataclass(frozen=True, slots=True)
class RateSettings:
    """How often the slower parts run, [s]."""

    preview_period_s: float
    ik_period_s: float


@dataclass(frozen=True, slots=True)
class EstimationSettings:
    """What is not known of the robot: the CoM's place along each axis (one sigma)."""

    com_offset_m: float


@dataclass(frozen=True, slots=True)
class ReferenceSettings:
    """Limits of the shaped reference of the ball, as an angle and on the floor.

    The largest cruise is that of a commanded speed, the largest speeds are those on
    the way to a target, the lateral one across the heading. The largest turn is that of
    the heading, speed and acceleration. The integral rate is that
    of the shift against a lasting error, while stepping or where sensors err.
    """

    max_speed_rad_s: float
    max_acceleration_rad_s2: float
    max_speed_m_s: float
    max_acceleration_m_s2: float
    smoothing_time_s: float
    max_cruise_rad_s: float
    max_cruise_m_s: float
    max_lateral_rad_s: float
    max_lateral_m_s: float
    integral_rate_1_s: float
    max_turn_rad_s: float
    max_turn_rad_s2: float


@dataclass(frozen=True, slots=True)
class BalanceSettings:
    """Balance controller: the CoP's way, poles (empty = mirrored), the trunk's pair."""

    cop_lag_s: float
    cop_lead_s: float
    cop_feedback: float
    cop_learning_rate: float
    cop_learning_lead_s: float
    sagittal_poles_rad_s: tuple[float, ...]
    lateral_poles_rad_s: tuple[float, ...]
    poles_radius_m: float
    lateral_trunk_frequency_rad_s: float
    lateral_trunk_damping_ratio: float
    observer_pole_rad_s: float


@dataclass(frozen=True, slots=True)
class GaitSettings:
    """Timing of the gait, swing path, swing condition."""

    single_support_s: float
    single_support_growth_s_m: float
    double_support_s: float
    first_double_support_s: float
    earliest_touchdown: float
    touchdown_force_n: float
    latest_touchdown_s: float
    touchdown_tolerance_s: float
    touchdown_depth_m: float
    lift_m: float
    freeze_time_s: float
    descent_speed_m_s: float
    landing_slew_m_s: float
    trigger_share: float
    trigger_time_s: float
    rest_share: float
    rest_speed_m_s: float
    reschedule_effort_m2: float
    reschedule_time_s: float
    reschedule_swing_s: float
    fast_speed_m_s: float
    fast_effort_m2: float
    start_offset_m: float
    start_speed_m_s: float
    start_patience_s: float
    stop_steps: int
    stop_offset_m: float
    stop_reach_share: float
    stand_reach_share: float
    stop_speed_m_s: float


@dataclass(frozen=True, slots=True)
class PlannerSettings:
    """Horizon, reach and weights of the footstep planner."""

    cells: int
    sagittal_reach_m: float
    reach_share: float
    reserve_share: float
    reserve_time_s: float
    lateral_inward_m: float
    lateral_outward_m: float
    separation_m: float
    separation_share: float
    encoder_deviations: float
    sagittal_weight: float
    lateral_weight: float


@dataclass(frozen=True, slots=True)
class ForceSettings:
    """Usable sole and gains of the whole-body layer (rates in 1/s^2 and 1/s)."""

    cop_half_length_m: float
    cop_half_width_m: float
    trunk_stiffness: float
    trunk_damping: float
    yaw_stiffness: float
    yaw_damping: float
    height_stiffness: float
    height_damping: float
    slip_gain: float
    splay_stiffness_n_m_per_rad: float
    parting_stiffness_n_per_m: float
    stance_rotation_damping: float
    swing_stiffness: float
    swing_damping: float
    swing_rotation_stiffness: float
    swing_rotation_damping: float
    posture_stiffness: float
    posture_damping: float
    max_com_acceleration_m_s2: float
    contact_force_n: float
    landing_speed_m_s: float
    minimal_share: float
    pitch_compliance: float
    roll_compliance: float


@dataclass(frozen=True, slots=True)
class WheeledLipSettings:
    """All settings of the controller ``wheeled-lip``."""

    rates: RateSettings
    estimation: EstimationSettings
    reference: ReferenceSettings
    balance: BalanceSettings
    gait: GaitSettings
    planner: PlannerSettings
    forces: ForceSettings


T = TypeVar("T")

#: Ranges of the settings that 0 or a large value makes senseless: the value lies
#: above the first number and not above the second.
_RANGES: dict[str, tuple[float, float]] = {
    "preview_period_s": (0.0, 1.0),
    "ik_period_s": (0.0, 1.0),
    "max_speed_rad_s": (0.0, math.inf),
    "max_acceleration_rad_s2": (0.0, math.inf),
    "max_speed_m_s": (0.0, math.inf),
    "max_cruise_rad_s": (0.0, math.inf),
    "max_cruise_m_s": (0.0, math.inf),
    "max_lateral_rad_s": (0.0, math.inf),
    "max_lateral_m_s": (0.0, math.inf),
    "max_turn_rad_s": (0.0, math.inf),
    "max_turn_rad_s2": (0.0, math.inf),
    "max_acceleration_m_s2": (0.0, math.inf),
    "cop_lag_s": (0.0, 1.0),
    "cop_learning_rate": (-1.0, 1.0),
    "lateral_trunk_damping_ratio": (0.0, 1.0),
    "observer_pole_rad_s": (0.0, math.inf),
    "single_support_s": (0.0, 5.0),
    "double_support_s": (0.0, 5.0),
    "first_double_support_s": (0.0, 5.0),
    "earliest_touchdown": (-1.0, 1.0),
    "stop_reach_share": (0.0, 1.0),
    "stand_reach_share": (0.0, 1.0),
    "cop_half_length_m": (0.0, math.inf),
    "cop_half_width_m": (0.0, math.inf),
    "minimal_share": (-1.0, 0.5),
    "reserve_share": (-1.0, 0.9),
}
_POLE_LISTS = ("sagittal_poles_rad_s", "lateral_poles_rad_s")
_POLE_COUNT = 4


def load_settings(kind: type[T], preset: str, overrides: Mapping[str, Any]) -> T:
    """Return settings from a shipped preset and a user's table.

    Args:
        kind: Settings dataclass of dataclasses.
        preset: Name of the preset file without its ending.
        overrides: Tables of values that replace those of the preset.

    Returns:
        The settings.

    Raises:
        InvalidSettingError: A key is unknown, missing or of the wrong type.
    """
    folder = resources.files("ballsim_controllers") / "presets"
    text = (folder / f"{preset}.toml").read_text(encoding="utf-8")
    return _build(kind, tomllib.loads(text), overrides, "controller")


def _build(
    kind: type[T], base: Mapping[str, Any], overrides: Mapping[str, Any], path: str
) -> T:
    names = [f.name for f in dataclasses.fields(kind)]  # type: ignore[arg-type]
    for key, value in overrides.items():
        if key not in names:
            raise InvalidSettingError(
                f"{path}.{key}", value, "the keys are " + ", ".join(names)
            )
    hints = get_type_hints(kind)
    values: dict[str, Any] = {}
    for name in names:
        key = f"{path}.{name}"
        hint = hints[name]
        if dataclasses.is_dataclass(hint):
            nested = overrides.get(name, {})
            if not isinstance(nested, Mapping):
                raise InvalidSettingError(key, nested, "a table")
            values[name] = _build(hint, base[name], nested, key)  # type: ignore[arg-type]
        else:
            values[name] = _convert(hint, overrides.get(name, base[name]), key)
            _check_range(name, values[name], key)
    return kind(**values)


def _check_range(name: str, value: Any, key: str) -> None:
    """Refuse a value that the controller cannot work with."""
    if name in _RANGES:
        low, high = _RANGES[name]
        if not low < value <= high:
            limit = "" if math.isinf(high) else f", at most {high:g}"
            least = "above 0" if low == 0.0 else "at least 0"
            raise InvalidSettingError(key, value, f"a number {least}{limit}")
    is_poles = name in _POLE_LISTS and bool(value)
    if is_poles and (len(value) != _POLE_COUNT or max(value) >= 0.0):
        valid = f"{_POLE_COUNT} negative numbers, or none for the mirrored modes"
        raise InvalidSettingError(key, list(value), valid)


def _convert(hint: Any, value: Any, key: str) -> Any:
    if hint is bool:
        if not isinstance(value, bool):
            raise InvalidSettingError(key, value, "true or false")
        return value
    if hint is int:
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise InvalidSettingError(key, value, "a positive integer")
        return value
    if hint is float:
        return _number(value, key)
    if not isinstance(value, list | tuple):
        raise InvalidSettingError(key, value, "a list of numbers")
    return tuple(_number(item, key, signed=True) for item in value)


def _number(value: Any, key: str, signed: bool = False) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidSettingError(key, value, "a number")
    number = float(value)
    if not math.isfinite(number) or (number < 0.0 and not signed):
        raise InvalidSettingError(key, value, "a finite number of at least 0")
    return number
