"""Laws of the frame that turns with the robot: what it leaves alone, and what not."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim_controllers.balance.axis_balance import AXIS
from ballsim_controllers.compilation import compiled
from ballsim_controllers.footsteps.swing import SwingFoot
from ballsim_controllers.heading_frame import (
    HEADING,
    enter_frame,
    leave_frame,
    turn_memory,
    turn_vectors,
)
from ballsim_controllers.messages import ESTIMATE, Array, Record, telemetry_dtype
from ballsim_controllers.robot_kinematics import com_velocity
from ballsim_controllers.robot_model import RobotModel

VECTORS = [
    name
    for name in ESTIMATE.names or ()
    if name.endswith("_in_world") and name != "cop_in_world"
]


def make_frame(angle: float) -> Record:
    """Return a frame at an angle."""
    frame: Record = np.zeros(1, HEADING)
    frame["angle"], frame["cosine"], frame["sine"] = angle, np.cos(angle), np.sin(angle)
    return frame


def about_vertical(angle: float) -> Array:
    """Return the matrix of a turn to the left, shape (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def make_estimate(robot: RobotModel, seed: int) -> Record:
    """Bring the robot somewhere; return an estimate that agrees with it, (1,)."""
    generator = np.random.default_rng(seed)
    estimate: Record = np.zeros(1, ESTIMATE)
    for name in ESTIMATE.names or ():
        shape = estimate[name].shape
        estimate[name] = generator.normal(size=shape)
    qpos, qvel = robot.qpos.copy(), generator.normal(size=len(robot.qvel))
    qpos[:7] = generator.normal(size=7)
    qpos[3:7] /= np.linalg.norm(qpos[3:7])
    qpos[7:] += 0.1 * generator.normal(size=len(qpos) - 7)
    robot.update(qpos, qvel)
    estimate["position_trunk_in_world"] = qpos[:3]
    estimate["quaternion_trunk_to_world"] = qpos[3:7]
    estimate["linear_velocity_trunk_in_world"] = qvel[:3]
    return estimate


@compiled
def enter(estimates: Record, in_world: Record, frame: Record, robots: Record) -> None:
    """Call from Python."""
    enter_frame(estimates, in_world, frame, robots)


@compiled
def leave(reports: Record, frame: Record) -> None:
    """Call from Python."""
    leave_frame(reports[0], frame)


@compiled
def remember(
    axes: Record, paths: Record, vectors: Array, cosine: float, sine: float
) -> None:
    """Call from Python."""
    turn_memory(axes, paths, vectors, cosine, sine)


def test_robot_that_has_not_turned_is_in_the_world(robot: RobotModel) -> None:
    """At an angle of 0 every bit is the same, of the estimate and of the robot."""
    in_world = make_estimate(robot, 0)
    places = robot.record["feet"]["position"].copy()
    estimate: Record = np.zeros(1, ESTIMATE)
    enter(estimate, in_world, make_frame(0.0), robot.record)
    assert estimate.tobytes() == in_world.tobytes()
    np.testing.assert_array_equal(robot.record["feet"]["position"], places)


@pytest.mark.parametrize("angle", [0.3, -1.6, 2.9, 7.0])
def test_everything_turns_alike(robot: RobotModel, angle: float) -> None:
    """Estimate, soles and CoM are those of the world, seen from the frame."""
    in_world = make_estimate(robot, 1)
    feet = {name: robot.record["feet"][name][0].copy() for name in ("position",)}
    feet["linear_velocity"] = robot.record["feet"]["linear_velocity"][0].copy()
    feet["angular_velocity"] = robot.record["feet"]["angular_velocity"][0].copy()
    rotation, velocity = (
        robot.record["feet"]["rotation"][0].copy(),
        com_velocity(robot.record),
    )
    turn = about_vertical(-angle)
    estimate: Record = np.zeros(1, ESTIMATE)
    enter(estimate, in_world, make_frame(angle), robot.record)
    for name in VECTORS:
        if name != "quaternion_trunk_to_world":
            expected = in_world[name][0] @ turn.T
            np.testing.assert_allclose(estimate[name][0], expected, atol=1e-12)
    cop = in_world["cop_in_world"][0] @ turn[:2, :2].T
    np.testing.assert_allclose(estimate["cop_in_world"][0], cop, atol=1e-12)
    for name, values in feet.items():
        found = robot.record["feet"][name][0]
        np.testing.assert_allclose(found, values @ turn.T, atol=1e-9)
    found = robot.record["feet"]["rotation"][0]
    np.testing.assert_allclose(found, turn @ rotation, atol=1e-9)
    np.testing.assert_allclose(com_velocity(robot.record), turn @ velocity, atol=1e-9)
    for name in ("time", "normal_forces", "angular_velocity_trunk_in_trunk"):
        np.testing.assert_array_equal(estimate[name], in_world[name])


@pytest.mark.parametrize("angle", [0.0, 0.8, -2.0])
def test_report_is_brought_back_into_the_world(robot: RobotModel, angle: float) -> None:
    """What the frame has as a place is the place in the world that it stands for."""
    generator = np.random.default_rng(2)
    dtype = telemetry_dtype(robot.joint_count)
    report: Record = np.zeros(1, dtype)
    names = ("ideal_cop", "commanded_cop", "target_com", "target_soles")
    for name in names:
        report[name] = generator.normal(size=report[name].shape)
    in_frame = report.copy()
    leave(report, make_frame(angle))
    for name in names:
        turn = about_vertical(angle)[: report[name].shape[-1], : report[name].shape[-1]]
        expected = in_frame[name][0] @ turn.T
        np.testing.assert_allclose(report[name][0], expected, atol=1e-12)


def test_memory_turns_as_vectors_do() -> None:
    """Observers, swing path and places: sums over both axes are kept, and reversed."""
    generator = np.random.default_rng(3)
    axes: Record = np.zeros(2, AXIS)
    axes["estimate"] = generator.normal(size=(2, 4))
    axes["lagged_cop"] = generator.normal(size=2)
    swing = SwingFoot(0.5, 0.03, 0.06, 0.1)
    swing.path["offset"] = generator.normal(size=(1, 3, 2))
    swing.target[:] = generator.normal(size=2)
    places = generator.normal(size=(3, 2))
    before = axes.copy(), swing.path.copy(), places.copy()
    turn = about_vertical(0.7)[:2, :2]
    remember(axes, swing.path, places, np.cos(0.7), np.sin(0.7))
    np.testing.assert_allclose(places, before[2] @ turn.T, atol=1e-14)
    np.testing.assert_allclose(axes["estimate"], turn @ before[0]["estimate"])
    np.testing.assert_allclose(axes["lagged_cop"], turn @ before[0]["lagged_cop"])
    offset = swing.path["offset"][0]
    np.testing.assert_allclose(offset, before[1]["offset"][0] @ turn.T)
    np.testing.assert_allclose(swing.target, turn @ before[1]["target"][0])
    remember(axes, swing.path, places, np.cos(0.7), -np.sin(0.7))
    np.testing.assert_allclose(places, before[2], atol=1e-14)
    np.testing.assert_allclose(axes["estimate"], before[0]["estimate"], atol=1e-14)
    np.testing.assert_allclose(swing.path["offset"], before[1]["offset"], atol=1e-14)


def test_quarter_turn_to_the_left() -> None:
    """Forwards becomes leftwards; what is vertical stays."""
    vectors = np.array([[1.0, 0.0, 5.0], [0.0, 2.0, -1.0]])
    turn_vectors(vectors, 0.0, 1.0)
    np.testing.assert_array_equal(vectors, [[0.0, 1.0, 5.0], [-2.0, 0.0, -1.0]])
