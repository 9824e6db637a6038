"""Momentum about the ball's foot: the law in full physics, and what is found by it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.estimate_errors import compute_error_components, find_components
from ballsim.preparation import PreparedRun, prepare
from ballsim.series import RunSeries
from ballsim.simulation import run_prepared
from ballsim.truth import compute_contact_truth, compute_state_truth
from ballsim_controllers.estimation.error_covariance import Levers
from ballsim_controllers.estimation.floor_balance import find_offset, prepare_offset
from ballsim_controllers.estimation.rolling import make_level
from ballsim_controllers.messages import ESTIMATE, Array, BallParameters, Record
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.sensor_figures import SensorFigures

_DT, _RATE, _GRAVITY = 0.005, 0.7, 9.81
_BALL = BallParameters(radius=0.5, mass=40.0, inertia=6.0)
_OFF = SensorFigures(encoder_bias=1e-3)
_ASIDE = np.array([0.005, -0.003])


class _Floor:
    """A robot at rest over the ball's foot that legs and soles place aside."""

    def __init__(self, robot: RobotModel, figures: SensorFigures) -> None:
        """Nothing is found yet."""
        self.levels = make_level(_DT, figures, Levers(1.0, 0.2, 1.3, 0.82, 0.5))
        prepare_offset(self.levels, figures, _BALL, robot.mass)
        self.offset: Array = self.levels["offset"][0]
        self._robots = robot.record

    def advance(self, velocity: Array, *, is_balance: bool = True) -> None:
        """Add a tick; the CoM moves at a velocity, shape (3,), [m/s]."""
        estimates: Record = np.zeros(1, ESTIMATE)
        estimates["position_com_in_world"][0] = *(_ASIDE + self.offset), 1.9
        estimates["linear_velocity_com_in_world"][0] = velocity
        turning = np.zeros(3)
        find_offset(self.levels, estimates, turning, is_balance, self._robots)


def test_offset_is_found_as_two_equal_poles_do(robot: RobotModel) -> None:
    """What is left decays as (1 + w t) exp(-w t)."""
    floor = _Floor(robot, _OFF)
    for tick in range(2000):
        floor.advance(np.zeros(3))
        wt = _RATE * _DT * tick
        left = _ASIDE * (1.0 + wt) * np.exp(-wt)
        np.testing.assert_allclose(_ASIDE + floor.offset, left, atol=3e-5)
    assert np.abs(_ASIDE + floor.offset).max() < 1e-4


def test_perfect_sensors_are_believed(robot: RobotModel) -> None:
    """Nothing is found where nothing can be off."""
    floor = _Floor(robot, SensorFigures())
    for _ in range(400):
        floor.advance(np.zeros(3))
    assert not floor.offset.any()


def test_a_push_moves_nothing(robot: RobotModel) -> None:
    """While others act, momentum comes from elsewhere; what was found stays."""
    floor = _Floor(robot, _OFF)
    for _ in range(2000):
        floor.advance(np.zeros(3))
    found = floor.offset.copy()
    for tick in range(20):
        floor.advance(np.array([0.01 * tick, 0.0, 0.0]), is_balance=False)
        np.testing.assert_array_equal(floor.offset, found)
    for _ in range(100):
        floor.advance(np.array([0.19, 0.0, 0.0]))
    np.testing.assert_allclose(floor.offset, found, atol=1e-4)


def _run(scenario: str, *given: str) -> tuple[PreparedRun, RunSeries]:
    prepared = prepare(load_config(scenario, list(given)).config)
    return prepared, run_prepared(prepared).series


@pytest.mark.parametrize("radius", [0.25, 1.0])
@pytest.mark.parametrize("scenario", ["step", "constant-velocity"])
def test_only_the_weight_has_a_moment_about_the_balls_foot(
    scenario: str, radius: float
) -> None:
    """Momentum of the true robot and ball against where the true CoM was."""
    prepared, series = _run(scenario, f"ball.radius_m={radius}", "duration_s=8")
    model, ids = prepared.plant.model, prepared.ids
    data = mujoco.MjData(model)
    ball, robot = prepared.config.ball, ids.body_trunk
    mass = model.body_subtreemass[robot]
    seen, moment = [], []
    for qpos, qvel in zip(series.qpos, series.qvel, strict=True):
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        com, velocity = data.subtree_com[robot], data.subtree_linvel[robot]
        aside = com[:2] - data.xpos[ids.body_ball][:2]
        turning = data.subtree_angmom[robot]
        rolling = qvel[ids.qvel_ball][:2]
        lever = ball.moment_of_inertia / radius + ball.mass * radius
        momentum = mass * (com[2] * velocity[:2] - aside * velocity[2])
        momentum += [turning[1], -turning[0]] + lever * rolling
        seen.append(momentum)
        moment.append(mass * (_GRAVITY * aside + rolling * velocity[2]))
    means = 0.5 * (np.array(moment[1:]) + np.array(moment[:-1]))
    explained = prepared.config.simulation.control_period * np.cumsum(means, axis=0)
    change = np.array(seen[1:]) - seen[0]
    left = np.abs(explained - change).max(axis=0)
    assert (left < 0.01 * np.ptp(change, axis=0)).all()


def test_robot_is_found_that_its_encoders_place_aside() -> None:
    """The seed whose `mid` encoders place the robot 5 mm aside on 1 m."""
    given = ("sensors.preset=mid", "ball.radius_m=1.0", "seed=10", "duration_s=15")
    prepared, series = _run("stand", *given)
    model, ids, world = prepared.plant.model, prepared.ids, prepared.world
    truth = compute_state_truth(model, ids, world, series.qpos, series.qvel)
    contact = compute_contact_truth(ids, world, series)
    errors = compute_error_components(series.telemetry, truth, contact, None)
    late = errors[round(8.0 / _DT) :]
    for quantity in ("com_to_ball_m", "cop_to_ball_m"):
        off = late[:, find_components(quantity)][:, :2]
        assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 2e-3
