"""Description of a robot: names, sole geometry, nominal pose, servo gains."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ballsim_controllers.errors import InvalidSettingError

__all__ = ["LegDescription", "RobotDescription", "load_robot_description"]


@dataclass(frozen=True, slots=True)
class LegDescription:
    """Names that belong to one leg in the robot's MJCF.

    Attributes:
        foot_body: Body that carries the sole.
        sole_site: Site at the sole's centre, z out of the robot's foot upwards,
            x to the toes.
        wrench_site: Site of the ankle's force-torque sensor.
        joints: The six leg joints from hip to ankle.
    """

    foot_body: str
    sole_site: str
    wrench_site: str
    joints: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RobotDescription:
    """All that a controller needs to know about a robot beside its MJCF.

    Masses, inertias, joint ranges, servo gains and torque limits are read from
    the MJCF, so that each number stands in one place.

    Attributes:
        name: Name of the robot.
        mjcf_path: MJCF file of the robot alone, with its actuators.
        trunk_body: Floating base.
        imu_site: Site of gyro and accelerometer.
        left_leg: Names of the left leg.
        right_leg: Names of the right leg.
        sole_half_length: Half length of the sole box l, [m].
        sole_half_width: Half width of the sole box, [m].
        stance_half_width: Lateral distance of each sole's centre from the
            mid-plane in the nominal stance, [m].
        nominal_posture: Nominal angle of each actuated joint by name, [rad].
        velocity_limits: Speed limit of each actuated joint by name, [rad/s].
    """

    name: str
    mjcf_path: Path
    trunk_body: str
    imu_site: str
    left_leg: LegDescription
    right_leg: LegDescription
    sole_half_length: float
    sole_half_width: float
    stance_half_width: float
    nominal_posture: Mapping[str, float]
    velocity_limits: Mapping[str, float]

    @property
    def legs(self) -> tuple[LegDescription, LegDescription]:
        """Return the legs, left first."""
        return (self.left_leg, self.right_leg)


def _leg(table: Mapping[str, Any]) -> LegDescription:
    return LegDescription(
        foot_body=table["foot_body"],
        sole_site=table["sole_site"],
        wrench_site=table["wrench_site"],
        joints=tuple(table["joints"]),
    )


def load_robot_description(path: Path) -> RobotDescription:
    """Read a robot description from its TOML file.

    Args:
        path: The TOML file; its ``mjcf`` is relative to the file's folder.

    Returns:
        The description.

    Raises:
        InvalidSettingError: A key is missing or has a value of the wrong type.
    """
    with path.open("rb") as file:
        table = tomllib.load(file)
    try:
        return RobotDescription(
            name=table["name"],
            mjcf_path=path.parent / table["mjcf"],
            trunk_body=table["trunk_body"],
            imu_site=table["imu_site"],
            left_leg=_leg(table["left_leg"]),
            right_leg=_leg(table["right_leg"]),
            sole_half_length=float(table["sole_half_length_m"]),
            sole_half_width=float(table["sole_half_width_m"]),
            stance_half_width=float(table["stance_half_width_m"]),
            nominal_posture={
                k: float(v) for k, v in table["nominal_posture_rad"].items()
            },
            velocity_limits={
                k: float(v) for k, v in table["velocity_limits_rad_s"].items()
            },
        )
    except KeyError as error:
        raise InvalidSettingError(
            str(path), error.args[0], "the key must be present"
        ) from None
    except (TypeError, ValueError) as error:
        raise InvalidSettingError(
            str(path), str(error), "see models/README.md"
        ) from None
