"""A CoM that is not where the model has it: who finds it, and who does not look."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.metrics import run_and_summarise
from ballsim.preparation import PreparedRun, prepare
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.estimation.error_covariance import (
    COM_OFFSET,
    Levers,
    advance_covariance,
    make_covariance,
    weigh,
)
from ballsim_controllers.estimation.state_estimator import StateEstimator
from ballsim_controllers.messages import Array, BallParameters
from ballsim_controllers.pipeline import WheeledLipController
from ballsim_controllers.robot import RobotDescription
from ballsim_controllers.robot_kinematics import move_mass
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.sensor_figures import SensorFigures

_LEVERS = Levers(1.0, 0.2, 1.3, 0.82, 0.5)
_LEVEL_RECORD = 3  # among the estimator's arguments
_UNCERTAIN = "controller.estimation.com_offset_m=0.01"


def _found_offset(prepared: PreparedRun) -> Array:
    controller = prepared.controller
    assert isinstance(controller, WheeledLipController)
    offset: Array = controller.estimator.arguments[_LEVEL_RECORD]["com_offset"][0]
    return offset


def test_the_mass_moves_as_far_as_is_said(description: RobotDescription) -> None:
    """The whole robot's CoM, turned with the trunk, in one's own model only."""
    shared, own = RobotModel(description), RobotModel(description, has_own_model=True)
    assert shared.model is RobotModel(description).model
    qpos = np.zeros(shared.model.nq)
    qpos[3:7] = [0.5, 0.5, -0.5, 0.5]
    qpos[7:] = shared.nominal_posture
    offset = np.array([0.012, -0.007])
    places = []
    for robot in (shared, own):
        for aside in (np.zeros(2), offset):
            move_mass(robot.record, aside)
            robot.update(qpos, np.zeros(robot.model.nv))
            places.append(robot.position_com_in_world)
    rotation = own.data.xmat[own.trunk_id].reshape(3, 3)
    np.testing.assert_array_equal(places[1], places[0])
    np.testing.assert_array_equal(places[2], places[0])
    moved = rotation.T @ (places[3] - places[0])
    np.testing.assert_allclose(moved, [*offset, 0.0], atol=1e-15)


def test_an_offset_takes_a_model_of_its_own(description: RobotDescription) -> None:
    """Nobody moves the mass of a model that others use."""
    ball = BallParameters(0.5, 40.0, 0.5)
    with pytest.raises(InvalidSettingError, match="shared"):
        StateEstimator(RobotModel(description), ball, 0.005, com_offset=0.01)
    own = RobotModel(description, has_own_model=True)
    StateEstimator(own, ball, 0.005, com_offset=0.01)


def test_a_known_com_is_never_corrected() -> None:
    """Limit case: no variance, no gain, whatever is measured, for ever."""
    figures = SensorFigures(accelerometer_bias=0.05)
    covariances = make_covariance(0.005, 9.81, 600.0, _LEVERS, figures)
    rows = np.random.default_rng(1).normal(size=covariances["P"].shape[-1])
    rows[COM_OFFSET] = 0.0
    for _ in range(500):
        advance_covariance(covariances)
        assert weigh(covariances, rows, 1e-6, False)[COM_OFFSET] == 0.0
    assert not covariances["P"][0, COM_OFFSET].any()
    assert not covariances["P"][0, :, COM_OFFSET].any()


@pytest.mark.parametrize("offset", [(0.01, -0.006), (-0.008, 0.0), (0.0, 0.0)])
def test_the_offset_is_found_by_perfect_sensors(offset: tuple[float, float]) -> None:
    """Standing for 15 s: within 2 mm, and the tilt is not what pays for it."""
    x, y = offset
    overrides = [f"robot.com_offset_x_m={x}", f"robot.com_offset_y_m={y}", _UNCERTAIN]
    prepared = prepare(load_config("stand", [*overrides, "duration_s=15"]).config)
    outcome, summary = run_and_summarise(prepared, "test")
    assert outcome.is_upright
    np.testing.assert_allclose(_found_offset(prepared), offset, atol=2e-3)
    assert summary["estimate_rms"]["trunk_tilt_rad"] < 3.5e-3


def test_who_knows_the_com_takes_an_offset_for_a_tilt() -> None:
    """1 cm over 0.9 m: the other estimate is what the settings are for."""
    overrides = ["robot.com_offset_y_m=0.01", "duration_s=15"]
    prepared = prepare(load_config("stand", overrides).config)
    outcome, summary = run_and_summarise(prepared, "test")
    assert outcome.is_upright
    assert not _found_offset(prepared).any()
    assert summary["estimate_rms"]["trunk_tilt_rad"] > 8e-3


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("offset", [-0.01, 0.01])
@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize("seed", range(2))
def test_an_offset_does_not_lead_it_astray(
    axis: str, offset: float, radius: float, seed: int
) -> None:
    """A minute at 0.4 rad/s: what the envelope asks of the world as it is believed."""
    overrides = [f"ball.radius_m={radius}", f"robot.com_offset_{axis}_m={offset}"]
    config = load_config("constant-velocity", [*overrides, _UNCERTAIN, f"seed={seed}"])
    outcome, summary = run_and_summarise(prepare(config.config), "test")
    assert outcome.is_upright
    assert summary["ball_lateral_drift"] < 0.1
    assert summary["ball_speed_mean"] == pytest.approx(0.4, rel=0.01)
