"""What the planner keeps back for joints whose zero positions are in error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.preparation import prepare
from ballsim_controllers.footsteps.calibration import (
    CalibrationMargins,
    find_calibration_margins,
)
from ballsim_controllers.footsteps.planner_limits import PlannerLimits, limit_planner
from ballsim_controllers.messages import Array
from ballsim_controllers.pipeline import WheeledLipController
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.sensor_figures import SensorFigures
from ballsim_controllers.settings import WheeledLipSettings, load_settings
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

RADII = (0.25, 0.5, 0.75, 1.0)
BIAS = 0.005
SETTINGS = load_settings(WheeledLipSettings, "wheeled-lip", {})


def find_margins(
    robot: RobotModel, radius: float, bias: float = BIAS, half_length: float = 0.085
) -> CalibrationMargins:
    """Return the margins in the nominal stance on a ball."""
    forces = replace(SETTINGS.forces, cop_half_length_m=half_length)
    return find_calibration_margins(
        robot,
        solve_nominal_stance(robot, radius).qpos,
        replace(SETTINGS, forces=forces),
        SensorFigures(encoder_bias=bias),
    )


def draw_stances(robot: RobotModel, radius: float) -> tuple[Array, Array]:
    """Return gaps at toes and heels, and CoM over soles, of drawn zero positions.

    Returns:
        Shapes (n, 2) and (n, 2, 2): draw, foot, axis, [m].
    """
    stance, nv = solve_nominal_stance(robot, radius).qpos, robot.model.nv
    generator = np.random.default_rng(1)
    gaps, supports = [], []
    for _ in range(2000):
        qpos = stance.copy()
        qpos[7:] += BIAS * generator.standard_normal(nv - 6)
        robot.update(qpos, np.zeros(nv))
        places = np.array([foot.position for foot in robot.feet])
        toes = np.array([0.085 * foot.rotation[:, 0] for foot in robot.feet])
        gaps.append([np.diff((places + end * toes)[::-1, 1])[0] for end in (1.0, -1.0)])
        supports.append((robot.position_com_in_world - places)[:, :2])
    return np.array(gaps), np.array(supports)


@pytest.mark.parametrize("radius", RADII)
def test_margins_are_two_deviations_of_what_is_drawn(robot: RobotModel, radius: float):
    """Forward kinematics with drawn zero positions spread as much."""
    margins = find_margins(robot, radius)
    gaps, supports = draw_stances(robot, radius)
    # The standard deviation of 2000 draws is known to 1.6 %.
    assert margins.gap == pytest.approx(2.0 * gaps.std(axis=0).max(), rel=0.06)
    spread = 2.0 * supports.std(axis=0).max(axis=0)
    assert margins.support == pytest.approx(spread, rel=0.06)


def test_known_zero_positions_ask_for_nothing(robot: RobotModel):
    """No error, no margin; twice the error, twice the margin."""
    assert find_margins(robot, 0.5, 0.0) == CalibrationMargins()
    once, twice = (find_margins(robot, 0.5, bias) for bias in (0.002, 0.004))
    assert twice.gap == pytest.approx(2.0 * once.gap)
    assert twice.support == pytest.approx(2.0 * np.array(once.support))


def test_longer_soles_ask_for_a_wider_gap(robot: RobotModel):
    """A sole that is turned takes more of the gap the longer it is."""
    short, long = (find_margins(robot, 0.5, half_length=h) for h in (0.05, 0.1))
    assert short.gap < long.gap
    assert short.support == long.support


def plan_limits(preset: str) -> PlannerLimits:
    """Return what the planner of a controller with some sensors may use."""
    config = load_config("step", [f"sensors.preset={preset}"]).config
    controller = prepare(config).controller
    assert isinstance(controller, WheeledLipController)
    return controller._planner.limits


def test_planner_keeps_the_margins(robot: RobotModel):
    """The feet land farther apart by the gap's, and the CoP keeps the support's."""
    ideal, low = plan_limits("ideal"), plan_limits("low")
    assert ideal.separation == SETTINGS.planner.separation_m
    assert ideal.sagittal_reserve == SETTINGS.planner.reserve_share
    assert ideal.lateral_reserve == SETTINGS.planner.reserve_share
    margins = find_margins(robot, 0.5)  # the bias of `low`
    assert low.separation - ideal.separation == pytest.approx(margins.gap)
    for margin, tight, wide in zip(
        margins.support, low.usable(100), ideal.usable(100), strict=True
    ):
        assert wide - tight == pytest.approx(margin)


def test_a_plan_keeps_some_of_the_sole():
    """However poor the encoders, a CoP remains to plan with."""
    limits = limit_planner(SETTINGS, 0.06, 0.5, CalibrationMargins(0.2, (0.2, 0.2)))
    assert min(limits.usable(100)) > 0.0


@pytest.mark.parametrize(
    ("radius", "distance"), [(0.2, 0.084), (0.25, 0.105), (0.5, 0.11), (1.0, 0.11)]
)
def test_feet_land_nearer_to_each_other_on_a_small_ball(radius: float, distance: float):
    """They keep a distance, but no more than a share of the ball's radius."""
    limits = limit_planner(SETTINGS, 0.06, radius, CalibrationMargins())
    assert limits.separation == pytest.approx(distance)
