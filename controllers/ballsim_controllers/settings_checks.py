"""Whether settings fit together, the robot and the control period."""

from __future__ import annotations

from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.robot import RobotDescription
from ballsim_controllers.settings import WheeledLipSettings

__all__ = ["check_settings", "count_ticks"]


def check_settings(settings: WheeledLipSettings, robot: RobotDescription) -> None:
    """Refuse settings that do not fit together or do not fit the robot.

    Args:
        settings: The settings.
        robot: The robot.

    Raises:
        InvalidSettingError: Something does not fit.
    """
    forces, gait = settings.forces, settings.gait
    cell = settings.rates.preview_period_s
    for key, value, limit in (
        ("cop_half_length_m", forces.cop_half_length_m, robot.sole_half_length),
        ("cop_half_width_m", forces.cop_half_width_m, robot.sole_half_width),
    ):
        if value > limit:
            valid = f"at most {limit:g}, the sole's"
            raise InvalidSettingError(f"controller.forces.{key}", value, valid)
    if gait.stop_reach_share > gait.stand_reach_share:
        valid = f"at most {gait.stand_reach_share:g}, the stand_reach_share"
        key = "controller.gait.stop_reach_share"
        raise InvalidSettingError(key, gait.stop_reach_share, valid)
    for key, value in (
        ("single_support_s", gait.single_support_s),
        ("double_support_s", gait.double_support_s),
        ("reschedule_time_s", gait.reschedule_time_s),
    ):
        if value < cell:
            valid = f"at least {cell:g}, a cell of the preview"
            raise InvalidSettingError(f"controller.gait.{key}", value, valid)
    if gait.reschedule_swing_s > 0.5 * gait.single_support_s:
        valid = f"at most {0.5 * gait.single_support_s:g}, half of single_support_s"
        key = "controller.gait.reschedule_swing_s"
        raise InvalidSettingError(key, gait.reschedule_swing_s, valid)


def count_ticks(key: str, settings: WheeledLipSettings, dt: float) -> int:
    """Return the control periods of a cell, which must be a whole number.

    Args:
        key: Key of the cell's length in the configuration.
        settings: The settings.
        dt: Control period, [s].

    Raises:
        InvalidSettingError: The length is not a multiple of the period.
    """
    period = settings.rates.preview_period_s
    ticks = round(period / dt)
    if ticks < 1 or abs(ticks * dt - period) > 1e-9:
        raise InvalidSettingError(key, period, f"a multiple of the period {dt:g} s")
    return ticks
