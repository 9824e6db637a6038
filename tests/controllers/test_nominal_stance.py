"""Laws of the nominal stance."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import pytest

from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.nominal_stance import (
    NominalStance,
    solve_nominal_stance,
)

if TYPE_CHECKING:
    from tests.controllers.conftest import Mirror

    from ballsim.simulation import KeptRun

RADII = (0.15, 0.25, 0.5, 0.75, 1.0, 3.0)
WIDTH = 0.06


def placed(robot: RobotModel, radius: float) -> NominalStance:
    """Return the stance, the robot model in it."""
    stance = solve_nominal_stance(robot, radius)
    robot.update(stance.qpos, np.zeros(robot.model.nv))
    return stance


@pytest.mark.parametrize("radius", RADII)
def test_soles_touch_the_ball_tangentially(robot: RobotModel, radius: float) -> None:
    """Each sole's centre is on the ball, its normal the ball's radius there."""
    placed(robot, radius)
    centre = np.array([0.0, 0.0, radius])
    for foot, side in zip(robot.feet, (1.0, -1.0), strict=True):
        arm = foot.position - centre
        np.testing.assert_allclose(arm, radius * foot.rotation[:, 2], atol=1e-9)
        np.testing.assert_allclose(foot.position[:2], [0.0, side * WIDTH], atol=1e-9)
        np.testing.assert_allclose(foot.rotation[:, 0], [1.0, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("radius", RADII)
def test_com_is_over_the_ball_and_the_trunk_upright(
    robot: RobotModel, radius: float
) -> None:
    """The CoM is above the ball's centre, at the height that is reported."""
    stance = placed(robot, radius)
    com = robot.position_com_in_world
    np.testing.assert_allclose(com[:2], 0.0, atol=1e-9)
    assert com[2] == pytest.approx(2.0 * radius + stance.com_height, abs=1e-12)
    np.testing.assert_allclose(stance.qpos[3:7], [1.0, 0.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("radius", RADII)
def test_stance_is_its_own_mirror_image(
    robot: RobotModel, mirror: Mirror, radius: float
) -> None:
    """The stance is symmetric, though it is found by iteration."""
    stance = placed(robot, radius)
    np.testing.assert_allclose(mirror.qpos(stance.qpos), stance.qpos, atol=1e-9)


@pytest.mark.parametrize("radius", RADII)
def test_posture_is_the_nominal_one_where_it_can(
    robot: RobotModel, radius: float
) -> None:
    """Knees are bent as in the nominal posture, the upper body is in it."""
    stance = placed(robot, radius)
    joints = stance.qpos[7:]
    upper = robot.upper_dofs - 6
    np.testing.assert_array_equal(joints[upper], robot.nominal_posture[upper])
    for side in ("left", "right"):
        knee = robot.joint_names.index(f"{side}_knee")
        assert joints[knee] == pytest.approx(robot.nominal_posture[knee], abs=1e-9)
    assert (joints > robot.joint_ranges[:, 0]).all()
    assert (joints < robot.joint_ranges[:, 1]).all()


def test_stance_does_not_depend_on_what_was_before(robot: RobotModel) -> None:
    """The same bits come out whatever the model was used for."""
    first = solve_nominal_stance(robot, 0.5)
    generator = np.random.default_rng(0)
    qpos = np.concatenate((generator.normal(size=7), generator.normal(size=18)))
    robot.update(qpos, generator.normal(size=24))
    robot.update_dynamics()
    solve_nominal_stance(robot, 0.25)
    again = solve_nominal_stance(robot, 0.5)
    assert first.qpos.tobytes() == again.qpos.tobytes()
    assert first.com_height == again.com_height


def test_large_ball_is_flat_ground(robot: RobotModel) -> None:
    """On a huge ball the soles are level, as far apart as the stance is wide."""
    placed(robot, 1e4)
    for foot in robot.feet:
        np.testing.assert_allclose(foot.rotation[:, 2], [0.0, 0.0, 1.0], atol=1e-5)
    heights = [foot.position[2] - 2e4 for foot in robot.feet]
    np.testing.assert_allclose(heights, 0.0, atol=1e-6)


def test_stance_needs_no_horizontal_force(robot: RobotModel) -> None:
    """At rest the weight has no moment about the ball's top: the CoP is there."""
    stance = placed(robot, 0.5)
    robot.update_dynamics()
    moment = robot.bias[3:6] - np.cross(
        [0.0, 0.0, 1.0] - stance.qpos[:3], robot.bias[:3]
    )
    np.testing.assert_allclose(moment, 0.0, atol=1e-6)


@pytest.mark.parametrize("radius", [0.25, 1.0])
def test_simulator_starts_in_the_same_pose(
    robot: RobotModel, simulate: Callable[..., KeptRun], radius: float
) -> None:
    """Without perturbation a run starts in the stance, but for sunken contacts."""
    result = simulate(
        "stand",
        "duration_s=0.02",
        f"ball.radius_m={radius}",
        "initial.max_lean_rad=0",
        "initial.max_ball_offset_m=0",
        "initial.max_yaw_rad=0",
    )
    stance = solve_nominal_stance(robot, radius)
    start = result.series.qpos[0]
    np.testing.assert_allclose(
        start[result.ids.qpos_joints], stance.qpos[7:], atol=3e-3
    )
    trunk = start[result.ids.qpos_trunk]
    np.testing.assert_allclose(trunk[:3], stance.qpos[:3], atol=2e-3)
    data = mujoco.MjData(result.model)
    data.qpos[:] = start
    mujoco.mj_forward(result.model, data)
    assert data.ncon >= 3


@pytest.mark.parametrize("radius", [0.05, 0.074, 0.0, -1.0, np.nan])
def test_too_small_ball_is_refused(robot: RobotModel, radius: float) -> None:
    """A ball that is too small, or no ball at all, is refused by its key."""
    with pytest.raises(InvalidSettingError, match=r"ball\.radius_m = .*0\.075"):
        solve_nominal_stance(robot, radius)


def test_too_steep_ball_is_refused(robot: RobotModel) -> None:
    """A ball on which the ankles would have to leave their ranges is refused."""
    with pytest.raises(InvalidSettingError, match=r"ball\.radius_m = 0\.1 .* stand on"):
        solve_nominal_stance(robot, 0.1)
