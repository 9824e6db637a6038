"""Laws of the compiled scene."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import mujoco
import numpy as np
import pytest

from ballsim.errors import ConfigError
from ballsim.paths import robot_description_path
from ballsim.scene import (
    BallConfig,
    SceneConfig,
    SceneIds,
    build_scene,
    compile_scene,
)
from ballsim_controllers.robot import RobotDescription, load_robot_description


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    """Return the description of the biped."""
    return load_robot_description(robot_description_path("biped"))


def _compile(
    robot: RobotDescription, config: SceneConfig | None = None
) -> tuple[mujoco.MjModel, SceneIds]:
    model = compile_scene(build_scene(robot, config))
    return model, SceneIds.from_model(model, robot)


def _arrays(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    names = [name for name in dir(model) if not name.startswith("_")]
    fields = {name: getattr(model, name) for name in names}
    return {k: v for k, v in fields.items() if isinstance(v, np.ndarray)}


def test_text_loads_identically_each_time(robot: RobotDescription) -> None:
    """The same configuration gives the same text, the same text the same model."""
    text = build_scene(robot)
    assert build_scene(robot) == text
    first, second = _arrays(compile_scene(text)), _arrays(compile_scene(text))
    assert len(first) > 100
    for name, array in first.items():
        np.testing.assert_array_equal(array, second[name], err_msg=name)


def test_text_needs_no_other_file(robot: RobotDescription) -> None:
    """Nothing in the text refers to a file."""
    text = build_scene(robot)
    assert "file=" not in text
    assert "<include" not in text


def test_robot_is_the_same_as_alone(robot: RobotDescription) -> None:
    """The scene neither changes the robot nor moves it within qpos and qvel."""
    model, ids = _compile(robot)
    alone = mujoco.MjModel.from_xml_path(str(robot.mjcf_path))
    assert (model.nq, model.nv, model.nu) == (alone.nq + 7, alone.nv + 6, alone.nu)
    assert ids.qpos_trunk == slice(0, 7)
    np.testing.assert_array_equal(model.body_mass[1 : alone.nbody], alone.body_mass[1:])
    np.testing.assert_array_equal(
        model.body_inertia[1 : alone.nbody], alone.body_inertia[1:]
    )
    np.testing.assert_array_equal(model.actuator_biasprm, alone.actuator_biasprm)
    np.testing.assert_array_equal(model.actuator_forcerange, alone.actuator_forcerange)
    np.testing.assert_array_equal(model.dof_armature[: alone.nv], alone.dof_armature)
    np.testing.assert_array_equal(model.dof_damping[: alone.nv], alone.dof_damping)


@pytest.mark.parametrize(
    ("inertia", "factor"), [("solid", 2.0 / 5.0), ("hollow", 2.0 / 3.0)]
)
def test_inertia_by_name(robot: RobotDescription, inertia: str, factor: float) -> None:
    """Solid is 2/5 m r^2 and hollow 2/3 m r^2 about every axis."""
    ball = BallConfig(radius=0.75, mass=20.0, inertia=inertia)
    model, ids = _compile(robot, SceneConfig(ball=ball))
    expected = factor * 20.0 * 0.75**2
    np.testing.assert_allclose(model.body_inertia[ids.body_ball], expected, rtol=1e-9)


@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
def test_ball(robot: RobotDescription, radius: float) -> None:
    """Radius, mass and inertia are those asked for; the ball starts on the floor."""
    ball = BallConfig(radius=radius, mass=12.0, inertia=0.3)
    model, ids = _compile(robot, SceneConfig(ball=ball))
    assert model.geom_size[ids.geom_ball, 0] == radius
    assert model.body_mass[ids.body_ball] == 12.0
    np.testing.assert_array_equal(model.body_inertia[ids.body_ball], [0.3] * 3)
    np.testing.assert_array_equal(model.body_ipos[ids.body_ball], np.zeros(3))
    assert model.qpos0[ids.qpos_ball][2] == radius


def test_defaults(robot: RobotDescription) -> None:
    """Defaults are those of the experiments."""
    model, ids = _compile(robot)
    assert model.opt.timestep == 0.001
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert model.opt.impratio == 10.0
    assert model.vis.global_.offwidth == 1280
    assert model.vis.global_.offheight == 720
    is_colliding = model.geom_contype != 0
    np.testing.assert_array_equal(
        model.geom_solref[is_colliding], [[0.005, 1.0]] * is_colliding.sum()
    )
    np.testing.assert_array_equal(model.pair_solref, [[0.005, 1.0]])
    assert (model.geom_condim[is_colliding] == 4).all()
    assert model.body_mass[ids.body_ball] == 40.0
    np.testing.assert_array_equal(model.opt.gravity, [0.0, 0.0, -9.81])


def test_contact_parameters_reach_the_contacts(robot: RobotDescription) -> None:
    """What MuJoCo makes of a contact has the configured friction and dimension."""
    config = SceneConfig(
        sole_friction=0.7,
        floor_friction=0.5,
        torsional_friction=0.01,
        contact_time_constant=0.01,
    )
    model, ids = _compile(robot, config)
    data = mujoco.MjData(model)
    data.qpos[ids.qpos_trunk.start + 2] = 1.0 + 0.88 - 0.01  # soles in the ball's top
    mujoco.mj_forward(model, data)
    seen = set()
    for contact in data.contact:
        pair = set(contact.geom.tolist())
        if ids.geom_floor in pair:
            friction = 0.5
        else:
            friction = 0.7
            assert pair & set(ids.geom_soles.tolist())
        assert ids.geom_ball in pair
        assert contact.dim == 4
        np.testing.assert_allclose(contact.friction[:3], [friction, friction, 0.01])
        np.testing.assert_array_equal(contact.solref, [0.01, 1.0])
        seen.add(frozenset(pair))
    assert len(seen) == data.ncon == 3


def test_rolling_friction_needs_six_dimensions(robot: RobotDescription) -> None:
    """With rolling friction the contacts of the ball have condim 6."""
    model, ids = _compile(robot, SceneConfig(rolling_friction=0.001))
    assert model.pair_dim[0] == 6
    np.testing.assert_array_equal(model.pair_friction[0, 3:], [0.001, 0.001])
    assert (model.geom_condim[ids.geom_soles] == 6).all()


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"sole_friction": -0.1}, "scene.sole_friction"),
        ({"floor_friction": math.nan}, "scene.floor_friction"),
        ({"torsional_friction": "much"}, "scene.torsional_friction"),
        ({"timestep": 0.0}, "scene.timestep"),
        ({"integrator": "leapfrog"}, "scene.integrator"),
        ({"cone": "round"}, "scene.cone"),
        ({"impratio": 0.0}, "scene.impratio"),
        ({"contact_time_constant": 0.0015}, "scene.contact_time_constant"),
    ],
)
def test_bad_values_are_refused(change: dict[str, Any], key: str) -> None:
    """A bad value is refused in one line that names its key."""
    with pytest.raises(ConfigError) as error:
        dataclasses.replace(SceneConfig(), **change)
    assert error.value.key == key
    assert "\n" not in str(error.value)


def test_ids_point_at_what_they_name(robot: RobotDescription) -> None:
    """Joint addresses follow the actuators, sensor slices hold what they say."""
    model, ids = _compile(robot)
    data = mujoco.MjData(model)
    assert ids.joint_names == tuple(model.actuator(i).name for i in range(model.nu))
    data.qpos[ids.qpos_joints] = np.linspace(-0.3, 0.3, model.nu)
    data.qvel[ids.qvel_joints] = 0.0
    data.qvel[ids.qvel_trunk] = [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]
    data.qvel[ids.qvel_ball] = [0.0, 0.0, 0.0, -1.0, -2.0, -3.0]
    mujoco.mj_forward(model, data)
    for i, name in enumerate(ids.joint_names):
        assert data.joint(name).qpos[0] == data.qpos[ids.qpos_joints[i]]
        assert data.joint(name).id == ids.joints[i]
    sensors = data.sensordata
    np.testing.assert_array_equal(
        sensors[ids.sensor_joints], data.qpos[ids.qpos_joints]
    )
    np.testing.assert_allclose(sensors[ids.sensor_gyro], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(sensors[ids.sensor_gyro_ball], [-1.0, -2.0, -3.0])
    for i, side in enumerate(("left", "right")):
        force, torque = ids.sensor_forces[i], ids.sensor_torques[i]
        assert force.start == model.sensor(f"force_{side}_foot").adr[0]
        assert torque.start == model.sensor(f"torque_{side}_foot").adr[0]
        assert model.geom(int(ids.geom_soles[i])).name == f"{side}_sole"
        assert model.site(int(ids.site_soles[i])).name == f"{side}_sole"
        assert model.site(int(ids.site_wrenches[i])).name == f"{side}_ft"
        assert model.body(int(ids.body_feet[i])).name == f"{side}_foot"
    slices = [ids.sensor_accelerometer, *ids.sensor_forces, *ids.sensor_torques]
    assert all(s.stop - s.start == 3 for s in slices)


def test_ids_list_the_colliding_geoms_of_the_robot(robot: RobotDescription) -> None:
    """They hold the soles, but neither floor, ball nor the geoms of pictures."""
    model, ids = _compile(robot)
    geoms = set(ids.geoms_robot.tolist())
    assert set(ids.geom_soles.tolist()) < geoms
    assert not geoms & {ids.geom_floor, ids.geom_ball}
    assert (model.geom_group[ids.geoms_robot] == 3).all()
    assert len(geoms) == 15


def test_missing_names_are_refused(robot: RobotDescription) -> None:
    """A description that names what the MJCF lacks is refused with the file."""
    leg = dataclasses.replace(robot.left_leg, wrench_site="nowhere")
    other = dataclasses.replace(robot, left_leg=leg)
    model = compile_scene(build_scene(robot))
    with pytest.raises(ConfigError, match=r"biped\.xml: robot\.site = 'nowhere'"):
        SceneIds.from_model(model, other)
    leg = dataclasses.replace(robot.left_leg, sole_site="left_ft")
    with pytest.raises(ConfigError, match="name of the sole's site"):
        build_scene(dataclasses.replace(robot, left_leg=leg))
    with pytest.raises(ConfigError, match="free joint"):
        SceneIds.from_model(model, dataclasses.replace(robot, trunk_body="head"))
