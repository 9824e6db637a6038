"""The plant: substeps, warnings, independence of the first reading."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from ballsim.errors import PhysicsError
from ballsim.plant import Plant

SCENE = """
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>
    <body name="base" pos="0 0 1">
      <freejoint/><geom size="0.1"/>
      <body name="arm" pos="0.2 0 0">
        <joint name="hinge" axis="0 1 0"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0.2 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator><position joint="hinge" kp="20" kv="1"/></actuator>
  <sensor><jointpos joint="hinge"/><actuatorfrc actuator="hinge"/></sensor>
</mujoco>
""".replace("<position joint", '<position name="hinge" joint')


def _make_plant(n_substeps: int = 2, speed: float = 0.0) -> Plant:
    model = mujoco.MjModel.from_xml_string(SCENE)
    qvel = np.full(model.nv, speed)
    return Plant(model, np.array(model.qpos0), qvel, n_substeps)


def test_substeps_equal_single_steps_bit_for_bit() -> None:
    """One control period is so many calls of ``mj_step`` and nothing else."""
    plant = _make_plant(n_substeps=3, speed=0.1)
    plant.compute_first_sensordata()
    for i in range(400):
        plant.step(np.array([np.sin(0.01 * i)]))
    data = mujoco.MjData(plant.model)
    data.qvel[:] = 0.1
    for i in range(400):
        data.ctrl[:] = np.sin(0.01 * i)
        for _ in range(3):
            mujoco.mj_step(plant.model, data)
    assert plant.data.qpos.tobytes() == data.qpos.tobytes()
    assert plant.time == data.time


@pytest.mark.parametrize("n_late", [1, 2, 3, 4, 7])
def test_inputs_act_late(n_late: int) -> None:
    """Input i acts so many physics steps after its tick; the first one at once."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    plant = Plant(model, np.array(model.qpos0), np.zeros(model.nv), 3, n_late)
    given = np.cos(0.3 * np.arange(50))
    ctrl = np.zeros(1)  # one array for all, as a controller may have it
    for value in given:
        ctrl[:] = value
        plant.step(ctrl)
    data = mujoco.MjData(model)
    for step in range(3 * len(given)):
        data.ctrl[:] = given[max(0, step - n_late) // 3]
        mujoco.mj_step(model, data)
    assert plant.data.qpos.tobytes() == data.qpos.tobytes()
    assert plant.time == data.time


def test_drive_closes_its_loop_on_its_encoder() -> None:
    """Joint and encoder agree but for the zero: it goes where the encoder reads it."""
    zero, told = 0.05, 0.3
    model = mujoco.MjModel.from_xml_string(SCENE)
    model.opt.gravity[:] = 0.0
    start = np.array(model.qpos0), np.zeros(model.nv), 2
    off = Plant(model, *start, encoder_zeros=np.array([zero]))
    exact = Plant(model, *start)
    for _ in range(2000):
        off.step(np.array([told]))
        exact.step(np.array([told - zero]))
    assert off.data.qpos.tobytes() == exact.data.qpos.tobytes()
    assert off.data.qpos[7] + zero == pytest.approx(told, abs=1e-4)


def test_wrench_moves_the_body() -> None:
    """A wrench acts on the body that it is given for."""
    plant = _make_plant()
    wrenches = np.zeros((plant.model.nbody, 6))
    wrenches[1, 0] = 100.0
    plant.step(np.zeros(1), wrenches)
    assert plant.data.qvel[0] > 0.01


def test_first_reading_is_that_of_held_joints() -> None:
    """The drives carry the arm at the start: the torque of its weight."""
    plant = _make_plant()
    position, torque = plant.compute_first_sensordata()
    assert position == 0.0
    data = mujoco.MjData(plant.model)
    mujoco.mj_inverse(plant.model, data)
    assert abs(data.qfrc_inverse[6]) > 0.1
    assert torque == pytest.approx(data.qfrc_inverse[6])


def test_diverging_state_raises(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A warning of MuJoCo becomes an error, and no log file appears."""
    monkeypatch.chdir(tmp_path)
    plant = _make_plant(speed=np.nan)
    with pytest.raises(PhysicsError, match="BADQVEL"):
        plant.step(np.zeros(1))
    assert not list(tmp_path.iterdir())


def test_targets_that_are_no_numbers_raise() -> None:
    """What the controller sends must be finite."""
    with pytest.raises(PhysicsError, match="not finite"):
        _make_plant().step(np.array([np.nan]))
