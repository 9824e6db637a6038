"""Robot, ball and sensors about the standing equilibrium, to first order."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import mujoco
import numpy as np

from ballsim.config import Config, InitialConfig
from ballsim.preparation import prepare
from ballsim_controllers.messages import Array, IntArray

__all__ = ["StandingPhysics", "linearise_physics"]

_STEP = 1e-6  # of the finite differences, in SI units


@dataclass(frozen=True, slots=True)
class StandingPhysics:
    """The scene, linear about the robot that stands at rest on top of the ball.

    The state holds the displacement of all degrees of freedom, then their velocities,
    in MuJoCo's order; the inputs are the set-points of the drives.

    Attributes:
        model: The scene.
        qpos: The equilibrium, shape (nq,).
        ctrl: Set-points that hold it, shape (nu,), [rad].
        A: From state to state over a physics step, shape (2 nv, 2 nv).
        B: From inputs to state, shape (2 nv, nu).
        C: From state to the channels of all sensors, shape (m, 2 nv).
        D: From inputs to them, shape (m, nu).
        channels: Where they are in ``sensordata``, in the order of `SENSORS`, (m,).
        names: What they are called, m of them.
    """

    model: mujoco.MjModel
    qpos: Array
    ctrl: Array
    A: Array
    B: Array
    C: Array
    D: Array
    channels: IntArray
    names: tuple[str, ...]


def linearise_physics(config: Config) -> StandingPhysics:
    """Return the first order of a run's physics and sensors at rest.

    Args:
        config: The run; how it starts does not matter.

    Raises:
        ConfigError: The robot cannot stand on this ball.
    """
    upright = InitialConfig(max_lean=0.0, max_ball_offset=0.0, max_yaw=0.0)
    prepared = prepare(dataclasses.replace(config, initial=upright))
    model, ids = prepared.plant.model, prepared.ids
    data = mujoco.MjData(model)
    data.qpos[:] = prepared.plant.data.qpos
    mujoco.mj_inverse(model, data)
    torques = data.qfrc_inverse[ids.qvel_joints]
    stiffness = model.actuator_gainprm[:, 0]
    data.ctrl[:] = data.qpos[ids.qpos_joints] + torques / stiffness
    mujoco.mj_forward(model, data)
    n, n_inputs, n_sensors = 2 * model.nv, model.nu, model.nsensordata
    A, B = np.zeros((n, n)), np.zeros((n, n_inputs))
    C, D = np.zeros((n_sensors, n)), np.zeros((n_sensors, n_inputs))
    mujoco.mjd_transitionFD(model, data, _STEP, True, A, B, C, D)
    channels, names = [], []
    for joint, channel in zip(ids.joint_names, ids.sensor_joints, strict=True):
        channels.append(int(channel))
        names.append(f"encoder {joint}")
    triads = (
        ("gyro", ids.sensor_gyro),
        ("accelerometer", ids.sensor_accelerometer),
        ("foot_force left", ids.sensor_forces[0]),
        ("foot_force right", ids.sensor_forces[1]),
        ("foot_torque left", ids.sensor_torques[0]),
        ("foot_torque right", ids.sensor_torques[1]),
        ("ball_gyro", ids.sensor_gyro_ball),
    )
    for name, section in triads:
        channels.extend(range(section.start, section.stop))
        names.extend(f"{name} {axis}" for axis in "xyz")
    order = np.array(channels)
    return StandingPhysics(
        model=model,
        qpos=np.array(data.qpos),
        ctrl=np.array(data.ctrl),
        A=A,
        B=B,
        C=C[order],
        D=D[order],
        channels=order,
        names=tuple(names),
    )
