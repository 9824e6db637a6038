"""What the tests of the control laws share: the robot, its mirror, short runs."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.paths import robot_description_path
from ballsim.simulation import RunResult, run
from ballsim_controllers.body_pendulum import (
    STATE_SIZE,
    TILT,
    BodyCoupling,
    TrunkResponse,
    body_matrices,
)
from ballsim_controllers.footsteps.preview import AxisModel, CellModel
from ballsim_controllers.messages import Array, BallParameters
from ballsim_controllers.robot import RobotDescription, load_robot_description
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.wheeled_lip import BallPendulumParameters, discretise

CELL = 0.02
LAG = 0.02
POLES = (-6.0, -6.1, -2.0, -2.1)


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
        return np.concatenate(
            (self.vectors(qpos[:3]), attitude, self.joints(qpos[7:]))
        )

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
    coupling, response = BodyCoupling(leg, trunk), TrunkResponse(100.0, 20.0, compliance)
    wanted = [float(np.exp(pole * CELL)) for pole in (*POLES, -1.0 / LAG)]
    cells = []
    for carried_feet in (4.0, 3.0):
        A, B = body_matrices(params, coupling, response, LAG, carried_feet)
        core = discretise(A[:TILT, :TILT], B[:TILT], CELL)
        gain = np.zeros(STATE_SIZE)
        gain[:TILT] = ackermann(core.A, core.B, wanted)
        whole = discretise(A, B, CELL)
        cells.append(CellModel(whole.A, whole.B[:, 0], gain))
    return PlainAxis(params, coupling, response, AxisModel(*cells))


@functools.lru_cache(maxsize=8)
def _axis(radius: float) -> PlainAxis:
    return make_axis(radius)


@functools.lru_cache(maxsize=16)
def _run(scenario: str, overrides: tuple[str, ...]) -> RunResult:
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
def axis() -> Callable[[float], PlainAxis]:
    """Return a function from the ball's radius to one axis with its feedback."""
    return _axis


@pytest.fixture
def simulate() -> Callable[..., RunResult]:
    """Return a function that runs a scenario; equal runs are made only once."""
    return lambda scenario, *overrides: _run(scenario, overrides)
