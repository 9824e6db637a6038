"""Laws of the start: a stance in equilibrium, and what perturbs it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pytest

from ballsim.errors import ConfigError
from ballsim.initial_state import compute_initial_state
from ballsim.paths import robot_description_path
from ballsim.scene import (
    BallConfig,
    SceneConfig,
    SceneIds,
    build_scene,
    compile_scene,
)
from ballsim_controllers.messages import BallParameters
from ballsim_controllers.robot import RobotDescription, load_robot_description
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

RADII = (0.25, 0.5, 0.75, 1.0)
ROBOT = load_robot_description(robot_description_path("biped"))


@dataclass
class World:
    """A compiled scene."""

    model: mujoco.MjModel
    ids: SceneIds
    ball: BallParameters
    robot: RobotDescription = ROBOT

    def start(self, **perturbation: Any) -> mujoco.MjData:
        """Return the data at a start."""
        data = mujoco.MjData(self.model)
        data.qpos[:], data.qvel[:] = compute_initial_state(
            self.model, self.ids, self.robot, self.ball, **perturbation
        )
        mujoco.mj_forward(self.model, data)
        return data

    def com(self, data: mujoco.MjData) -> Any:
        """Return the robot's CoM."""
        return data.subtree_com[self.ids.body_trunk]

    def centre(self, data: mujoco.MjData) -> Any:
        """Return the ball's centre."""
        return data.xpos[self.ids.body_ball]

    def contacts(self, data: mujoco.MjData) -> dict[str, Any]:
        """Return the contacts of the ball by the name of the other geom."""
        found = {}
        for contact in data.contact:
            pair = set(contact.geom.tolist())
            assert self.ids.geom_ball in pair
            (other,) = pair - {self.ids.geom_ball}
            found[self.model.geom(other).name] = contact
        assert len(found) == data.ncon
        return found


def _world(radius: float) -> World:
    config = BallConfig(radius=radius)
    model = compile_scene(build_scene(ROBOT, SceneConfig(ball=config)))
    ball = BallParameters(radius, config.mass, config.moment_of_inertia)
    return World(model, SceneIds.from_model(model, ROBOT), ball)


@pytest.fixture(scope="module")
def worlds() -> dict[float, World]:
    """Return the scenes of the paper's four balls."""
    return {radius: _world(radius) for radius in RADII}


@pytest.mark.parametrize("radius", RADII)
def test_stance(worlds: dict[float, World], radius: float) -> None:
    """One contact per sole, at its centre; CoM above the ball; trunk upright."""
    world = worlds[radius]
    data = world.start()
    com, centre = world.com(data), world.centre(data)
    np.testing.assert_allclose(com[:2], centre[:2], atol=1e-8)
    np.testing.assert_allclose(data.xmat[world.ids.body_trunk], np.eye(3).ravel())
    contacts = world.contacts(data)
    assert set(contacts) == {"floor", "left_sole", "right_sole"}
    for i, site in enumerate(world.ids.site_soles):
        sole = data.site_xpos[site]
        assert sole[0] == pytest.approx(0.0, abs=1e-8)
        side = (1.0, -1.0)[i]
        assert sole[1] == pytest.approx(side * ROBOT.stance_half_width, abs=1e-4)
        normal = data.site_xmat[site].reshape(3, 3)[:, 2]
        radial = (sole - centre) / np.linalg.norm(sole - centre)
        np.testing.assert_allclose(normal, radial, atol=5e-4)
        name = ("left_sole", "right_sole")[i]
        np.testing.assert_allclose(contacts[name].pos, sole, atol=5e-4)
    np.testing.assert_array_equal(data.qvel, 0.0)
    np.testing.assert_array_equal(
        data.qpos[world.ids.qpos_ball][3:], [1.0, 0.0, 0.0, 0.0]
    )


@pytest.mark.parametrize("radius", RADII)
def test_posture_is_nominal(worlds: dict[float, World], radius: float) -> None:
    """Knees are bent as in the nominal posture on the mean; the arms are nominal."""
    world = worlds[radius]
    data = world.start()
    knees = [leg.joints[3] for leg in ROBOT.legs]
    bends = [float(data.joint(name).qpos[0]) for name in knees]
    nominal = np.mean([ROBOT.nominal_posture[name] for name in knees])
    assert bends == pytest.approx([nominal, nominal], abs=1e-8)
    for name, angle in ROBOT.nominal_posture.items():
        if "shoulder" in name or "elbow" in name:
            assert data.joint(name).qpos[0] == angle
    low, high = world.model.jnt_range[world.ids.joints].T
    angles = data.qpos[world.ids.qpos_joints]
    assert ((low <= angles) & (angles <= high)).all()


@pytest.mark.parametrize("radius", RADII)
def test_start_is_the_controllers_stance(
    worlds: dict[float, World], radius: float
) -> None:
    """But for the depth of the contacts the robot starts where controllers expect."""
    world = worlds[radius]
    data = world.start()
    stance = solve_nominal_stance(RobotModel(ROBOT), radius)
    joints = data.qpos[world.ids.qpos_joints]
    np.testing.assert_allclose(joints, stance.qpos[7:], atol=1e-8)
    height = world.com(data)[2] - 2.0 * radius
    assert height == pytest.approx(stance.com_height, abs=1e-3)


@pytest.mark.parametrize("radius", RADII)
def test_stance_is_an_equilibrium(worlds: dict[float, World], radius: float) -> None:
    """Contacts carry exactly the weights: no other force is needed at rest."""
    world = worlds[radius]
    model, data = world.model, world.start()
    data.qacc[:] = 0.0
    mujoco.mj_inverse(model, data)
    unactuated = np.r_[0:6, model.nv - 6 : model.nv]
    np.testing.assert_allclose(data.qfrc_inverse[unactuated], 0.0, atol=0.02)
    for contact in data.contact:
        assert -5e-4 < contact.dist < 0.0


def test_held_stance_stays_and_sensors_read_the_load(
    worlds: dict[float, World],
) -> None:
    """With the holding torques it stays for 50 ms; the foot sensors read fz < 0."""
    world = worlds[0.5]
    model, ids, data = world.model, world.ids, world.start()
    data.qacc[:] = 0.0
    mujoco.mj_inverse(model, data)
    torques = data.qfrc_inverse[ids.qvel_joints]
    gains = model.actuator_gainprm[:, 0]
    data.ctrl[:] = data.qpos[ids.qpos_joints] + torques / gains
    mujoco.mj_forward(model, data)
    foot = float(model.body_mass[ids.body_feet[0]])
    load = 9.81 * (0.5 * float(model.body_subtreemass[ids.body_trunk]) - foot)
    for sensor, site in zip(ids.sensor_forces, ids.site_wrenches, strict=True):
        force = data.site_xmat[site].reshape(3, 3) @ data.sensordata[sensor]
        assert force[2] == pytest.approx(-load, rel=0.01)
    np.testing.assert_allclose(
        data.sensordata[ids.sensor_accelerometer], [0.0, 0.0, 9.81], atol=1e-2
    )
    before = world.com(data).copy()
    mujoco.mj_step(model, data, 50)
    np.testing.assert_allclose(world.com(data), before, atol=1e-5)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("lean", [(0.02, 0.0), (0.0, 0.02), (-0.015, -0.015)])
def test_lean_turns_about_the_top(
    worlds: dict[float, World], radius: float, lean: tuple[float, float]
) -> None:
    """The CoM moves by its height over the top times the angle, the trunk turns."""
    world = worlds[radius]
    data = world.start(lean=lean)
    com, centre = world.com(data), world.centre(data)
    height = world.com(world.start())[2] - 2.0 * radius
    # The legs that settle carry the CoM a few micrometres along.
    assert com[0] - centre[0] == pytest.approx(height * lean[0], rel=0.01, abs=5e-6)
    assert com[1] - centre[1] == pytest.approx(-height * lean[1], rel=0.01, abs=5e-6)
    up = data.xmat[world.ids.body_trunk].reshape(3, 3)[:, 2]
    assert up[0] == pytest.approx(math.sin(lean[0]), abs=1e-3)
    assert up[1] == pytest.approx(-math.sin(lean[1]), abs=1e-3)


def test_ball_offset_moves_the_ball_alone(worlds: dict[float, World]) -> None:
    """The robot keeps its place in the world, the ball moves under it."""
    world = worlds[0.5]
    plain, data = world.start(), world.start(ball_offset=(0.02, -0.01))
    np.testing.assert_allclose(
        world.centre(data) - world.centre(plain), [0.02, -0.01, 0.0], atol=1e-12
    )
    np.testing.assert_allclose(world.com(data), world.com(plain), atol=2e-4)
    for site in world.ids.site_soles:
        moved = data.site_xpos[site] - plain.site_xpos[site]
        np.testing.assert_allclose(moved[:2], 0.0, atol=1e-8)
        assert abs(moved[2]) < 2e-3


@pytest.mark.parametrize("radius", RADII)
def test_perturbed_soles_stay_on_the_ball(
    worlds: dict[float, World], radius: float
) -> None:
    """Both soles keep their static depth under any allowed perturbation."""
    world = worlds[radius]
    plain = world.contacts(world.start())
    generator = np.random.default_rng(7)
    for _ in range(5):
        data = world.start(
            lean=tuple(generator.uniform(-0.02, 0.02, 2)),
            ball_offset=tuple(generator.uniform(-0.01, 0.01, 2)),
            yaw=generator.uniform(-math.pi, math.pi),
        )
        contacts = world.contacts(data)
        assert set(contacts) == set(plain)
        for name, contact in contacts.items():
            assert contact.dist == pytest.approx(plain[name].dist, abs=1e-6)


def test_yaw_turns_everything_but_the_ball(worlds: dict[float, World]) -> None:
    """Yaw turns places and trunk about the vertical; the ball keeps its attitude."""
    world = worlds[0.5]
    kicks: dict[str, Any] = {"lean": (0.02, -0.01), "ball_offset": (0.01, 0.005)}
    plain, turned = world.start(**kicks), world.start(**kicks, yaw=0.7)
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for before, after in (
        (world.com(plain), world.com(turned)),
        (world.centre(plain), world.centre(turned)),
    ):
        np.testing.assert_allclose(turn @ before, after, atol=1e-12)
    trunk = world.ids.body_trunk
    np.testing.assert_allclose(
        turn @ plain.xmat[trunk].reshape(3, 3), turned.xmat[trunk].reshape(3, 3)
    )
    joints = world.ids.qpos_joints
    np.testing.assert_array_equal(plain.qpos[joints], turned.qpos[joints])
    np.testing.assert_array_equal(
        turned.qpos[world.ids.qpos_ball][3:], [1.0, 0.0, 0.0, 0.0]
    )


def test_start_is_reproducible(worlds: dict[float, World]) -> None:
    """The same request gives the same bits."""
    world = worlds[0.75]
    kicks: dict[str, Any] = {
        "lean": (0.01, 0.02),
        "ball_offset": (0.003, -0.004),
        "yaw": 0.1,
    }
    np.testing.assert_array_equal(world.start(**kicks).qpos, world.start(**kicks).qpos)


@pytest.mark.parametrize("radius", [0.0, 0.06, 0.07, 0.08, math.nan])
def test_too_small_ball_is_refused(worlds: dict[float, World], radius: float) -> None:
    """A ball that the feet cannot stand on is refused in one line."""
    world = worlds[0.5]
    ball = BallParameters(radius, 40.0, 0.05)
    with pytest.raises(ConfigError) as error:
        compute_initial_state(world.model, world.ids, ROBOT, ball)
    assert error.value.key == "ball.radius_m"
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "perturbation",
    [{"lean": (0.3, 0.0)}, {"lean": (0.0, 0.2)}, {"ball_offset": (0.1, 0.0)}],
)
def test_too_large_perturbation_is_refused(
    worlds: dict[float, World], perturbation: dict[str, tuple[float, float]]
) -> None:
    """A contact that would lie outside its sole is refused."""
    with pytest.raises(ConfigError, match=r"within 0\.095 x 0\.04 m"):
        worlds[0.5].start(**perturbation)
