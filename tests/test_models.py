"""Laws of the robot's model, read back from what MuJoCo compiled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from ballsim.errors import ConfigError
from ballsim.paths import find_models_folder, list_robots, robot_description_path
from ballsim_controllers.robot import RobotDescription, load_robot_description

LEG = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
ARM = ("shoulder_pitch", "shoulder_roll", "elbow")
ACTUATORS = tuple(
    f"{side}_{joint}"
    for joints in (LEG, ARM)
    for side in ("left", "right")
    for joint in joints
)
MIRRORED = ("yaw", "roll")  # joints about z and x turn the other way on the right
MIRROR = np.diag([1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    """Return the description of the biped."""
    return load_robot_description(robot_description_path("biped"))


@pytest.fixture(scope="module")
def model(robot: RobotDescription) -> mujoco.MjModel:
    """Return the robot alone."""
    return mujoco.MjModel.from_xml_path(str(robot.mjcf_path))


def _pose(model: mujoco.MjModel, angles: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        data.joint(name).qpos = angle
    mujoco.mj_forward(model, data)
    return data


def _inertia_in_body(model: mujoco.MjModel, body: int) -> Any:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, model.body_iquat[body])
    rotation = matrix.reshape(3, 3)
    return rotation @ np.diag(model.body_inertia[body]) @ rotation.T


def _pairs(model: mujoco.MjModel) -> list[tuple[int, int]]:
    names = [model.body(i).name for i in range(model.nbody)]
    left = [name for name in names if name.startswith("left_")]
    return [
        (model.body(name).id, model.body(name.replace("left", "right", 1)).id)
        for name in left
    ]


def test_total_mass_and_com_height(
    model: mujoco.MjModel, robot: RobotDescription
) -> None:
    """The robot weighs 65 kg; standing bent, its CoM is 0.852 m above the soles."""
    data = _pose(model, dict(robot.nominal_posture))
    com = data.subtree_com[model.body("trunk").id]
    sole = data.site("left_sole").xpos
    assert model.body_subtreemass[1] == pytest.approx(65.0, abs=0.5)
    assert com[2] - sole[2] == pytest.approx(0.852, abs=0.002)
    assert com[0] - sole[0] == pytest.approx(0.012, abs=0.001)
    assert com[1] == pytest.approx(0.0, abs=1e-9)


def test_nominal_soles_are_level(
    model: mujoco.MjModel, robot: RobotDescription
) -> None:
    """In the nominal posture both soles lie flat and the knees are bent."""
    data = _pose(model, dict(robot.nominal_posture))
    for leg in robot.legs:
        attitude = data.site(leg.sole_site).xmat.reshape(3, 3)
        np.testing.assert_allclose(attitude, np.eye(3), atol=1e-9)
        assert 0.8 <= robot.nominal_posture[leg.joints[3]] <= 1.0


def test_leg_geometry(model: mujoco.MjModel) -> None:
    """Lengths of the straight leg are those of the README."""
    data = _pose(model, {})
    hip, knee = data.xpos[model.body("left_thigh").id], data.body("left_shin").xpos
    ankle, sole = data.body("left_foot").xpos, data.site("left_sole").xpos
    np.testing.assert_allclose(hip - knee, [0.0, 0.0, 0.40], atol=1e-12)
    np.testing.assert_allclose(knee - ankle, [0.0, 0.0, 0.40], atol=1e-12)
    np.testing.assert_allclose(ankle - sole, [0.0, 0.0, 0.08], atol=1e-12)
    assert hip[1] == pytest.approx(0.085)


def test_actuators_in_order_with_servo_gains(model: mujoco.MjModel) -> None:
    """Actuators are position servos, limited by force and not by set-point."""
    names = [model.actuator(i).name for i in range(model.nu)]
    assert tuple(names) == ACTUATORS
    for i, name in enumerate(names):
        assert model.joint(int(model.actuator_trnid[i, 0])).name == name
        gains = {"ankle": (20.0, 3.0), "should": (60.0, 4.0), "elbow": (60.0, 4.0)}
        key = next((k for k in gains if k in name), "")
        kp, kv = gains.get(key, (150.0, 4.0))
        assert model.actuator_gainprm[i, 0] == kp
        np.testing.assert_array_equal(model.actuator_biasprm[i, :3], [0.0, -kp, -kv])
    assert not model.actuator_ctrllimited.any()
    assert model.actuator_forcelimited.all()
    assert (model.actuator_forcerange[:, 0] == -model.actuator_forcerange[:, 1]).all()


def test_every_joint_is_limited_and_light(model: mujoco.MjModel) -> None:
    """Joint ranges hold the zero and the drives' inertia is small but there."""
    hinges = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    assert model.jnt_limited[hinges].all()
    assert (model.jnt_range[hinges, 0] <= 0.0).all()
    assert (model.jnt_range[hinges, 1] >= 0.0).all()
    assert (model.dof_armature[6:] >= 0.01).all()
    assert (model.dof_armature[6:] <= 0.02).all()
    assert (model.dof_armature[:6] == 0.0).all()


def test_left_and_right_bodies_mirror_each_other(model: mujoco.MjModel) -> None:
    """Mass, centre and inertia tensor of each right body mirror the left one's."""
    pairs = _pairs(model)
    assert len(pairs) == 9
    for left, right in pairs:
        assert model.body_mass[left] == model.body_mass[right]
        for field in (model.body_pos, model.body_ipos):
            np.testing.assert_allclose(MIRROR @ field[left], field[right], atol=1e-12)
        np.testing.assert_allclose(
            MIRROR @ _inertia_in_body(model, left) @ MIRROR,
            _inertia_in_body(model, right),
            atol=1e-12,
        )


def test_left_and_right_joints_mirror_each_other(model: mujoco.MjModel) -> None:
    """Ranges of yaw and roll swap their ends, those of pitch are equal."""
    for name in ACTUATORS:
        if not name.startswith("left"):
            continue
        left, right = model.joint(name), model.joint(name.replace("left", "right"))
        np.testing.assert_array_equal(left.axis, right.axis)
        assert left.damping == right.damping
        assert left.armature == right.armature
        swap = -right.range[::-1] if name.endswith(MIRRORED) else right.range
        np.testing.assert_array_equal(left.range, swap)
        one, other = model.actuator(left.name), model.actuator(right.name)
        np.testing.assert_array_equal(one.forcerange, other.forcerange)


def test_mirrored_posture_mirrors_com_and_collision_geoms(
    model: mujoco.MjModel,
) -> None:
    """A posture and its mirror image put every collision geom at mirrored places."""
    generator = np.random.default_rng(3)
    for _ in range(5):
        angles, image = {}, {}
        for name in ACTUATORS:
            angle = generator.uniform(*model.joint(name).range)
            swapped = name.replace("left", "R").replace("right", "left")
            sign = -1.0 if name.endswith(MIRRORED) else 1.0
            angles[name], image[swapped.replace("R", "right")] = angle, sign * angle
        one, other = _pose(model, angles), _pose(model, image)
        np.testing.assert_allclose(
            MIRROR @ one.subtree_com[1], other.subtree_com[1], atol=1e-12
        )
        for i in np.flatnonzero(model.geom_contype):
            name = model.geom(int(i)).name
            swapped = name.replace("left", "R").replace("right", "left")
            twin = model.geom(swapped.replace("R", "right")).id
            np.testing.assert_allclose(
                MIRROR @ one.geom_xpos[i], other.geom_xpos[twin], atol=1e-12
            )


def test_sensors(model: mujoco.MjModel) -> None:
    """Sensors have the names and sizes that the README lists, in that order."""
    expected = [("gyro_trunk", 3), ("accelerometer_trunk", 3)]
    for side in ("left", "right"):
        expected += [(f"force_{side}_foot", 3), (f"torque_{side}_foot", 3)]
    expected += [(f"position_{name}", 1) for name in ACTUATORS]
    found = [
        (model.sensor(i).name, int(model.sensor(i).dim[0]))
        for i in range(model.nsensor)
    ]
    assert found == expected


@pytest.mark.parametrize("posture", ["zero", "nominal"])
def test_no_self_contact(
    model: mujoco.MjModel, robot: RobotDescription, posture: str
) -> None:
    """Nothing touches in the zero and in the nominal posture."""
    angles = dict(robot.nominal_posture) if posture == "nominal" else {}
    assert _pose(model, angles).ncon == 0


@pytest.mark.parametrize(
    ("angles", "parts"),
    [
        ({"left_hip_roll": -0.25, "right_hip_roll": 0.25}, ("left_", "right_")),
        ({"left_shoulder_roll": -0.2}, ("chest", "left_upper_arm")),
        ({"left_hip_pitch": -2.09}, ("pelvis", "left_thigh")),
        (
            {"left_hip_roll": -0.25, "left_hip_pitch": -0.3, "left_knee": 0.6},
            ("left_", "right_"),
        ),
    ],
)
def test_parts_collide_when_driven_into_each_other(
    model: mujoco.MjModel, angles: dict[str, float], parts: tuple[str, str]
) -> None:
    """Legs collide with each other, arms with the chest, thighs with the pelvis."""
    data = _pose(model, angles)
    pairs = [
        {model.geom(int(c.geom[0])).name, model.geom(int(c.geom[1])).name}
        for c in data.contact
    ]
    assert any(
        any(n.startswith(parts[0]) for n in p)
        and any(n.startswith(parts[1]) for n in p)
        for p in pairs
    )


def test_no_contact_is_excluded(model: mujoco.MjModel) -> None:
    """Nothing that could touch is excluded; pictures' geoms weigh and touch nothing."""
    assert model.nexclude == 0
    shown = model.geom_group == 2
    assert not model.geom_contype[shown].any()
    assert not model.geom_conaffinity[shown].any()
    assert model.geom_contype[~shown].all()


def test_soles_match_the_description(
    model: mujoco.MjModel, robot: RobotDescription
) -> None:
    """The sole box ends at the sole site and has the size of robot.toml."""
    for leg in robot.legs:
        geom, site = model.geom(leg.sole_site), model.site(leg.sole_site)
        assert geom.size[0] == robot.sole_half_length
        assert geom.size[1] == robot.sole_half_width
        bottom = geom.pos - [0.0, 0.0, geom.size[2]]
        np.testing.assert_allclose(bottom, site.pos, atol=1e-12)
        assert int(geom.condim[0]) == 4
        np.testing.assert_allclose(geom.friction, [1.0, 0.02, 1e-4])
        np.testing.assert_array_equal(model.site(leg.wrench_site).pos, np.zeros(3))


def test_description_names_every_joint(
    model: mujoco.MjModel, robot: RobotDescription
) -> None:
    """Posture and speed limits cover the actuators, and the posture is in range."""
    assert tuple(robot.left_leg.joints) == ACTUATORS[:6]
    assert tuple(robot.right_leg.joints) == ACTUATORS[6:12]
    assert set(robot.nominal_posture) == set(ACTUATORS)
    assert set(robot.velocity_limits) == set(ACTUATORS)
    assert all(limit > 0.0 for limit in robot.velocity_limits.values())
    for name, angle in robot.nominal_posture.items():
        low, high = model.joint(name).range
        assert low <= angle <= high


def test_readme_gives_the_compiled_masses(model: mujoco.MjModel) -> None:
    """The table of masses in the README is that of the model."""
    text = (find_models_folder() / "README.md").read_text(encoding="utf-8")
    for i in range(1, model.nbody):
        name = model.body(i).name
        if name.startswith("right"):
            continue
        assert f"| `{name}` | {model.body_mass[i]:g} |" in text
    for name in ACTUATORS[:6] + ACTUATORS[12:15]:
        joint, actuator = model.joint(name), model.actuator(name)
        low, high = joint.range
        row = f"| `{name}` | {low:g} to {high:g} | {actuator.forcerange[1]:g} |"
        assert row in text


def test_unknown_robot_is_refused() -> None:
    """An unknown robot is refused with the names of the known ones."""
    assert "biped" in list_robots()
    assert isinstance(robot_description_path("biped"), Path)
    with pytest.raises(ConfigError, match="choose one of biped"):
        robot_description_path("tripod")
