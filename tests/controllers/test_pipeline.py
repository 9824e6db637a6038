"""Laws of the whole controller: bits, mirror, nothing but sensors, no exceptions."""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import daqp
import mujoco
import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.plant import Plant
from ballsim.preparation import prepare
from ballsim.simulation import run_prepared
from ballsim.world_frame import RobotWorld
from ballsim_controllers.messages import (
    Array,
    Command,
    Controller,
    GaitPhase,
    SensorReading,
)

if TYPE_CHECKING:
    from tests.controllers.conftest import Mirror, SteppingRun

    from ballsim.simulation import KeptRun

Simulate = Callable[..., "KeptRun"]
NOMINAL = ("initial.max_lean_rad=0", "initial.max_ball_offset_m=0")


def answers(
    controller: Controller,
    run: SteppingRun,
    change: Callable[[SensorReading], SensorReading] = lambda reading: reading,
) -> Array:
    """Return what a controller answers to the readings of the stepping run."""
    return np.array(
        [
            controller.step(change(reading), run.command(reading.time)).positions
            for reading in run.readings()
        ]
    )


# -- bits ------------------------------------------------------------------------


def test_same_readings_give_the_same_bits(stepping: SteppingRun) -> None:
    """A new controller answers the readings of a run with the run's own bits."""
    result = stepping.result
    assert result.series.telemetry.step_count.max() >= 2
    controller = stepping.make_controller(stepping.settings)
    found = answers(controller, stepping)
    assert found.tobytes() == np.ascontiguousarray(result.series.ctrl).tobytes()


def test_two_controllers_do_not_disturb_each_other(stepping: SteppingRun) -> None:
    """Controllers share no state: interleaved calls give the bits of single ones."""
    result = stepping.result
    one, other = (stepping.make_controller(stepping.settings) for _ in range(2))
    for tick, reading in enumerate(stepping.readings()):
        expected = result.series.ctrl[tick]
        command = stepping.command(reading.time)
        assert one.step(reading, command).positions.tobytes() == expected.tobytes()
        late = reading.changed(angular_velocity_imu=reading.angular_velocity_imu + 0.1)
        other.step(late, Command())
        if tick == 150:
            break


SENSORS_ONLY = """
import sys
from pathlib import Path

for name in ("ballsim", "rerun", "rich"):
    sys.modules[name] = None  # an import of it raises ModuleNotFoundError
import numpy as np
from ballsim_controllers.messages import (
    BallParameters, Command, ControllerSetup, SensorReading,
)
from ballsim_controllers.pipeline import create_wheeled_lip
from ballsim_controllers.robot import load_robot_description

folder, robot = Path(sys.argv[1]), Path(sys.argv[2])
data = np.load(folder / "readings.npz")
radius, mass, inertia, period = data["setup"]
controller = create_wheeled_lip(ControllerSetup(
    load_robot_description(robot), BallParameters(radius, mass, inertia), period,
    {"gait": {"start_patience_s": 0.0}},
))
positions = []
for row in data["readings"]:
    reading = SensorReading(np.array([row]))
    command = Command(is_stepping=bool(reading.time > 0.1 - 1e-9))
    positions.append(controller.step(reading, command).positions)
np.save(folder / "positions.npy", positions)
assert not any(name.split(".")[0] == "ballsim" for name, m in sys.modules.items() if m)
"""


def test_controller_never_sees_the_truth(stepping: SteppingRun, tmp_path: Path) -> None:
    """From recorded readings alone, without the simulator, come the same bits."""
    result = stepping.result
    n, ball = result.series.n_ticks, result.config.ball
    setup = (
        ball.radius,
        ball.mass,
        ball.moment_of_inertia,
        result.config.simulation.control_period,
    )
    rows = result.series.readings.rows[:n]
    np.savez(tmp_path / "readings.npz", setup=setup, readings=rows)
    robot = result.robot.mjcf_path.parent / "robot.toml"
    arguments = [sys.executable, "-c", SENSORS_ONLY, str(tmp_path), str(robot)]
    subprocess.run(arguments, check=True, cwd=tmp_path, timeout=60)
    found = np.load(tmp_path / "positions.npy")
    assert found.tobytes() == np.ascontiguousarray(result.series.ctrl).tobytes()


def test_inputs_are_left_alone(stepping: SteppingRun) -> None:
    """The controller changes nothing in a reading and shares none of its answers."""
    result = stepping.result
    controller = stepping.make_controller(stepping.settings)
    for tick, reading in enumerate(itertools.islice(stepping.readings(), 120)):
        targets = controller.step(reading, stepping.command(reading.time))
        assert targets.positions.tobytes() == result.series.ctrl[tick].tobytes()
        assert reading.record[0] == result.series.readings.rows[tick]
        targets.positions[:] = np.nan


@pytest.mark.parametrize("part", ["report", "estimate"])
def test_telemetry_is_not_shared(stepping: SteppingRun, part: str) -> None:
    """Whoever scribbles on a report does not disturb the robot."""
    result = stepping.result
    controller = stepping.make_controller(stepping.settings)
    for tick, reading in enumerate(stepping.readings()):
        targets = controller.step(reading, stepping.command(reading.time))
        assert targets.positions.tobytes() == result.series.ctrl[tick].tobytes()
        report = controller.telemetry
        assert report is not None
        item = report if part == "report" else report.estimate
        item.record.view(np.uint8)[:] = 77


# -- mirror ----------------------------------------------------------------------


def mirrored_reading(reading: SensorReading, mirror: Mirror) -> SensorReading:
    """Return what the mirrored robot on the mirrored ball reads."""
    return SensorReading.of(
        time=reading.time,
        joint_positions=mirror.joints(reading.joint_positions),
        joint_velocities=mirror.joints(reading.joint_velocities),
        angular_velocity_imu=mirror.axials(reading.angular_velocity_imu),
        acceleration_imu=mirror.vectors(reading.acceleration_imu),
        foot_forces=mirror.vectors(reading.foot_forces)[::-1],
        foot_torques=mirror.axials(reading.foot_torques)[::-1],
        angular_velocity_ball=mirror.axials(reading.angular_velocity_ball),
    )


def test_mirrored_readings_give_mirrored_commands(
    stepping: SteppingRun, mirror: Mirror
) -> None:
    """Reflected readings of a second of stepping have reflected answers."""
    result = stepping.result
    controller = stepping.make_controller(stepping.settings)
    found = answers(controller, stepping, lambda r: mirrored_reading(r, mirror))
    assert controller.telemetry is not None
    assert controller.telemetry.step_count >= 2
    np.testing.assert_allclose(found, mirror.joints(result.series.ctrl), atol=1e-5)


@pytest.mark.parametrize("scenario", ["stand", "step"])
def test_mirrored_start_gives_a_mirrored_run(mirror: Mirror, scenario: str) -> None:
    """Through the physics, .3 s from the mirrored start are the mirror image."""
    overrides = ["seed=5", "initial.max_yaw_rad=0", "duration_s=0.3"]
    if scenario == "step":
        overrides += [
            "command.timeline.0.time_s=0",
            "controller.gait.start_patience_s=0",
        ]
    config = load_config(scenario, overrides).config
    plain, prepared = run_prepared(prepare(config)), prepare(config)
    ids, start = plain.ids, plain.series.qpos[0]
    robot_start = np.concatenate((start[ids.qpos_trunk], start[ids.qpos_joints]))
    qpos, image = start.copy(), mirror.qpos(robot_start)
    qpos[ids.qpos_trunk], qpos[ids.qpos_joints] = image[:7], image[7:]
    ball = start[ids.qpos_ball]
    np.testing.assert_array_equal(ball[3:], [1.0, 0.0, 0.0, 0.0])
    qpos[ids.qpos_ball] = np.concatenate((mirror.vectors(ball[:3]), ball[3:]))
    assert np.abs(qpos - start).max() > 1e-3
    still = np.zeros(plain.model.nv)
    mirrored = run_prepared(
        replace(
            prepared,
            plant=Plant(prepared.plant.model, qpos, still, config.n_substeps),
            world=RobotWorld.from_start(qpos, ids),
        )
    )
    expected = mirror.joints(plain.series.ctrl)
    np.testing.assert_allclose(mirrored.series.ctrl, expected, atol=1e-4)
    phases = {GaitPhase(p) for p in plain.series.telemetry.phase.tolist()}
    assert (len(phases) > 1) == (scenario == "step")


# -- robustness --------------------------------------------------------------------


def test_failing_inverse_kinematics_do_not_stop_the_robot(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where mink finds no solution the controller goes on, and the robot stands."""

    def fail(hessian: Array, *_: Any) -> tuple[Array, float, int, dict[str, Any]]:
        return np.zeros(len(hessian)), 0.0, -1, {}

    monkeypatch.setattr(daqp, "solve", fail)
    result = run_prepared(prepare(load_config("stand", ["duration_s=0.4"]).config))
    assert result.is_upright
    assert np.isfinite(result.series.ctrl).all()


def test_failing_preview_does_not_stop_the_robot(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where the preview has no solution the feedback goes on, and the robot stands."""

    class Failing(daqp.Model):
        def solve(self) -> tuple[Array, float, int, dict[str, Any]]:
            solution, _, _, _ = super().solve()
            return np.full_like(solution, np.nan), 0.0, -1, {}

    monkeypatch.setattr(daqp, "Model", Failing)
    result = run_prepared(prepare(load_config("stand", ["duration_s=0.4"]).config))
    assert result.is_upright
    assert np.isfinite(result.series.ctrl).all()


def test_first_answer_holds_the_robot(simulate: Simulate) -> None:
    """Second route: mj_inverse of the whole scene at rest asks for the same torques."""
    result = simulate("stand", "duration_s=1", "ball.radius_m=0.5", *NOMINAL)
    model, data = result.model, mujoco.MjData(result.model)
    data.qpos[:] = result.series.qpos[0]
    mujoco.mj_inverse(model, data)
    torques = data.qfrc_inverse[model.jnt_dofadr[model.actuator_trnid[:, 0]]]
    ctrl = result.series.ctrl[0]
    found = model.actuator_gainprm[:, 0] * (ctrl - data.qpos[result.ids.qpos_joints])
    assert np.abs(torques).max() > 30.0
    np.testing.assert_allclose(found, torques, atol=2.0)
