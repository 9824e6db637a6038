"""Poles of the balance controllers on balls of different radius."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ballsim_controllers.balance.axis_balance import AxisBalance
from ballsim_controllers.balance.design import design_balance
from ballsim_controllers.messages import BallParameters
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.settings import (
    BalanceSettings,
    WheeledLipSettings,
    load_settings,
)
from ballsim_controllers.wheeled_lip import BallPendulumParameters
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

SETTINGS = load_settings(WheeledLipSettings, "wheeled-lip", {})
SAGITTAL = SETTINGS.balance.sagittal_poles_rad_s
LATERAL = SETTINGS.balance.lateral_poles_rad_s


def design(
    robot: RobotModel, radius: float, balance: BalanceSettings
) -> tuple[AxisBalance, AxisBalance]:
    """Return the controllers along and across the heading."""
    stance = solve_nominal_stance(robot, radius)
    params = BallPendulumParameters(
        BallParameters(radius=radius, mass=40.0, inertia=16.0 * radius**2),
        robot.mass,
        stance.com_height,
        robot.gravity,
    )
    settings = replace(SETTINGS, balance=balance)
    return design_balance(settings, robot, params, stance.qpos, 0.005)


def gains_differ(left: AxisBalance, right: AxisBalance) -> bool:
    """Return whether two designs of an axis feed back differently."""
    return not np.array_equal(left.model.double.gain, right.model.double.gain)


def test_poles_grow_as_the_square_root_of_the_curvature(robot: RobotModel):
    """A ball of a quarter of the radius has the poles of the double speed."""
    scaled = replace(SETTINGS.balance, poles_radius_m=1.0)
    doubled = replace(
        SETTINGS.balance,
        sagittal_poles_rad_s=tuple(2.0 * pole for pole in SAGITTAL),
        lateral_poles_rad_s=tuple(2.0 * pole for pole in LATERAL),
        poles_radius_m=0.0,
    )
    found, expected = (design(robot, 0.25, b) for b in (scaled, doubled))
    plain = design(robot, 0.25, replace(scaled, poles_radius_m=0.0))
    for axis in (0, 1):
        assert not gains_differ(found[axis], expected[axis])
        assert gains_differ(found[axis], plain[axis])


@pytest.mark.parametrize("radius", [0.35, 0.5, 0.75, 1.0])
def test_larger_balls_have_the_poles_as_they_are(robot: RobotModel, radius: float):
    """From the radius on that the setting names, the poles are what it says."""
    plain = replace(SETTINGS.balance, poles_radius_m=0.0)
    pairs = zip(
        design(robot, radius, SETTINGS.balance),
        design(robot, radius, plain),
        strict=True,
    )
    assert not any(gains_differ(*pair) for pair in pairs)
