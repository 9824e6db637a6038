"""What the tests of the control laws share: the robot, its mirror, short runs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.paths import robot_description_path
from ballsim.simulation import KeptRun, run
from ballsim_controllers.body_pendulum import (
    STATE_SIZE,
    TILT,
    BodyCoupling,
    TrunkResponse,
    body_matrices,
    capture_point,
)
from ballsim_controllers.footsteps.axis_model import AxisModel, CellModel
from ballsim_controllers.messages import (
    Array,
    BallParameters,
    Command,
    ControllerSetup,
    SensorReading,
)
from ballsim_controllers.pipeline import WheeledLipController, create_wheeled_lip
from ballsim_controllers.robot import RobotDescription, load_robot_description
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.wheeled_lip import BallPendulumParameters, discretise
from ballsim_controllers.whole_body.accelerations import (
    WholeBodyAccelerations,
)
from ballsim_controllers.whole_body.forces import (
    ContactForces,
    ForceDistribution,
    ForceLimits,
)
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

SOLE = np.array([0.085, 0.035])
TORSION = 0.012
CELL = 0.02
LAG = 0.02
POLES = (-6.0, -6.1, -2.0, -2.1)
#: Steps almost from the start, off the nominal stance.
STEPPING = (
    "duration_s=1",
    "seed=3",
    "command.timeline.0.time_s=0.1",
    "controller.gait.start_patience_s=0.0",
)


class Mirror:
    """Reflection of everything in the robot's sagittal plane (y -> -y)."""

    def __init__(self, joint_names: tuple[str, ...]) -> None:
        """Pair the joints: yaw and roll change their sign."""
        other = {"left": "right", "right": "left"}
        pairs = [name.split("_", 1) for name in joint_names]
        self._order = [
            joint_names.index(f"{other[side]}_{part}") for side, part in pairs
        ]
        self._signs = np.array(
            [-1.0 if part.endswith(("yaw", "roll")) else 1.0 for _, part in pairs]
        )

    def joints(self, values: Array) -> Array:
        """Mirror angles, velocities or torques of the joints."""
        return values[..., self._order] * self._signs

    @staticmethod
    def vectors(values: Array) -> Array:
        """Mirror points, velocities, forces, shape (..., 3) or (..., 2)."""
        return values * np.array([1.0, -1.0, 1.0])[: values.shape[-1]]

    @staticmethod
    def axials(values: Array) -> Array:
        """Mirror angular velocities and torques, shape (..., 3)."""
        return values * np.array([-1.0, 1.0, -1.0])

    def qpos(self, qpos: Array) -> Array:
        """Mirror a configuration of the robot alone."""
        attitude = qpos[3:7] * np.array([1.0, -1.0, 1.0, -1.0])
        return np.concatenate((self.vectors(qpos[:3]), attitude, self.joints(qpos[7:])))

    def qvel(self, qvel: Array) -> Array:
        """Mirror a velocity of the robot alone."""
        return np.concatenate(
            (self.vectors(qvel[:3]), self.axials(qvel[3:6]), self.joints(qvel[6:]))
        )


@dataclass(frozen=True)
class PlainAxis:
    """One axis of a robot of 65 kg on the paper's ball, with its feedback."""

    params: BallPendulumParameters
    coupling: BodyCoupling
    trunk: TrunkResponse
    model: AxisModel


def ackermann(A: Array, B: Array, poles: list[float]) -> Array:
    """Return the gain that places real poles, by Ackermann's formula."""
    n = len(A)
    columns = [B[:, 0]]
    for _ in range(n - 1):
        columns.append(A @ columns[-1])
    polynomial = np.eye(n)
    for pole in poles:
        polynomial = polynomial @ (A - pole * np.eye(n))
    last_row = np.linalg.solve(np.column_stack(columns).T, np.eye(n)[-1])
    gain: Array = last_row @ polynomial
    return gain


def make_axis(
    radius: float = 0.5,
    leg: float = 0.058,
    trunk: float = 0.046,
    compliance: float = 300.0,
    height: float = 0.874,
) -> PlainAxis:
    """Return an axis as the controller builds it, from given coupling."""
    ball = BallParameters(radius, 40.0, 0.5)
    params = BallPendulumParameters(ball, 65.0, height, 9.81)
    coupling, response = (
        BodyCoupling(leg, trunk),
        TrunkResponse(100.0, 20.0, compliance),
    )
    wanted = [float(np.exp(pole * CELL)) for pole in (*POLES, -1.0 / LAG)]
    cells = []
    A, B = body_matrices(params, coupling, response, LAG, 4.0)
    capture = capture_point(A, B[:, 0])
    for carried_feet in (4.0, 3.0):
        A, B = body_matrices(params, coupling, response, LAG, carried_feet)
        core = discretise(A[:TILT, :TILT], B[:TILT, :1], CELL)
        gain = np.zeros(STATE_SIZE)
        gain[:TILT] = ackermann(core.A, core.B, wanted)
        whole = discretise(A, B, CELL)
        cells.append(CellModel(whole.A, whole.B[:, 0], whole.B[:, 1], gain))
    return PlainAxis(params, coupling, response, AxisModel(*cells, CELL, capture))


def make_limits(compliance: float = 300.0, **changes: float) -> ForceLimits:
    """Return limits with one compliance for both axes."""
    plain = ForceLimits(
        *SOLE,
        torsion_arm=TORSION,
        pitch_compliance=compliance,
        roll_compliance=compliance,
    )
    return replace(plain, **changes)


@dataclass
class Situation:
    """A state of the robot and what the force distribution is asked for."""

    robot: RobotModel
    qpos: Array
    qvel: Array
    wanted: WholeBodyAccelerations
    touching: Array
    contacts: Array
    shares: Array
    twist: float = 0.0
    squeeze: float = 0.0

    def solve(self, compliance: float = 300.0, **changes: float) -> ContactForces:
        """Return the distribution for this situation, the robot model left in it."""
        self.robot.update(self.qpos, self.qvel)
        self.robot.update_dynamics()
        forces = ForceDistribution(self.robot, make_limits(compliance, **changes))
        return forces.solve(
            self.wanted,
            self.touching,
            self.contacts,
            self.shares,
            self.twist,
            self.squeeze,
        )


def make_situation(
    robot: RobotModel,
    seed: int,
    support: tuple[bool, bool] = (True, True),
    yaw: float = 0.0,
    is_level: bool = False,
) -> Situation:
    """Return a situation in the midst of a wild motion, both feet on a ball.

    Args:
        robot: The robot.
        seed: Seed of everything random.
        support: Which feet stand.
        yaw: Wanted yaw acceleration of the trunk, [rad/s^2].
        is_level: True to keep both contacts at one height.
    """
    generator = np.random.default_rng(seed)
    qpos = solve_nominal_stance(robot, 0.5).qpos.copy()
    if not is_level:
        qpos[7:] += generator.normal(scale=0.03, size=robot.joint_count)
    turn = 0.1 * generator.normal(size=3)
    half = 0.5 * np.linalg.norm(turn)
    attitude = np.append(np.cos(half), np.sinc(half / np.pi) * 0.5 * turn)
    if not is_level:
        qpos[3:7] = attitude
    qvel = generator.normal(scale=0.3, size=robot.model.nv)
    robot.update(qpos, qvel)
    robot.update_dynamics()
    soles = np.array([foot.position for foot in robot.feet])
    weights = np.array(support, dtype=float) / sum(support)
    cop = weights @ soles[:, :2] + generator.uniform(-0.02, 0.02, 2)
    contacts, shares = ForceDistribution(robot, make_limits()).place_contacts(
        cop, support, (0.3, 0.6)
    )
    if is_level:
        contacts[:, 2] = contacts[0, 2]
    touching = soles.copy()
    for i, foot in enumerate(robot.feet):
        if support[i]:
            offset = generator.uniform(-1.0, 1.0, 2) * SOLE
            touching[i] += foot.rotation[:, :2] @ offset
    vertical = float(generator.normal())
    lever = robot.position_com_in_world - shares @ contacts
    push = robot.mass * (robot.gravity + vertical) * lever[:2] / lever[2]
    trunk = generator.normal(scale=3.0, size=3)
    trunk[2] = yaw
    wanted = WholeBodyAccelerations(
        trunk_angular=trunk,
        com_vertical=vertical,
        horizontal_force=push,
        soles=generator.normal(size=(2, 6)) * [2.0, 2.0, 2.0, 5.0, 5.0, 5.0],
        upper_joints=generator.normal(scale=3.0, size=len(robot.upper_dofs)),
    )
    return Situation(robot, qpos, qvel, wanted, touching, contacts, shares)


@dataclass(frozen=True)
class RecordedRun:
    """A run of ``wheeled-lip`` whose readings another controller can be fed."""

    result: KeptRun

    def make_controller(
        self, settings: dict[str, Any] | None = None
    ) -> WheeledLipController:
        """Return a new controller for the robot and the ball of the run."""
        config = self.result.config
        ball = config.ball
        parameters = BallParameters(ball.radius, ball.mass, ball.moment_of_inertia)
        period = config.simulation.control_period
        return create_wheeled_lip(
            ControllerSetup(self.result.robot, parameters, period, settings or {})
        )

    def readings(self) -> Iterator[SensorReading]:
        """Yield the readings of the run, each in arrays of its own."""
        series = self.result.series
        for tick in range(series.n_ticks):
            yield SensorReading(series.readings.rows[tick : tick + 1].copy())


class SteppingRun(RecordedRun):
    """The run of `STEPPING`."""

    @property
    def settings(self) -> dict[str, Any]:
        """Return the settings of the run's controller."""
        return {"gait": {"start_patience_s": 0.0}}

    @staticmethod
    def command(time: float) -> Command:
        """Return the command that the run's controller had."""
        return Command(is_stepping=time > 0.1 - 1e-9)


@functools.lru_cache(maxsize=8)
def _axis(radius: float, **changes: float) -> PlainAxis:
    return make_axis(radius, **changes)


@functools.lru_cache(maxsize=16)
def _run(scenario: str, overrides: tuple[str, ...]) -> KeptRun:
    return run(load_config(scenario, overrides).config)


@pytest.fixture(scope="session")
def description() -> RobotDescription:
    """Return the description of the shipped biped."""
    return load_robot_description(robot_description_path("biped"))


@pytest.fixture
def robot(description: RobotDescription) -> RobotModel:
    """Return a fresh model of the robot."""
    return RobotModel(description)


@pytest.fixture
def mirror(robot: RobotModel) -> Mirror:
    """Return the reflection that maps the biped on itself."""
    return Mirror(robot.joint_names)


@pytest.fixture
def situate(robot: RobotModel) -> Callable[..., Situation]:
    """Return a function from a seed (and more) to a situation of the robot."""
    return functools.partial(make_situation, robot)


@pytest.fixture
def axis() -> Callable[[float], PlainAxis]:
    """Return a function from the ball's radius to one axis with its feedback."""
    return _axis


@pytest.fixture
def simulate() -> Callable[..., KeptRun]:
    """Return a function that runs a scenario; equal runs are made only once."""
    return lambda scenario, *overrides: _run(scenario, overrides)


@pytest.fixture
def stepping() -> SteppingRun:
    """Return a second of stepping."""
    return SteppingRun(_run("step", STEPPING))


@pytest.fixture
def standing() -> RecordedRun:
    """Return two seconds of standing."""
    return RecordedRun(_run("stand", ("duration_s=2", "seed=3", "ball.radius_m=0.5")))
