"""The simulated world: robot, ball and floor in one self-contained MJCF text.

The scene is assembled from the files in ``models`` and returned as text; the
simulated model is compiled from that text and from nothing else, so that the
``scene.xml`` in the folder of a run reproduces the run bit for bit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from ballsim.config import BallConfig
from ballsim.errors import ConfigError
from ballsim.model_error import apply_model_error
from ballsim.paths import find_models_folder
from ballsim_controllers.robot import LegDescription, RobotDescription

__all__ = ["BallConfig", "SceneConfig", "SceneIds", "build_scene", "compile_scene"]

IndexArray = npt.NDArray[np.int32]

BALL = "ball"
FLOOR = "floor"
FLOOR_BALL_PAIR = "floor_ball"

_INTEGRATORS = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}
_CONES = {
    "elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC,
    "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL,
}
_CONDIM_TORSION = 4  # sliding and torsional friction
_CONDIM_ROLLING = 6  # and rolling friction
_FRAMED_HEIGHT = 1.65  # robot in the pictures, [m]


@dataclass(frozen=True, slots=True)
class SceneConfig:
    """Parameters of the scene; the defaults are those of the experiments.

    Attributes:
        ball: The ball.
        sole_friction: Coulomb friction of a sole on whatever it touches.
        floor_friction: Coulomb friction of the ball on the floor.
        torsional_friction: Torsional friction of both contacts, [m].
        rolling_friction: Rolling friction of both contacts, [m]; 0 leaves the
            ball to roll freely.
        timestep: Time of one physics step, [s].
        integrator: ``Euler``, ``implicit``, ``implicitfast`` or ``RK4``.
        cone: Friction cone, ``elliptic`` or ``pyramidal``.
        impratio: Ratio of frictional to normal constraint impedance: more
            than 1 suppresses the slow creep of soft contacts.
        contact_time_constant: Time constant of the critically damped
            contacts, [s]; at least two physics steps (MuJoCo would clip it).
        mass_scale: Factor on all masses and moments of inertia of the robot.
        com_offset: How far the CoM of the whole robot is moved, in the frame of
            the trunk, shape (3,), [m].
    """

    ball: BallConfig = field(default_factory=BallConfig)
    sole_friction: float = 1.0
    floor_friction: float = 1.0
    torsional_friction: float = 0.02
    rolling_friction: float = 0.0
    timestep: float = 0.001
    integrator: str = "implicitfast"
    cone: str = "elliptic"
    impratio: float = 10.0
    contact_time_constant: float = 0.005
    mass_scale: float = 1.0
    com_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the fields."""
        for name in ("sole_friction", "floor_friction"):
            _check_number(f"scene.{name}", getattr(self, name), 0.0, 10.0)
        for name in ("torsional_friction", "rolling_friction"):
            _check_number(f"scene.{name}", getattr(self, name), 0.0, 1.0, "m")
        _check_number("scene.timestep", self.timestep, 1e-5, 0.01, "s")
        _check_number("scene.impratio", self.impratio, 0.01, 1000.0)
        _check_number(
            "scene.contact_time_constant",
            self.contact_time_constant,
            2.0 * self.timestep,
            1.0,
            "s",
        )
        _check_choice("scene.integrator", self.integrator, _INTEGRATORS)
        _check_choice("scene.cone", self.cone, _CONES)


def build_scene(robot: RobotDescription, config: SceneConfig | None = None) -> str:
    """Assemble the scene of robot, ball and floor.

    The robot comes first in ``qpos`` and ``qvel``, the ball last. The state at
    ``mj_resetData`` is not a start: see `ballsim.initial_state`.

    Args:
        robot: Description of the robot.
        config: Parameters of the scene, the defaults if None.

    Returns:
        MJCF text that needs no other file.

    Raises:
        ConfigError: The robot's MJCF does not fit into the scene.
    """
    config = SceneConfig() if config is None else config
    models = find_models_folder()
    files = (models / "scene.xml", robot.mjcf_path.resolve(), models / "ball.xml")
    try:
        stamps = tuple(file.stat().st_mtime_ns for file in files)
        return _build_scene(files, stamps, robot.trunk_body, robot.legs, config)
    except (OSError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        valid = f"an MJCF that fits into the scene ({error})"
        raise ConfigError("robot", str(robot.mjcf_path), valid) from error


@functools.lru_cache(maxsize=16)
def _build_scene(
    files: tuple[Path, ...],
    _stamps: tuple[int, ...],
    trunk: str,
    legs: tuple[LegDescription, LegDescription],
    config: SceneConfig,
) -> str:
    """Assemble a scene; the runs of a study share what has been assembled once.

    Args:
        files: World, robot, ball.
        _stamps: When they were written: a changed file makes another scene.
        trunk: Name of the robot's floating base.
        legs: Names that belong to the legs.
        config: Parameters of the scene.
    """
    spec = mujoco.MjSpec.from_string(_include(files))
    _apply_options(spec, config)
    _apply_ball(spec, config)
    apply_model_error(spec, trunk, config.mass_scale, config.com_offset)
    _apply_contacts(spec, files[1], legs, config)
    spec.compile()
    text: str = spec.to_xml()
    return text


def compile_scene(text: str) -> mujoco.MjModel:
    """Compile the model that is simulated from the text of a scene."""
    return mujoco.MjModel.from_xml_string(text)


@dataclass(frozen=True, slots=True)
class SceneIds:
    """Where everything is in the compiled model: the only home of ids and names.

    Joints, actuators and their sensors are all in actuator order; feet are left
    first. Addresses index ``qpos``, ``qvel`` and ``sensordata``.

    Attributes:
        body_trunk: Floating base of the robot.
        body_ball: The ball.
        body_feet: Bodies of the feet, shape (2,).
        geom_floor: The floor.
        geom_ball: The ball.
        geom_soles: The soles' boxes, shape (2,).
        geoms_robot: All colliding geoms of the robot, soles included.
        site_soles: Sole centres, shape (2,).
        site_wrenches: Origins of the foot sensors, shape (2,).
        joint_names: Actuated joints, n of them.
        joints: Their ids, shape (n,).
        qpos_joints: Their addresses in ``qpos``, shape (n,).
        qvel_joints: Their addresses in ``qvel``, shape (n,).
        qpos_trunk: The base in ``qpos``: position, quaternion (w, x, y, z).
        qvel_trunk: The base in ``qvel``: linear velocity in the world, angular
            velocity in the trunk.
        qpos_ball: The ball in ``qpos``, as the base.
        qvel_ball: The ball in ``qvel``, as the base.
        sensor_gyro: Gyro on the trunk.
        sensor_accelerometer: Accelerometer on the trunk.
        sensor_forces: Forces at the ankles; the force that the shank exerts on
            the foot, in the sensor frame.
        sensor_torques: Torques at the ankles, likewise.
        sensor_gyro_ball: Gyro in the ball, in the ball's frame.
        sensor_joints: Encoders, shape (n,).
    """

    body_trunk: int
    body_ball: int
    body_feet: IndexArray
    geom_floor: int
    geom_ball: int
    geom_soles: IndexArray
    geoms_robot: IndexArray
    site_soles: IndexArray
    site_wrenches: IndexArray
    joint_names: tuple[str, ...]
    joints: IndexArray
    qpos_joints: IndexArray
    qvel_joints: IndexArray
    qpos_trunk: slice
    qvel_trunk: slice
    qpos_ball: slice
    qvel_ball: slice
    sensor_gyro: slice
    sensor_accelerometer: slice
    sensor_forces: tuple[slice, slice]
    sensor_torques: tuple[slice, slice]
    sensor_gyro_ball: slice
    sensor_joints: IndexArray

    @classmethod
    def from_model(cls, model: mujoco.MjModel, robot: RobotDescription) -> SceneIds:
        """Look everything up in a compiled scene.

        Args:
            model: Model compiled from the text of `build_scene`.
            robot: Description of the robot in it.

        Raises:
            ConfigError: The model lacks something that the scene needs.
        """

        def find(kind: str, name: str) -> Any:
            try:
                return getattr(model, kind)(name)
            except KeyError:
                file = robot.mjcf_path
                raise ConfigError(
                    f"robot.{kind}",
                    name,
                    f"the scene must have a {kind} so named",
                    file,
                ) from None

        def ids(kind: str, names: Iterable[str]) -> IndexArray:
            return _freeze(find(kind, name).id for name in names)

        def sensor(name: str) -> slice:
            entry = find("sensor", name)
            return slice(int(entry.adr[0]), int(entry.adr[0] + entry.dim[0]))

        def free_joint(body: str) -> tuple[slice, slice]:
            adr = int(model.body_jntadr[find("body", body).id])
            if adr < 0 or model.jnt_type[adr] != mujoco.mjtJoint.mjJNT_FREE:
                valid = "a body with a free joint"
                raise ConfigError("robot.trunk_body", body, valid, robot.mjcf_path)
            q, v = int(model.jnt_qposadr[adr]), int(model.jnt_dofadr[adr])
            return slice(q, q + 7), slice(v, v + 6)

        joints = _freeze(model.actuator_trnid[:, 0])
        names = tuple(model.joint(int(i)).name for i in joints)
        trunk = find("body", robot.trunk_body).id
        qpos_trunk, qvel_trunk = free_joint(robot.trunk_body)
        qpos_ball, qvel_ball = free_joint(BALL)
        root = model.body_rootid[model.geom_bodyid]
        is_colliding = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        soles = [leg.sole_site for leg in robot.legs]
        left, right = robot.left_leg.foot_body, robot.right_leg.foot_body
        return cls(
            body_trunk=trunk,
            body_ball=find("body", BALL).id,
            body_feet=ids("body", [left, right]),
            geom_floor=find("geom", FLOOR).id,
            geom_ball=find("geom", BALL).id,
            geom_soles=ids("geom", soles),
            geoms_robot=_freeze(np.flatnonzero((root == trunk) & is_colliding)),
            site_soles=ids("site", soles),
            site_wrenches=ids("site", [leg.wrench_site for leg in robot.legs]),
            joint_names=names,
            joints=joints,
            qpos_joints=_freeze(model.jnt_qposadr[joints]),
            qvel_joints=_freeze(model.jnt_dofadr[joints]),
            qpos_trunk=qpos_trunk,
            qvel_trunk=qvel_trunk,
            qpos_ball=qpos_ball,
            qvel_ball=qvel_ball,
            sensor_gyro=sensor("gyro_trunk"),
            sensor_accelerometer=sensor("accelerometer_trunk"),
            sensor_forces=(sensor(f"force_{left}"), sensor(f"force_{right}")),
            sensor_torques=(sensor(f"torque_{left}"), sensor(f"torque_{right}")),
            sensor_gyro_ball=sensor("gyro_ball"),
            sensor_joints=_freeze(sensor(f"position_{name}").start for name in names),
        )


def _include(files: Iterable[Path]) -> str:
    """Return an MJCF that merges the files.

    Includes are used rather than ``MjSpec.attach`` because an attachment
    without a prefix warns that it may not be saved correctly.
    """
    lines = "".join(f'<include file="{file.as_posix()}"/>' for file in files)
    return f'<mujoco model="ballsim">{lines}</mujoco>'


def _apply_options(spec: Any, config: SceneConfig) -> None:
    spec.option.timestep = config.timestep
    spec.option.integrator = _INTEGRATORS[config.integrator]
    spec.option.cone = _CONES[config.cone]
    spec.option.impratio = config.impratio


def _apply_ball(spec: Any, config: SceneConfig) -> None:
    radius = config.ball.radius
    body, geom = spec.body(BALL), spec.geom(BALL)
    body.pos = [0.0, 0.0, radius]
    body.mass = config.ball.mass
    body.inertia = [config.ball.moment_of_inertia] * 3
    geom.size = [radius, 0.0, 0.0]
    # The cameras of the ball are placed for a radius of 0.5 m: step back until the
    # ball's diameter and the robot fill the picture as they do there.
    scale = (2.0 * radius + _FRAMED_HEIGHT) / (1.0 + _FRAMED_HEIGHT)
    for camera in body.cameras:
        x, y, z = camera.pos
        camera.pos = [scale * x, scale * y, z]


def _apply_contacts(
    spec: Any,
    mjcf_path: Path,
    legs: tuple[LegDescription, LegDescription],
    config: SceneConfig,
) -> None:
    condim = _CONDIM_ROLLING if config.rolling_friction > 0.0 else _CONDIM_TORSION
    torsion, rolling = config.torsional_friction, config.rolling_friction
    solref = [config.contact_time_constant, 1.0]
    for geom in spec.geoms:
        if geom.contype or geom.conaffinity:
            geom.solref = solref
    for leg in legs:
        # A sole's priority is 1, so that its own friction holds on the ball too.
        sole = spec.geom(leg.sole_site)
        if sole is None:
            valid = "the sole's box must bear the name of the sole's site"
            raise ConfigError("robot.sole_site", leg.sole_site, valid, mjcf_path)
        sole.friction = [config.sole_friction, torsion, rolling]
        sole.condim = condim
    pair = next(pair for pair in spec.pairs if pair.name == FLOOR_BALL_PAIR)
    sliding = config.floor_friction
    pair.friction = [sliding, sliding, torsion, rolling, rolling]
    pair.condim = condim
    pair.solref = solref


def _freeze(values: Iterable[Any]) -> IndexArray:
    array = np.fromiter((int(value) for value in values), dtype=np.int32)
    array.setflags(write=False)
    return array


def _check_number(
    key: str, value: object, low: float, high: float, unit: str = ""
) -> None:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if is_number and math.isfinite(value) and low <= value <= high:  # type: ignore[arg-type,operator]
        return
    suffix = f" [{unit}]" if unit else ""
    raise ConfigError(key, value, f"a number from {low:g} to {high:g}{suffix}")


def _check_choice(key: str, value: str, options: Mapping[str, Any]) -> None:
    if value not in options:
        raise ConfigError(key, value, f"one of {', '.join(options)}")
