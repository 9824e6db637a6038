"""Laws of the state estimate: exact without noise, through the simulator."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ballsim.truth import (
    ContactTruth,
    StateTruth,
    compute_contact_truth,
    compute_state_truth,
)
from ballsim_controllers.estimation.state_estimator import StateEstimator
from ballsim_controllers.messages import Array, BallParameters, GaitPhase, SensorReading
from ballsim_controllers.robot_model import RobotModel

if TYPE_CHECKING:
    from ballsim.simulation import KeptRun

Simulate = Callable[..., "KeptRun"]
NOMINAL = ("initial.max_lean_rad=0", "initial.max_ball_offset_m=0")
STEPPING = ("duration_s=3", "command.timeline.0.time_s=0.1", *NOMINAL)


def truths(result: KeptRun) -> tuple[StateTruth, ContactTruth]:
    """Return the true course of a run, one row per tick."""
    series = result.series
    n = series.n_ticks
    state = compute_state_truth(
        result.model, result.ids, result.world, series.qpos[:n], series.qvel[:n]
    )
    return state, compute_contact_truth(result.ids, result.world, series)


def rms(errors: Array) -> float:
    """Return the root mean square of the lengths of vectors."""
    return float(np.sqrt(np.mean(np.sum(np.atleast_2d(errors) ** 2, axis=-1))))


def vertical_in_trunk(quaternions: Array) -> Array:
    """Return the world's vertical in the trunk, shape (n, 3)."""
    attitudes = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]])
    found: Array = attitudes.inv().apply([0.0, 0.0, 1.0])
    return found


def state_errors(result: KeptRun, start: float) -> dict[str, float]:
    """Return the errors of the estimate from a time on."""
    truth, _ = truths(result)
    n, e = result.series.n_ticks, result.series.telemetry
    late = result.series.time[:n] >= start
    place = e.position_com_in_world[:n] - e.position_ball_in_world[:n]
    true_place = truth.position_com_in_world - truth.position_ball_in_world
    up = vertical_in_trunk(e.quaternion_trunk_to_world[:n])
    true_up = vertical_in_trunk(truth.quaternion_trunk_to_world)
    com = e.linear_velocity_com_in_world[:n] - truth.linear_velocity_com_in_world
    ball = e.linear_velocity_ball_in_world[:n] - truth.linear_velocity_ball_in_world
    trunk = e.angular_velocity_trunk_in_trunk[:n]
    return {
        "place": rms((place - true_place)[late]),
        "tilt": rms(np.cross(up, true_up)[late]),
        "com velocity": rms(com[late]),
        "ball velocity": rms(ball[late]),
        "ball": rms(
            (e.position_ball_in_world[:n] - truth.position_ball_in_world)[late]
        ),
        "rate": rms((trunk - truth.angular_velocity_trunk_in_trunk)[late]),
    }


@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
def test_standing_robot_knows_its_state(simulate: Simulate, radius: float) -> None:
    """Without noise: CoM over the ball to 1 mm, tilt to 0.2 mrad, speeds to 5 mm/s."""
    result = simulate("stand", "duration_s=1", f"ball.radius_m={radius}", *NOMINAL)
    errors = state_errors(result, 0.2)
    assert errors["place"] < 1e-3
    assert errors["tilt"] < 2e-4
    assert errors["com velocity"] < 5e-3
    assert errors["ball velocity"] < 5e-3
    assert errors["ball"] < 1e-3


def test_stepping_robot_knows_its_state(simulate: Simulate) -> None:
    """Without noise: CoM over the ball to 5 mm, tilt to 3 mrad, speeds to 2 cm/s."""
    result = simulate("step", *STEPPING)
    assert result.series.telemetry.step_count.max() >= 6
    errors = state_errors(result, 1.0)
    assert errors["place"] < 5e-3
    assert errors["tilt"] < 3e-3
    assert errors["com velocity"] < 0.02
    assert errors["ball velocity"] < 0.02
    assert errors["ball"] < 0.01
    assert errors["rate"] < 0.02


@pytest.mark.parametrize("radius", [0.25, 1.0])
def test_unknown_start_is_found_out(simulate: Simulate, radius: float) -> None:
    """A robot that leans at the start, and does not know, learns it while it stands."""
    result = simulate("stand", "duration_s=2", "seed=3", f"ball.radius_m={radius}")
    truth, _ = truths(result)
    e, n = result.series.telemetry, result.series.n_ticks
    error = np.cross(
        vertical_in_trunk(e.quaternion_trunk_to_world[:n]),
        vertical_in_trunk(truth.quaternion_trunk_to_world),
    )
    size = np.linalg.norm(error, axis=1)
    quarter = n // 4
    assert size[0] > 0.004
    assert size[-quarter:].mean() < 0.1 * size[:quarter].mean()
    assert state_errors(result, 1.5)["place"] < 5e-3


@pytest.mark.parametrize("scenario", ["stand", "step"])
def test_contacts_are_the_true_ones(simulate: Simulate, scenario: str) -> None:
    """Normal forces and CoP are those of the simulator's contacts, one step older."""
    if scenario == "stand":
        result = simulate("stand", "duration_s=1", "ball.radius_m=0.5", *NOMINAL)
    else:
        result = simulate("step", *STEPPING)
    _, contact = truths(result)
    n, e = result.series.n_ticks, result.series.telemetry
    late = slice(n // 4, None)
    forces = (e.normal_forces[1:n] - contact.normal_forces[: n - 1])[late]
    # A swinging foot's inertia and the centripetal part are not compensated.
    assert np.sqrt(np.mean(forces**2)) < (1.0 if scenario == "stand" else 12.0)
    cop = e.cop_in_world[1:n] - e.position_ball_in_world[1:n, :2]
    errors = (cop - contact.cop_to_ball_in_world[: n - 1])[late]
    assert rms(errors) < (1e-3 if scenario == "stand" else 4e-3)


def test_swinging_foot_does_not_touch(simulate: Simulate) -> None:
    """While a foot is a centimetre above the ball its force is exactly zero."""
    result = simulate("step", *STEPPING)
    truth, contact = truths(result)
    n, e = result.series.n_ticks, result.series.telemetry
    n_lifted = 0
    for foot, phase in ((0, GaitPhase.RIGHT_SUPPORT), (1, GaitPhase.LEFT_SUPPORT)):
        sole = e.target_soles[:n, foot]
        height = np.linalg.norm(sole - truth.position_ball_in_world, axis=1) - 0.5
        swings = e.phase[:n] == phase
        # Where target and foot are both up; the foot follows within a few mm.
        lifted = swings & (height > 0.018) & (contact.normal_forces[:, foot] == 0.0)
        n_lifted += int(lifted.sum())
        assert not e.normal_forces[:n, foot][lifted].any()
        loaded = ~swings & (contact.normal_forces[:, foot] > 60.0)
        assert (e.normal_forces[:n, foot][loaded] > 0.0).mean() > 0.98
    assert n_lifted > 100


@pytest.mark.parametrize("scribbles_on", ["reading", "estimate"])
def test_arrays_are_not_shared(
    simulate: Simulate, robot: RobotModel, scribbles_on: str
) -> None:
    """Whoever scribbles on a reading or an estimate does not disturb what follows."""
    result = simulate("stand", "duration_s=1", "ball.radius_m=0.5", *NOMINAL)
    readings, period = result.series.readings, result.config.simulation.control_period
    found = []
    for scribbles in (False, True):
        estimator = StateEstimator(
            RobotModel(robot.robot), BallParameters(0.5, 40.0, 0.5), period
        )
        for tick in range(20):
            reading = SensorReading(readings.rows[tick : tick + 1].copy())
            estimate = estimator.update(reading)
            found.append(estimate.record.copy())
            item = reading if scribbles_on == "reading" else estimate
            if scribbles:
                item.record.view(np.float64)[:] = 7.0
    np.testing.assert_array_equal(found[:20], found[20:])


def test_readings_are_left_alone(simulate: Simulate, robot: RobotModel) -> None:
    """The estimator changes nothing in what it reads."""
    result = simulate("stand", "duration_s=1", "ball.radius_m=0.5", *NOMINAL)
    readings = result.series.readings
    estimator = StateEstimator(robot, BallParameters(0.5, 40.0, 0.5), 0.004)
    for tick in range(10):
        reading = SensorReading(readings.rows[tick : tick + 1].copy())
        estimator.update(reading)
        assert reading.record[0] == readings.rows[tick]
