"""The simulated robot differs from what its controller is told, as asked for."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.errors import ConfigError
from ballsim.model_error import apply_model_error
from ballsim.preparation import PreparedRun, prepare
from ballsim.scene import compile_scene
from ballsim_controllers.messages import JointTargets, SensorReading


class _Silent:
    telemetry = None

    def step(self, reading: SensorReading, command: object) -> JointTargets:
        return JointTargets(reading.joint_positions)


def _prepare(*overrides: str) -> PreparedRun:
    return prepare(load_config("stand", overrides).config, _Silent())


def _robot_com(run: PreparedRun) -> np.ndarray:
    """Return the CoM of the robot in the frame of its trunk at the start."""
    model, trunk = run.plant.model, run.ids.body_trunk
    data = mujoco.MjData(model)
    data.qpos[:] = run.plant.data.qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    rotation = data.xmat[trunk].reshape(3, 3)
    return rotation.T @ (data.subtree_com[trunk] - data.xpos[trunk])


def test_masses_and_inertias_are_scaled() -> None:
    """All bodies of the robot, and not the ball; the text of the scene has it."""
    nominal, heavy = _prepare(), _prepare("robot.mass_scale=1.25")
    scale = np.full(nominal.plant.model.nbody, 1.25)
    scale[nominal.ids.body_ball] = 1.0
    for name in ("body_mass", "body_inertia"):
        before = getattr(nominal.plant.model, name)
        factors = scale if before.ndim == 1 else scale[:, None]
        for model in (heavy.plant.model, compile_scene(heavy.scene_xml)):
            after = getattr(model, name)
            np.testing.assert_allclose(after, factors * before, rtol=1e-6)
    np.testing.assert_allclose(
        heavy.plant.model.body_ipos, nominal.plant.model.body_ipos, atol=1e-9
    )


@pytest.mark.parametrize("mass_scale", [1.0, 0.8])
def test_com_of_the_whole_robot_moves_as_asked(mass_scale: float) -> None:
    """The offset is that of the robot, not that of its trunk."""
    overrides = (
        f"robot.mass_scale={mass_scale}",
        "robot.com_offset_x_m=0.01",
        "robot.com_offset_y_m=-0.02",
        "robot.com_offset_z_m=0.03",
    )
    nominal, moved = _prepare(), _prepare(*overrides)
    offset = _robot_com(moved) - _robot_com(nominal)
    np.testing.assert_allclose(offset, [0.01, -0.02, 0.03], atol=2e-6)


def test_start_is_that_of_the_nominal_robot_but_carries_the_true_weight() -> None:
    """Whoever places the robot knows no more than its controller."""
    nominal = _prepare()
    changed = _prepare("robot.mass_scale=1.2", "robot.com_offset_x_m=0.01")
    before, after = nominal.plant.data.qpos, changed.plant.data.qpos
    assert 0.0 < np.abs(after - before).max() < 5e-4
    assert after[changed.ids.qpos_ball][2] < before[nominal.ids.qpos_ball][2]
    readings = changed.plant.compute_first_sensordata()
    force = sum(readings[s][2] for s in changed.ids.sensor_forces)
    nominal_readings = nominal.plant.compute_first_sensordata()
    nominal_force = sum(nominal_readings[s][2] for s in nominal.ids.sensor_forces)
    assert force == pytest.approx(1.2 * nominal_force, rel=0.01)


def test_controller_keeps_its_nominal_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """The controller is told of the robot's own file, and a ball as believed."""
    setups = []

    def find(name: str) -> object:
        def create(setup: object) -> _Silent:
            setups.append(setup)
            return _Silent()

        return create

    monkeypatch.setattr("ballsim.preparation.find_controller_factory", find)
    overrides = [
        "robot.mass_scale=1.2",
        "robot.com_offset_z_m=0.05",
        "ball.believed_radius_scale=1.1",
        "ball.believed_mass_scale=0.5",
        "ball.believed_inertia_scale=2",
    ]
    run = prepare(load_config("stand", overrides).config)
    prepare(load_config("stand").config)
    wrong, right = setups
    assert wrong.robot == right.robot
    alone = mujoco.MjModel.from_xml_path(str(wrong.robot.mjcf_path))
    assert alone.body_mass.sum() == pytest.approx(65.0)
    assert (right.ball.radius, right.ball.mass) == (0.5, 40.0)
    assert wrong.ball.radius == pytest.approx(0.55)
    assert wrong.ball.mass == pytest.approx(20.0)
    assert wrong.ball.inertia == pytest.approx(2.0 * right.ball.inertia)
    model, ids = run.plant.model, run.ids
    assert model.body_mass[ids.body_ball] == 40.0
    assert model.geom_size[ids.geom_ball, 0] == 0.5


def test_robot_without_inertials_is_refused() -> None:
    """Masses that MuJoCo takes from geoms are nothing to be scaled here."""
    text = (
        '<mujoco><worldbody><body name="a"><geom size="1"/></body></worldbody></mujoco>'
    )
    spec = mujoco.MjSpec.from_string(text)
    apply_model_error(spec, "a", 1.0, (0.0, 0.0, 0.0))
    with pytest.raises(ConfigError, match=r"robot\.mass_scale = 2\.0.*body 'a'"):
        apply_model_error(spec, "a", 2.0, (0.0, 0.0, 0.0))
