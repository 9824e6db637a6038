"""Laws of the inverse kinematics, whoever solves it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import daqp
import mink
import mujoco
import numpy as np
import pytest

from ballsim_controllers.geometry import rotation_from_vector, rotation_vector_between
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.inverse_kinematics import (
    InverseKinematics,
    PostureTargets,
    TaskCosts,
)
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

if TYPE_CHECKING:
    from tests.controllers.conftest import Mirror

PERIOD = 0.02


@pytest.fixture
def pose(robot: RobotModel) -> Array:
    """Return the nominal stance on the ball of 0.5 m."""
    return solve_nominal_stance(robot, 0.5).qpos


def present_targets(robot: RobotModel, qpos: Array) -> PostureTargets:
    """Return the places where everything is now."""
    robot.update(qpos, np.zeros(robot.model.nv))
    return PostureTargets(
        com=robot.position_com_in_world,
        sole_positions=np.array([foot.position for foot in robot.feet]),
        sole_rotations=np.array([foot.rotation for foot in robot.feet]),
        trunk_rotation=robot.data.xmat[robot.trunk_id].reshape(3, 3).copy(),
    )


def follow(
    robot: RobotModel, qpos: Array, targets: PostureTargets, steps: int = 25
) -> Iterator[Array]:
    """Yield the configurations of a robot that moves as the IK says.

    The base follows the soles: it is moved so that their mean error vanishes,
    as standing feet would do.
    """
    ik = InverseKinematics(robot, TaskCosts(), PERIOD)
    present = qpos.copy()
    for _ in range(steps):
        velocity = ik.solve(present, targets)
        present[7:] += PERIOD * velocity
        robot.update(present, np.zeros(robot.model.nv))
        soles = np.array([foot.position for foot in robot.feet])
        present[:3] += (targets.sole_positions - soles).mean(axis=0)
        yield present


def test_robot_at_its_targets_stays(robot: RobotModel, pose: Array) -> None:
    """Where all targets are met the joints rest, but for the pull of the posture."""
    targets = present_targets(robot, pose)
    velocity = InverseKinematics(robot, TaskCosts(), PERIOD).solve(pose, targets)
    assert np.abs(velocity).max() < 0.03
    legs = np.concatenate(robot.leg_dofs) - 6
    assert np.abs(velocity[legs]).max() < 1e-3


@pytest.mark.parametrize(
    "shift", [(0.02, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, -0.03)]
)
def test_com_target_is_reached(
    robot: RobotModel, pose: Array, shift: tuple[float, float, float]
) -> None:
    """The CoM comes to its target while soles and trunk keep their attitudes."""
    plain = present_targets(robot, pose)
    targets = replace(plain, com=plain.com + np.array(shift))
    final = list(follow(robot, pose, targets))[-1]
    robot.update(final, np.zeros(robot.model.nv))
    np.testing.assert_allclose(robot.position_com_in_world, targets.com, atol=1e-3)
    for i, foot in enumerate(robot.feet):
        np.testing.assert_allclose(foot.position, targets.sole_positions[i], atol=1e-3)
        error = rotation_vector_between(foot.rotation, targets.sole_rotations[i])
        assert np.abs(error).max() < 5e-3


@pytest.mark.parametrize("foot", [0, 1])
def test_sole_target_is_reached(robot: RobotModel, pose: Array, foot: int) -> None:
    """One period leads a sole to a near target, place and attitude, to a tenth."""
    plain = present_targets(robot, pose)
    positions, rotations = plain.sole_positions.copy(), plain.sole_rotations.copy()
    shift, turn = np.array([0.006, 0.002, 0.008]), np.array([0.01, 0.02, 0.0])
    positions[foot] += shift
    rotations[foot] = rotation_from_vector(turn) @ rotations[foot]
    targets = replace(plain, sole_positions=positions, sole_rotations=rotations)
    ik = InverseKinematics(robot, TaskCosts(), PERIOD)
    qvel = np.zeros(robot.model.nv)
    qvel[6:] = ik.solve(pose, targets)
    robot.update(pose, qvel)
    moved = robot.feet[foot].linear_velocity - robot.feet[1 - foot].linear_velocity
    np.testing.assert_allclose(PERIOD * moved, shift, atol=1e-3)
    turned = robot.feet[foot].angular_velocity - robot.feet[1 - foot].angular_velocity
    np.testing.assert_allclose(PERIOD * turned, turn, atol=4e-3)


def test_speed_limits_hold(robot: RobotModel, pose: Array) -> None:
    """However far the target, no joint is asked to be faster than its drive."""
    plain = present_targets(robot, pose)
    ik = InverseKinematics(robot, TaskCosts(), PERIOD)
    for shift in ([0.5, 0.2, 0.3], [-0.5, 0.0, 0.5]):
        targets = replace(
            plain,
            sole_positions=plain.sole_positions + np.array([shift, [0.0, 0.0, 0.0]]),
        )
        velocity = ik.solve(pose, targets)
        assert (np.abs(velocity) <= robot.velocity_limits + 1e-6).all()
        assert (np.abs(velocity) > 0.99 * robot.velocity_limits).any()


def test_joint_ranges_hold(robot: RobotModel, pose: Array) -> None:
    """A target that no posture can reach leads to the joints' stops, not beyond."""
    plain = present_targets(robot, pose)
    for shift in ([0.0, 0.0, 2.0], [0.0, 0.0, -2.0]):
        targets = replace(plain, com=plain.com + shift)
        for qpos in follow(robot, pose, targets, 60):
            assert (qpos[7:] > robot.joint_ranges[:, 0] - 1e-6).all()
            assert (qpos[7:] < robot.joint_ranges[:, 1] + 1e-6).all()


def test_start_beyond_a_stop_is_no_failure(robot: RobotModel, pose: Array) -> None:
    """A joint that was pushed through its stop is led back within its speed."""
    targets = present_targets(robot, pose)
    for side in (0, 1):
        beyond = pose.copy()
        beyond[7:] = robot.joint_ranges[:, side] + (0.2 if side else -0.2)
        ik = InverseKinematics(robot, TaskCosts(), PERIOD)
        velocity = ik.solve(beyond, targets)
        assert ik.failure_count == 0
        outwards = velocity if side else -velocity
        assert outwards.max() < 1e-6
        assert (np.abs(velocity) <= robot.velocity_limits + 1e-6).all()


def test_solver_without_solution_halves_the_motion(
    robot: RobotModel, pose: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each failure halves the last velocities and is counted; success starts anew."""
    plain = present_targets(robot, pose)
    targets = replace(plain, com=plain.com + np.array([0.01, 0.0, 0.0]))
    ik = InverseKinematics(robot, TaskCosts(), PERIOD)
    first = ik.solve(pose, targets).copy()
    assert np.abs(first).max() > 0.1

    def fail(hessian: Array, *_: Any) -> tuple[Array, float, int, dict[str, Any]]:
        return np.zeros(len(hessian)), 0.0, -1, {}

    with monkeypatch.context() as patch:
        patch.setattr(daqp, "solve", fail)
        np.testing.assert_array_equal(ik.solve(pose, targets), 0.5 * first)
        np.testing.assert_array_equal(ik.solve(pose, targets), 0.25 * first)
    assert ik.failure_count == 2
    np.testing.assert_allclose(ik.solve(pose, targets), first, atol=1e-9)
    assert ik.failure_count == 2


@pytest.mark.parametrize("size", [2e-4, 0.05, 0.5])
def test_solution_is_minks_own(robot: RobotModel, pose: Array, size: float) -> None:
    """mink's solver, given the same tasks and limits, has the same solution.

    Small errors meet no limit, large ones many.
    """
    generator = np.random.default_rng(3)
    n_limited = 0
    for _ in range(10):
        present = pose.copy()
        present[7:] += generator.normal(scale=0.02, size=18)
        low, high = robot.joint_ranges.T
        present[7:] = np.clip(present[7:], low, high)
        plain = present_targets(robot, present)
        turn = rotation_from_vector(size * generator.normal(size=3))
        targets = PostureTargets(
            com=plain.com + size * generator.normal(size=3),
            sole_positions=plain.sole_positions + size * generator.normal(size=(2, 3)),
            sole_rotations=turn @ plain.sole_rotations,
            trunk_rotation=turn.T @ plain.trunk_rotation,
        )
        ik = InverseKinematics(robot, TaskCosts(), PERIOD)
        velocity = ik.solve(present, targets)
        expected = mink.solve_ik(
            ik.configuration,
            ik.tasks,
            PERIOD,
            solver="daqp",
            damping=ik.damping,
            limits=ik.limits,
        )
        np.testing.assert_allclose(velocity, expected[6:], atol=1e-6)
        n_limited += np.sum(np.abs(velocity) > 0.999 * robot.velocity_limits)
    assert (n_limited == 0) == (size == 2e-4)


def test_inputs_and_robot_are_left_alone(robot: RobotModel, pose: Array) -> None:
    """Neither the configuration, nor the targets, nor the shared data are changed."""
    plain = present_targets(robot, pose)
    targets = replace(plain, com=plain.com + np.array([0.01, 0.0, 0.0]))
    copies = [targets.com.copy(), targets.sole_positions.copy()]
    before = pose.copy()
    state = robot.data.qpos.copy(), robot.data.site_xpos.copy()
    InverseKinematics(robot, TaskCosts(), PERIOD).solve(pose, targets)
    np.testing.assert_array_equal(pose, before)
    np.testing.assert_array_equal(targets.com, copies[0])
    np.testing.assert_array_equal(targets.sole_positions, copies[1])
    np.testing.assert_array_equal(robot.data.qpos, state[0])
    np.testing.assert_array_equal(robot.data.site_xpos, state[1])


def test_place_on_the_floor_does_not_matter(robot: RobotModel, pose: Array) -> None:
    """Moving robot and targets together leaves the joint velocities as they are."""
    plain = present_targets(robot, pose)
    targets = replace(plain, com=plain.com + np.array([0.01, 0.005, 0.0]))
    here = InverseKinematics(robot, TaskCosts(), PERIOD).solve(pose, targets)
    shift = np.array([3.0, -2.0, 0.5])
    moved = pose.copy()
    moved[:3] += shift
    targets = replace(
        targets, com=targets.com + shift, sole_positions=targets.sole_positions + shift
    )
    there = InverseKinematics(robot, TaskCosts(), PERIOD).solve(moved, targets)
    np.testing.assert_allclose(there, here, atol=1e-4)


def test_mirrored_targets_give_mirrored_velocities(
    robot: RobotModel, pose: Array, mirror: Mirror
) -> None:
    """Reflecting robot and targets reflects the joint velocities."""
    generator = np.random.default_rng(0)
    pose = pose.copy()
    pose[7:] += generator.normal(scale=0.02, size=18)
    plain = present_targets(robot, pose)
    targets = replace(
        plain,
        com=plain.com + np.array([0.004, 0.006, -0.002]),
        sole_positions=plain.sole_positions
        + np.array([[0.005, 0.0, 0.004], [0.0, 0.0, 0.0]]),
    )
    velocity = InverseKinematics(robot, TaskCosts(), PERIOD).solve(pose, targets)
    reflection = np.diag([1.0, -1.0, 1.0])
    image = PostureTargets(
        com=mirror.vectors(targets.com),
        sole_positions=mirror.vectors(targets.sole_positions)[::-1],
        sole_rotations=(reflection @ targets.sole_rotations @ reflection)[::-1],
        trunk_rotation=reflection @ targets.trunk_rotation @ reflection,
    )
    ik = InverseKinematics(robot, TaskCosts(), PERIOD)
    found = ik.solve(mirror.qpos(pose), image)
    np.testing.assert_allclose(found, mirror.joints(velocity), atol=1e-5)
    assert np.abs(velocity).max() > 0.1


def test_mass_of_the_task_is_the_robots_alone(robot: RobotModel) -> None:
    """The model that mink sees has no ball: its mass is that of the robot."""
    assert mujoco.mj_getTotalmass(robot.model) == pytest.approx(robot.mass)
    names = [robot.model.body(i).name for i in range(robot.model.nbody)]
    assert "ball" not in names
