"""Everything that a run needs, built and checked before anything is written."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field

import mujoco
import numpy as np

from ballsim.command_schedule import CommandSchedule
from ballsim.config import Config, ControllerConfig, InitialConfig
from ballsim.controller_registry import find_controller_factory
from ballsim.errors import ConfigError
from ballsim.faults import FaultInjector
from ballsim.initial_state import compute_initial_state
from ballsim.noise import make_generator
from ballsim.paths import robot_description_path
from ballsim.plant import Plant
from ballsim.pushes import PushSchedule, draw_push_times
from ballsim.scene import SceneConfig, SceneIds, build_scene, compile_scene
from ballsim.sensor_sheet import find_sensor_figures
from ballsim.sensors import SensorSuite
from ballsim.world_frame import RobotWorld
from ballsim_controllers.errors import InvalidSettingError, UnknownControllerError
from ballsim_controllers.messages import (
    Array,
    BallParameters,
    Controller,
    ControllerSetup,
)
from ballsim_controllers.robot import RobotDescription, load_robot_description

__all__ = [
    "InitialPerturbation",
    "PreparedRun",
    "draw_perturbation",
    "make_controller_setup",
    "prepare",
]

_INITIAL_STREAM = 1000  # stream of random numbers, far from those of the sensors


@dataclass(frozen=True, slots=True)
class InitialPerturbation:
    """How far a run starts from the nominal stance.

    Attributes:
        lean: Pitch (forwards) and roll (to the right) of the robot, [rad].
        ball_offset: Displacement of the ball forwards and to the left, [m].
        yaw: Heading of the robot in the true world, [rad].
    """

    lean: tuple[float, float]
    ball_offset: tuple[float, float]
    yaw: float


@dataclass(frozen=True, slots=True)
class PreparedRun:
    """A run that is ready to start.

    Attributes:
        config: The configuration, with the controller's defaults if it tells them.
        robot: Description of the robot.
        scene_xml: The scene as MJCF text.
        plant: The simulated world.
        ids: Ids of the scene.
        sensors: The sensors.
        controller: The controller.
        world: The robot's world in the true one.
        commands: What the operator asks for.
        pushes: Who pushes; the schedule is empty if nobody does.
    """

    config: Config
    robot: RobotDescription
    scene_xml: str = field(repr=False)  # long
    plant: Plant
    ids: SceneIds
    sensors: SensorSuite
    controller: Controller
    world: RobotWorld
    commands: CommandSchedule
    pushes: PushSchedule


def draw_perturbation(config: InitialConfig, seed: int) -> InitialPerturbation:
    """Draw the start of a run: direction and size of each part, uniformly.

    Args:
        config: Greatest sizes.
        seed: Seed of the run.
    """
    generator = make_generator(seed, _INITIAL_STREAM)
    lean_direction, offset_direction = generator.uniform(0.0, 2.0 * math.pi, 2).tolist()
    lean_size, offset_size = generator.uniform(0.0, 1.0, 2).tolist()
    lean, offset = config.max_lean * lean_size, config.max_ball_offset * offset_size
    return InitialPerturbation(
        lean=(lean * math.cos(lean_direction), lean * math.sin(lean_direction)),
        ball_offset=(
            offset * math.cos(offset_direction),
            offset * math.sin(offset_direction),
        ),
        yaw=config.max_yaw * float(generator.uniform(-1.0, 1.0)),
    )


def prepare(config: Config, controller: Controller | None = None) -> PreparedRun:
    """Build everything that a run needs.

    Args:
        config: The configuration.
        controller: Controller to use instead of the configured one, for tests.

    Returns:
        The run, ready to start. It can be run once.

    Raises:
        ConfigError: A value does not fit together with the others.
    """
    try:
        robot = load_robot_description(robot_description_path(config.robot.name))
    except InvalidSettingError as error:
        raise ConfigError(error.key, error.value, error.valid) from error
    period = config.simulation.control_period
    pushed = draw_push_times(config.pushes, config.seed, period)
    config = dataclasses.replace(config, pushes=pushed)
    ball = BallParameters(
        config.ball.radius, config.ball.mass, config.ball.moment_of_inertia
    )
    scene_xml = build_scene(robot, _scene_config(config))
    model = compile_scene(scene_xml)
    ids = SceneIds.from_model(model, robot)
    qpos, qvel = _initial_state(config, model, ids, robot, ball)
    world = RobotWorld.from_start(qpos, ids)
    faults = None
    if config.faults:
        joints = [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]]
        faults = FaultInjector(config.faults, joints, period)
    if controller is None:
        controller = _build_controller(config, robot)
        settings = getattr(controller, "settings_table", None)
        if settings is not None:  # write the defaults out
            table = ControllerConfig(config.controller.name, settings)
            config = dataclasses.replace(config, controller=table)
    sensors = SensorSuite(ids, config.sensors, period, config.seed, faults)
    zeros = sensors.encoder_zeros
    return PreparedRun(
        config=config,
        robot=robot,
        scene_xml=scene_xml,
        plant=Plant(model, qpos, qvel, config.n_substeps, config.n_late_steps, zeros),
        ids=ids,
        sensors=sensors,
        controller=controller,
        world=world,
        commands=CommandSchedule(config),
        pushes=PushSchedule(model, ids, world, config.pushes, period),
    )


def _scene_config(config: Config) -> SceneConfig:
    table = {
        field.name: getattr(config.scene, field.name)
        for field in dataclasses.fields(config.scene)
    }
    robot = config.robot
    offset = (robot.com_offset_x, robot.com_offset_y, robot.com_offset_z)
    return SceneConfig(
        ball=config.ball, mass_scale=robot.mass_scale, com_offset=offset, **table
    )


def _initial_state(
    config: Config,
    model: mujoco.MjModel,
    ids: SceneIds,
    robot: RobotDescription,
    ball: BallParameters,
) -> tuple[Array, Array]:
    start = draw_perturbation(config.initial, config.seed)
    qpos, qvel = compute_initial_state(
        model,
        ids,
        robot,
        ball,
        lean=start.lean,
        ball_offset=start.ball_offset,
        yaw=start.yaw,
    )
    # The ball's frame equals the robot's world at the start, see messages.py.
    half = start.yaw / 2.0
    attitude = slice(ids.qpos_ball.start + 3, ids.qpos_ball.stop)
    qpos = np.array(qpos)
    qpos[attitude] = [math.cos(half), 0.0, 0.0, math.sin(half)]
    return qpos, np.array(qvel)


def make_controller_setup(config: Config, robot: RobotDescription) -> ControllerSetup:
    """Return what the controller is told, which need not be the truth.

    Args:
        config: The configuration.
        robot: Description of the robot.
    """
    ball = config.ball
    return ControllerSetup(
        robot=robot,
        ball=BallParameters(
            ball.believed_radius_scale * ball.radius,
            ball.believed_mass_scale * ball.mass,
            ball.believed_inertia_scale * ball.moment_of_inertia,
        ),
        control_period=config.simulation.control_period,
        settings=config.controller.settings,
        sensors=find_sensor_figures(config.sensors, config.simulation.control_period),
    )


def _build_controller(config: Config, robot: RobotDescription) -> Controller:
    name = config.controller.name
    try:
        factory = find_controller_factory(name)
    except UnknownControllerError as error:
        valid = f"one of {', '.join(error.available)}"
        raise ConfigError("controller.name", name, valid) from None
    try:
        return factory(make_controller_setup(config, robot))
    except InvalidSettingError as error:
        # A controller may name its own key in full or from its own table on.
        key = f"controller.{error.key.removeprefix('controller.')}"
        raise ConfigError(key, error.value, error.valid) from error
