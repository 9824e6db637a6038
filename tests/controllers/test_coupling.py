"""Laws of the angular momentum that legs and trunk take."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
import pytest

from ballsim_controllers.body_pendulum import compute_coupling
from ballsim_controllers.geometry import rotation_vector_between
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

if TYPE_CHECKING:
    from tests.controllers.conftest import Mirror

RADII = (0.25, 0.5, 0.75, 1.0)
AXES = ((0, 1, -1.0), (1, 0, 1.0))  # axis, about, sign of a tilt against the axis


def body_poses(robot: RobotModel, qpos: Array) -> tuple[Array, Array]:
    """Return places and attitudes of the bodies' centres of mass."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(robot.model, data)
    return data.xipos[1:].copy(), data.ximat[1:].reshape(-1, 3, 3).copy()


def angular_momentum(
    robot: RobotModel, qpos: Array, qvel: Array
) -> tuple[Array, Array]:
    """Return angular momentum about the CoM and the CoM's velocity.

    Sums masses times central differences of places and attitudes: no velocity
    routine of MuJoCo takes part.
    """
    model, step = robot.model, 1e-6
    poses = []
    for time in (step, -step, 0.0):
        moved = qpos.copy()
        mujoco.mj_integratePos(model, moved, qvel, time)
        poses.append(body_poses(robot, moved))
    (ahead, turned_ahead), (behind, turned_behind), (place, attitude) = poses
    masses = model.body_mass[1:]
    velocities = (ahead - behind) / (2.0 * step)
    com = masses @ place / masses.sum()
    com_velocity: Array = masses @ velocities / masses.sum()
    result = np.cross(place - com, masses[:, None] * (velocities - com_velocity)).sum(
        axis=0
    )
    for i, inertia in enumerate(model.body_inertia[1:]):
        turn = rotation_vector_between(turned_behind[i], turned_ahead[i]) / (2.0 * step)
        result += attitude[i] @ (inertia * (attitude[i].T @ turn))
    return result, com_velocity


def leg_motion(robot: RobotModel, base: Array, feet: Array) -> Array:
    """Return the velocity of the robot for given motions of base and soles."""
    velocity = np.zeros(robot.model.nv)
    velocity[:6] = base
    for i, leg in enumerate(robot.leg_dofs):
        jacobian = robot.point_jacobian(i, robot.feet[i].position)
        rest = feet[i] - jacobian[:, :6] @ base
        velocity[leg] = np.linalg.solve(jacobian[:, leg], rest)
    return velocity


@pytest.mark.parametrize("radius", RADII)
def test_coupling_is_the_angular_momentum(robot: RobotModel, radius: float) -> None:
    """L of any motion of base, soles and trunk is legs' part plus trunk's part.

    The couplings are found from two motions; here a third one is composed of
    both, and its angular momentum comes from central differences.
    """
    stance = solve_nominal_stance(robot, radius)
    couplings = compute_coupling(robot, stance.qpos, stance.com_height)
    scale = robot.mass * stance.com_height
    robot.update(stance.qpos, np.zeros(robot.model.nv))
    for coupling, (axis, about, sign) in zip(couplings, AXES, strict=True):
        feet, base = np.zeros((2, 6)), np.zeros(6)
        feet[:, axis] = 0.3
        base[axis], base[3 + about] = -0.2, sign * 0.5
        motion = leg_motion(robot, base, feet)
        momentum, com_velocity = angular_momentum(robot, stance.qpos, motion)
        legs = coupling.leg * (feet[:, axis] - com_velocity[axis]).sum()
        expected = legs + coupling.trunk * 0.5
        assert sign * momentum[about] / scale == pytest.approx(expected, rel=1e-5)
        assert coupling.leg > 0.01
        assert coupling.trunk > 0.01


def test_coupling_does_not_depend_on_place_or_mirror(
    robot: RobotModel, mirror: Mirror
) -> None:
    """Moving the pose or reflecting it leaves both couplings as they are."""
    stance = solve_nominal_stance(robot, 0.5)
    expected = compute_coupling(robot, stance.qpos, stance.com_height)
    moved = stance.qpos.copy()
    moved[:3] += (1.0, -2.0, 3.0)
    for qpos in (moved, mirror.qpos(stance.qpos)):
        found = compute_coupling(robot, qpos, stance.com_height)
        for a, b in zip(found, expected, strict=True):
            assert a.leg == pytest.approx(b.leg, rel=1e-9)
            assert a.trunk == pytest.approx(b.trunk, rel=1e-9)
            assert a.lift == pytest.approx(b.lift, rel=1e-9, abs=1e-12)


def test_lifting_a_foot_takes_angular_momentum(robot: RobotModel) -> None:
    """A foot that goes up takes momentum as one that goes forwards; sideways none.

    What one leg takes across the heading the other one, its mirror image, gives back.
    """
    stance = solve_nominal_stance(robot, 0.5)
    sagittal, lateral = compute_coupling(robot, stance.qpos, stance.com_height)
    assert abs(lateral.lift) < 1e-9
    scale = robot.mass * stance.com_height
    robot.update(stance.qpos, np.zeros(robot.model.nv))
    for foot in range(2):
        feet, up = np.zeros((2, 6)), 0.4
        feet[foot, 2] = up
        motion = leg_motion(robot, np.zeros(6), feet)
        momentum, com = angular_momentum(robot, stance.qpos, motion)
        # Both feet move against the CoM.
        expected = sagittal.lift * (up - 2.0 * com[2]) - sagittal.leg * 2.0 * com[0]
        assert -momentum[1] / scale == pytest.approx(expected, rel=1e-5)
    assert 0.2 < sagittal.lift / sagittal.leg < 2.0
