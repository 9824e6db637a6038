"""Laws of the robot's own kinematics and dynamics, and of its description."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import pytest

from ballsim.paths import robot_description_path
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.geometry import rotation_vector_between
from ballsim_controllers.messages import Array
from ballsim_controllers.robot import RobotDescription, load_robot_description
from ballsim_controllers.robot_model import RobotModel

if TYPE_CHECKING:
    from tests.controllers.conftest import Mirror

STEP = 1e-6
FEET = (0, 1)


def random_states(
    robot: RobotModel, count: int, seed: int
) -> list[tuple[Array, Array]]:
    """Return configurations and velocities far from every symmetry."""
    generator = np.random.default_rng(seed)
    states = []
    for _ in range(count):
        qpos = np.empty(robot.model.nq)
        qpos[:3] = generator.normal(size=3)
        attitude = generator.normal(size=4)
        qpos[3:7] = attitude / np.linalg.norm(attitude)
        joints = robot.nominal_posture + generator.normal(scale=0.3, size=18)
        qpos[7:] = joints
        states.append((qpos, generator.normal(size=robot.model.nv)))
    return states


def moved(robot: RobotModel, qpos: Array, qvel: Array, time: float) -> Array:
    """Return the configuration reached at a constant generalised velocity."""
    result = qpos.copy()
    mujoco.mj_integratePos(robot.model, result, qvel, time)
    return result


def foot_pose(robot: RobotModel, foot: int, local: Array) -> tuple[Array, Array]:
    """Return the world place of a point fixed in a sole, and the sole's attitude."""
    sole = robot.feet[foot]
    return sole.position + sole.rotation @ local, sole.rotation.copy()


def mass_matrix_of(robot: RobotModel, qpos: Array, qvel: Array) -> Array:
    """Return a copy of the mass matrix."""
    robot.update(qpos, qvel)
    robot.update_dynamics()
    return robot.mass_matrix.copy()


@pytest.mark.parametrize("foot", FEET)
def test_foot_jacobian_is_the_derivative_of_its_pose(
    robot: RobotModel, foot: int
) -> None:
    """J column by column equals central differences of pose on the manifold."""
    local = np.array([0.07, -0.03, 0.01])
    for qpos, qvel in random_states(robot, 3, 1):
        robot.update(qpos, qvel)
        point, _ = foot_pose(robot, foot, local)
        jacobian = robot.point_jacobian(foot, point)
        for column, direction in enumerate(np.eye(robot.model.nv)):
            robot.update(moved(robot, qpos, direction, STEP), qvel)
            ahead, turned_ahead = foot_pose(robot, foot, local)
            robot.update(moved(robot, qpos, direction, -STEP), qvel)
            behind, turned_behind = foot_pose(robot, foot, local)
            linear = (ahead - behind) / (2.0 * STEP)
            angular = rotation_vector_between(turned_behind, turned_ahead)
            expected = np.concatenate((linear, angular / (2.0 * STEP)))
            np.testing.assert_allclose(jacobian[:, column], expected, atol=2e-9)


@pytest.mark.parametrize("foot", FEET)
def test_foot_velocity_is_the_derivative_of_its_pose(
    robot: RobotModel, foot: int
) -> None:
    """The soles' velocities equal central differences along the motion."""
    for qpos, qvel in random_states(robot, 5, 2):
        robot.update(moved(robot, qpos, qvel, STEP), qvel)
        ahead, turned_ahead = foot_pose(robot, foot, np.zeros(3))
        robot.update(moved(robot, qpos, qvel, -STEP), qvel)
        behind, turned_behind = foot_pose(robot, foot, np.zeros(3))
        robot.update(qpos, qvel)
        sole = robot.feet[foot]
        np.testing.assert_allclose(
            sole.linear_velocity, (ahead - behind) / (2.0 * STEP), atol=1e-8
        )
        angular = rotation_vector_between(turned_behind, turned_ahead) / (2.0 * STEP)
        np.testing.assert_allclose(sole.angular_velocity, angular, atol=1e-8)


@pytest.mark.parametrize("foot", FEET)
def test_bias_acceleration_is_the_derivative_of_velocity(
    robot: RobotModel, foot: int
) -> None:
    """J' v equals central differences of J v along a motion without acceleration."""
    local, step = np.array([-0.05, 0.02, 0.0]), 1e-5
    for qpos, qvel in random_states(robot, 5, 3):
        velocities = []
        for time in (step, -step):
            robot.update(moved(robot, qpos, qvel, time), qvel)
            point, _ = foot_pose(robot, foot, local)
            velocities.append(robot.point_jacobian(foot, point) @ qvel)
        robot.update(qpos, qvel)
        point, _ = foot_pose(robot, foot, local)
        bias = robot.point_bias_acceleration(foot, point)
        expected = (velocities[0] - velocities[1]) / (2.0 * step)
        assert np.abs(expected).max() > 1.0
        np.testing.assert_allclose(bias, expected, atol=1e-7)


def test_com_velocity_is_momentum_over_mass(robot: RobotModel) -> None:
    """The CoM's velocity is the derivative of its place, and M[:3] v / m."""
    for qpos, qvel in random_states(robot, 5, 4):
        mass_matrix = mass_matrix_of(robot, qpos, qvel)
        velocity = robot.com_velocity()
        np.testing.assert_allclose(
            velocity, mass_matrix[:3] @ qvel / robot.mass, atol=1e-12
        )
        places = []
        for time in (STEP, -STEP):
            robot.update(moved(robot, qpos, qvel, time), qvel)
            places.append(robot.position_com_in_world)
        expected = (places[0] - places[1]) / (2.0 * STEP)
        np.testing.assert_allclose(velocity, expected, atol=1e-8)


def test_mass_matrix_is_a_kinetic_energy(robot: RobotModel) -> None:
    """M is symmetric and positive, v' M v / 2 is MuJoCo's kinetic energy."""
    for qpos, qvel in random_states(robot, 5, 5):
        mass_matrix = mass_matrix_of(robot, qpos, qvel)
        np.testing.assert_allclose(mass_matrix, mass_matrix.T, atol=1e-13)
        assert np.linalg.eigvalsh(mass_matrix).min() > 0.0
        np.testing.assert_allclose(
            mass_matrix[:3, :3], robot.mass * np.eye(3), atol=1e-12
        )
        data = mujoco.MjData(robot.model)
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_forward(robot.model, data)
        mujoco.mj_energyVel(robot.model, data)
        energy = 0.5 * qvel @ mass_matrix @ qvel
        assert energy == pytest.approx(data.energy[1], rel=1e-12)


def test_bias_at_rest_is_weight(robot: RobotModel) -> None:
    """Without motion h is the gradient of the potential energy m g z."""
    for qpos, _ in random_states(robot, 3, 6):
        still = np.zeros(robot.model.nv)
        robot.update(qpos, still)
        robot.update_dynamics()
        bias = robot.bias.copy()
        for column, direction in enumerate(np.eye(robot.model.nv)):
            heights = []
            for time in (STEP, -STEP):
                robot.update(moved(robot, qpos, direction, time), still)
                heights.append(robot.position_com_in_world[2])
            slope = (heights[0] - heights[1]) / (2.0 * STEP)
            weight = robot.mass * robot.gravity
            assert bias[column] == pytest.approx(weight * slope, abs=1e-6)


def test_bias_knows_no_uniform_motion(robot: RobotModel) -> None:
    """Moving the whole robot at a constant velocity changes neither M nor h."""
    for qpos, qvel in random_states(robot, 3, 7):
        mass_matrix = mass_matrix_of(robot, qpos, qvel)
        bias = robot.bias.copy()
        shifted, pushed = qpos.copy(), qvel.copy()
        shifted[:3] += (3.0, -2.0, 1.0)
        pushed[:3] += (0.7, 1.1, -0.4)
        np.testing.assert_allclose(
            mass_matrix_of(robot, shifted, pushed), mass_matrix, atol=1e-11
        )
        np.testing.assert_allclose(robot.bias, bias, atol=1e-10)


def test_equations_of_motion_conserve_energy(robot: RobotModel) -> None:
    """Falling freely keeps the sum of kinetic and potential energy."""
    step = 1e-5
    for qpos, qvel in random_states(robot, 3, 8):
        mass_matrix = mass_matrix_of(robot, qpos, qvel)
        acceleration = np.linalg.solve(mass_matrix, -robot.bias)
        energies = []
        for time in (step, -step):
            velocity = qvel + time * acceleration
            place = moved(robot, qpos, qvel + 0.5 * time * acceleration, time)
            kinetic = 0.5 * velocity @ mass_matrix_of(robot, place, velocity) @ velocity
            height = robot.position_com_in_world[2]
            energies.append(kinetic + robot.mass * robot.gravity * height)
        change = (energies[0] - energies[1]) / (2.0 * step)
        assert change == pytest.approx(0.0, abs=1e-3)
        assert np.abs(robot.bias).max() > 10.0


def test_robot_is_its_own_mirror_image(robot: RobotModel, mirror: Mirror) -> None:
    """The mirrored state has mirrored feet, CoM, momentum and bias forces."""
    for qpos, qvel in random_states(robot, 3, 9):
        mass_matrix = mass_matrix_of(robot, qpos, qvel)
        momentum, bias = mass_matrix @ qvel, robot.bias.copy()
        com, velocity = robot.position_com_in_world, robot.com_velocity()
        feet = [
            (f.position.copy(), f.rotation.copy(), f.angular_velocity.copy())
            for f in robot.feet
        ]
        mirrored = mirror.qvel(qvel)
        matrix = mass_matrix_of(robot, mirror.qpos(qpos), mirrored)
        np.testing.assert_allclose(matrix @ mirrored, mirror.qvel(momentum), atol=1e-10)
        np.testing.assert_allclose(robot.bias, mirror.qvel(bias), atol=1e-9)
        np.testing.assert_allclose(
            robot.position_com_in_world, mirror.vectors(com), atol=1e-12
        )
        np.testing.assert_allclose(
            robot.com_velocity(), mirror.vectors(velocity), atol=1e-12
        )
        reflection = np.diag([1.0, -1.0, 1.0])
        for foot, (position, rotation, omega) in zip(
            robot.feet, feet[::-1], strict=True
        ):
            np.testing.assert_allclose(
                foot.position, mirror.vectors(position), atol=1e-12
            )
            np.testing.assert_allclose(
                foot.rotation, reflection @ rotation @ reflection, atol=1e-12
            )
            np.testing.assert_allclose(
                foot.angular_velocity, mirror.axials(omega), atol=1e-12
            )


def test_legs_and_upper_body_share_all_joints(robot: RobotModel) -> None:
    """Every actuated degree of freedom belongs to one leg or to the upper body."""
    dofs = np.concatenate((*robot.leg_dofs, robot.upper_dofs))
    assert sorted(dofs.tolist()) == list(range(6, robot.model.nv))
    for leg, names in zip(robot.leg_dofs, robot.robot.legs, strict=True):
        assert tuple(robot.joint_names[dof - 6] for dof in leg) == names.joints


def test_quantities_are_those_of_the_model(robot: RobotModel) -> None:
    """Gains, limits and masses are read from the MJCF, one per joint."""
    model = robot.model
    data = mujoco.MjData(model)
    data.qpos[3], data.qpos[7:] = 1.0, 0.1
    data.qvel[6:] = np.arange(18) * 0.01
    data.ctrl[:] = 0.12
    mujoco.mj_forward(model, data)
    expected = robot.kp * (0.12 - 0.1) - robot.kv * data.qvel[6:]
    np.testing.assert_allclose(data.actuator_force, expected, atol=1e-12)
    data.ctrl[:] = 100.0
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.actuator_force, robot.torque_limits)
    assert robot.mass == pytest.approx(model.body_mass.sum())
    inside = robot.nominal_posture - robot.joint_ranges[:, 0]
    assert (inside > 0.0).all()
    assert (robot.nominal_posture < robot.joint_ranges[:, 1]).all()


# -- description ---------------------------------------------------------------


def copy_of_description(folder: Path, old: str, new: str) -> Path:
    """Return a copy of the biped's description with one text replaced."""
    source = robot_description_path("biped")
    shutil.copy(source.parent / "biped.xml", folder / "biped.xml")
    text = source.read_text(encoding="utf-8")
    assert old in text
    target = folder / "robot.toml"
    target.write_text(text.replace(old, new), encoding="utf-8")
    return target


@pytest.mark.parametrize(
    "key", ["imu_site", "sole_half_length_m", "wrench_site", "mjcf", "name"]
)
def test_missing_key_is_named(tmp_path: Path, key: str) -> None:
    """A description without one of its keys is refused by that key."""
    path = copy_of_description(tmp_path, f"{key} = ", f"{key}_ = ")
    with pytest.raises(InvalidSettingError, match=rf"'{key}' .* must be present"):
        load_robot_description(path)


def test_value_of_wrong_type_is_refused(tmp_path: Path) -> None:
    """A text where a number belongs is refused, and the file is named."""
    path = copy_of_description(tmp_path, "left_knee = 0.9", 'left_knee = "bent"')
    with pytest.raises(InvalidSettingError, match=r"robot\.toml.*bent"):
        load_robot_description(path)


def test_actuators_must_follow_the_joints(tmp_path: Path) -> None:
    """A model whose servos are in another order than its joints is refused."""
    path = copy_of_description(tmp_path, "biped.xml", "other.xml")
    spec = mujoco.MjSpec.from_file(
        str(robot_description_path("biped").parent / "biped.xml")
    )
    first, second = spec.actuators[0], spec.actuators[1]
    first.target, second.target = second.target, first.target
    (tmp_path / "other.xml").write_text(spec.to_xml(), encoding="utf-8")
    with pytest.raises(InvalidSettingError, match="in the order of joints"):
        RobotModel(load_robot_description(path))


def test_every_joint_must_have_a_servo(tmp_path: Path) -> None:
    """A model with a joint that no servo drives is refused."""
    path = copy_of_description(tmp_path, "biped.xml", "other.xml")
    spec = mujoco.MjSpec.from_file(
        str(robot_description_path("biped").parent / "biped.xml")
    )
    spec.delete(spec.actuators[0])
    (tmp_path / "other.xml").write_text(spec.to_xml(), encoding="utf-8")
    with pytest.raises(InvalidSettingError, match="one servo per joint"):
        RobotModel(load_robot_description(path))


def test_description_finds_its_model_from_anywhere(
    description: RobotDescription, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The MJCF is found beside the description, whatever the working directory."""
    monkeypatch.chdir(tmp_path)
    assert RobotModel(description).joint_count == 18
