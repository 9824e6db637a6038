"""What no sensor can tell: by linear algebra, and by simulating both."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ballsim.config_io import load_config
from ballsim.error_model.observability import (
    Unobservable,
    find_unobservable,
    remaining_std,
)
from ballsim.error_model.standing_physics import StandingPhysics, linearise_physics
from ballsim.observability import main
from ballsim_controllers.messages import Array

_N_STEPS = 40


@pytest.fixture(scope="module")
def physics() -> StandingPhysics:
    return linearise_physics(load_config("stand", ["ball.radius_m=0.5"]).config)


@pytest.fixture(scope="module")
def hidden(physics: StandingPhysics) -> Unobservable:
    return find_unobservable(physics)


def _simulate(physics: StandingPhysics, qpos: Array, inputs: Array) -> Array:
    """Return the readings of all channels while a robot moves from rest, (n, m)."""
    data = mujoco.MjData(physics.model)
    data.qpos[:], data.ctrl[:] = qpos, physics.ctrl + inputs
    readings = []
    for _ in range(_N_STEPS):
        mujoco.mj_step(physics.model, data)
        readings.append(data.sensordata[physics.channels].copy())
    return np.array(readings)


def _displace(physics: StandingPhysics, state: Array) -> Array:
    """Return the equilibrium displaced along a state without velocity."""
    displacement, velocity = np.split(state, 2)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-9)
    qpos = physics.qpos.copy()
    mujoco.mj_integratePos(physics.model, qpos, displacement, 1.0)
    return qpos


def _move(physics: StandingPhysics, amounts: Array) -> Array:
    """Return the equilibrium moved: place (2), heading, attitude of the ball (3)."""
    qpos, model = physics.qpos.copy(), physics.model
    heading = Rotation.from_rotvec([0.0, 0.0, amounts[2]])
    for body in ("ball", model.body(1).name):
        start = int(model.jnt_qposadr[model.body(body).jntadr[0]])
        place, attitude = qpos[start : start + 3], qpos[start + 3 : start + 7]
        place[:] = heading.apply(place)
        place[:2] += amounts[:2]
        turned = heading * Rotation.from_quat(attitude, scalar_first=True)
        if body == "ball":
            turned = turned * Rotation.from_rotvec(amounts[3:])
        attitude[:] = turned.as_quat(scalar_first=True)
    return qpos


def test_symmetries_are_place_heading_and_attitude_of_the_ball(
    physics: StandingPhysics, hidden: Unobservable
) -> None:
    """Moved far along all six at once, nothing reads otherwise; they span the rest."""
    rest = np.zeros(len(physics.ctrl))
    moved = _move(physics, np.array([0.8, -0.5, 1.0, 0.4, -0.9, 0.7]))
    assert np.abs(moved - physics.qpos).max() > 0.3
    still = _simulate(physics, physics.qpos, rest)
    np.testing.assert_allclose(_simulate(physics, moved, rest), still, atol=1e-6)
    tangents = np.zeros((6, physics.model.nv))
    for amounts, tangent in zip(1e-6 * np.eye(6), tangents, strict=True):
        mujoco.mj_differentiatePos(
            physics.model, tangent, 1e-6, physics.qpos, _move(physics, amounts)
        )
    k = hidden.n_symmetries
    symmetries = hidden.states[: physics.model.nv, :k]
    assert k == np.linalg.matrix_rank(tangents, tol=1e-3) == 6
    left = tangents.T - symmetries @ (symmetries.T @ tangents.T)
    np.testing.assert_allclose(left, 0.0, atol=1e-6)


@pytest.mark.parametrize("joint", [0, 2, 5, 13])
def test_another_posture_with_its_biases_reads_the_same(
    physics: StandingPhysics, hidden: Unobservable, joint: int
) -> None:
    """To first order, over time; without the biases it does not."""
    size, k = 1e-4, hidden.n_symmetries + joint
    state, inputs = size * hidden.states[:, k], size * hidden.inputs[:, k]
    biases = size * hidden.biases[:, k]
    still = _simulate(physics, physics.qpos, 0.0 * inputs)
    moved = _simulate(physics, _displace(physics, state), inputs)
    change = np.abs(moved - still).max(axis=0)
    left = np.abs(moved + biases - still).max(axis=0)
    assert np.linalg.norm(left) < 0.02 * np.linalg.norm(change)
    encoders = slice(0, len(physics.ctrl))
    assert np.abs(left[encoders]).max() < 0.02 * np.abs(change[encoders]).max()


def test_a_lean_is_seen(physics: StandingPhysics, hidden: Unobservable) -> None:
    """A direction outside: the trunk leans by 1 mrad, and the gyro soon shows it."""
    state, rest = np.zeros(len(physics.A)), np.zeros(len(physics.ctrl))
    start = int(physics.model.jnt_dofadr[physics.model.body(1).jntadr[0]])
    state[start + 4] = 1e-3
    still = _simulate(physics, physics.qpos, rest)
    change = _simulate(physics, _displace(physics, state), rest) - still
    gyro = physics.names.index("gyro x")
    assert np.abs(change[:, gyro : gyro + 3]).max() > 1e-3
    directions = np.linalg.qr(hidden.states)[0]
    assert np.linalg.norm(directions.T @ state) < 0.9 * np.linalg.norm(state)


def test_what_is_left_is_between_nothing_and_all(hidden: Unobservable) -> None:
    """Gyros are found out, encoders of the arms are not, the accelerometer partly."""
    m = len(hidden.biases)
    left = remaining_std(hidden, np.ones(m))
    assert np.all((left >= 0.0) & (left <= 1.0 + 1e-9))
    # Trace of a projector: its rank, one posture for each joint.
    assert np.sum(left**2) == pytest.approx(hidden.inputs.shape[0])
    np.testing.assert_allclose(left[18:21], 0.0, atol=1e-6)  # gyro
    np.testing.assert_allclose(left[-3:], 0.0, atol=1e-6)  # ball's gyro


def test_command_prints_a_row_for_each_channel(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Exit code 0 with `mid`, 2 where there is no bias."""
    assert main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + 39
    assert any(line.startswith("accelerometer x") for line in lines)
    assert main(["--sensors", "ideal"]) == 2
    assert "biases in all sensors" in capsys.readouterr().err
