"""Settings of the controller `paper`: the paper's numbers, and what is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ballsim.paths import robot_description_path
from ballsim_controllers.balance.observer import decoupled_gain
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import BallParameters, ControllerSetup
from ballsim_controllers.paper import PaperController, create_paper
from ballsim_controllers.paper_settings import load_paper_settings
from ballsim_controllers.robot import load_robot_description
from ballsim_controllers.wheeled_lip import WheeledLipParameters, wheeled_lip_matrices

# K of the paper's poles and parameters: simplified-model.md section 2.
GAINS = {
    0.25: "-158.253586 -1178.522074 -408.669000 -48.304237 -133.450935 -35.448394",
    0.5: "-406.843578 -4398.764691 -800.069036 -149.811017 -550.292061 -84.265353",
    0.75: "-749.356238 -9876.499043 -1220.437887 -330.743619 -1370.666468 -147.281435",
    1.0: "-1183.968780 -17678.562750 -1655.416415 -611.116154 -2684.733333 -222.102621",
}


def make(radius=0.5, **tables) -> PaperController:
    """Return the controller on one of the paper's balls."""
    robot = load_robot_description(robot_description_path("biped"))
    ball = BallParameters(radius, 40.0, 0.5)
    return create_paper(ControllerSetup(robot, ball, 2e-3, tables))


@pytest.mark.parametrize("radius", GAINS)
def test_gains_are_those_of_the_paper(radius):
    """The shipped settings give the reference's K, F_S and bound of theta_c'."""
    controller = make(radius)
    K = np.array(GAINS[radius].split(), dtype=float)
    np.testing.assert_allclose(controller.law.gain[0], K, rtol=1e-7)
    model = wheeled_lip_matrices(WheeledLipParameters(radius))
    np.testing.assert_allclose(controller.law.F, decoupled_gain(model.A))
    assert not controller.law.is_commanded_cop_in_output
    _, paper = load_paper_settings({})
    params = paper.footsteps.make_parameters(radius)
    bound = {0.25: 1.0, 0.5: 2.0, 0.75: 8 / 3, 1.0: 4.0}[radius]
    assert params.max_swing_rate == pytest.approx(bound)
    assert (params.half_length, params.shrink) == (0.1, 0.2)


def test_settings_come_back():
    """The table of all settings makes the same controller; t_s is the clock's."""
    controller = make(footsteps={"min_swing_time_s": 0.24}, gait={"lift_m": 0.02})
    table = controller.settings_table
    shared, paper = load_paper_settings(table)
    assert shared.gait.single_support_s == paper.footsteps.min_swing_time_s == 0.24
    assert shared.gait.lift_m == 0.02
    assert {**dataclasses.asdict(shared), **dataclasses.asdict(paper)} == table


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("foo", "bar", 1),
        ("gait", "bar", 1),
        ("pendulum", "wheel_radius_m", 0.0),
        ("feedback", "is_commanded_cop_in_output", 1),
        ("feedback", "feedback_poles_rad_s", [-1.0, -2.0]),
        ("feedback", "feedback_poles_rad_s", [1.0] * 6),
        ("feedback", "observer_poles_rad_s", [-1.0]),
        ("footsteps", "shrink", 1.5),
        ("footsteps", "half_length_m", 0.0),
        ("footsteps", "swing_bounds", [1.0]),
    ],
)
def test_wrong_settings_are_refused(table, key, value):
    """The error names table and key."""
    with pytest.raises(InvalidSettingError) as caught:
        make(**{table: {key: value}})
    assert table in caught.value.key
    if table != "foo" and key != "swing_bounds":
        assert caught.value.key.endswith(f"{table}.{key}")
