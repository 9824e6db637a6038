"""Laws of the force distribution: Newton and Euler, CoP, limits, mirror."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import pytest
from tests.controllers.force_balance import (
    contact_wrench,
    equation_residual,
    full_acceleration,
)

from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.accelerations import (
    WholeBodyAccelerations,
)
from ballsim_controllers.whole_body.forces import (
    ContactForces,
    ForceLimits,
)

if TYPE_CHECKING:
    from tests.controllers.conftest import Mirror, Situation

Situate = Callable[..., "Situation"]
SUPPORTS = ((True, True), (True, False), (False, True))
HALF = np.array([0.085, 0.035])
TORSION = 0.012


# -- (a) Newton and Euler --------------------------------------------------------


@pytest.mark.parametrize("support", SUPPORTS)
@pytest.mark.parametrize("seed", range(5))
def test_equations_of_motion_hold(
    robot: RobotModel, situate: Situate, seed: int, support: tuple[bool, bool]
) -> None:
    """M qacc + h = S' tau + J' f on all rows, the six of the base included."""
    situation = situate(seed, support)
    result = situation.solve()
    residual, twist = equation_residual(robot, situation, result)
    np.testing.assert_allclose(residual, 0.0, atol=1e-8)
    assert abs(twist) <= TORSION * result.forces[:, 2].sum() + 1e-9


@pytest.mark.parametrize("support", SUPPORTS)
def test_forward_dynamics_gives_the_accelerations(
    robot: RobotModel, situate: Situate, support: tuple[bool, bool]
) -> None:
    """MuJoCo, given torques and contact forces, moves as was promised.

    The second route: a fresh simulation without drives, damping and stops.
    """
    situation = situate(3, support)
    result = situation.solve()
    qacc = full_acceleration(robot, result)
    _, twist = equation_residual(robot, situation, result)
    model = mujoco.MjModel.from_xml_path(str(robot.robot.mjcf_path))
    bits = mujoco.mjtDisableBit
    model.opt.disableflags |= bits.mjDSBL_ACTUATION | bits.mjDSBL_CONSTRAINT
    model.dof_damping[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = situation.qpos, situation.qvel
    data.qfrc_applied[6:] = result.joint_torques
    data.qfrc_applied[:] += contact_wrench(robot, situation, result, twist)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qacc, qacc, atol=1e-7)


@pytest.mark.parametrize("support", SUPPORTS)
def test_accelerations_are_the_wanted_ones(
    robot: RobotModel, situate: Situate, support: tuple[bool, bool]
) -> None:
    """Soles, upper body and CoM height accelerate exactly as asked for."""
    situation = situate(4, support)
    result = situation.solve()
    qacc = full_acceleration(robot, result)
    for i in range(2):
        point = situation.touching[i]
        acceleration = robot.point_jacobian(i, point) @ qacc
        acceleration += robot.point_bias_acceleration(i, point)
        np.testing.assert_allclose(acceleration, situation.wanted.soles[i], atol=1e-9)
    np.testing.assert_allclose(
        qacc[robot.upper_dofs], situation.wanted.upper_joints, atol=1e-12
    )
    vertical = result.forces[:, 2].sum() / robot.mass - robot.gravity
    assert vertical == pytest.approx(situation.wanted.com_vertical, abs=1e-10)


def test_com_accelerates_with_the_forces(robot: RobotModel, situate: Situate) -> None:
    """The sum of contact forces is m (a_com - g), a_com by central differences."""
    situation = situate(5)
    result = situation.solve()
    qacc, step = full_acceleration(robot, result), 1e-5
    velocities = []
    for time in (step, -step):
        qpos = situation.qpos.copy()
        qvel = situation.qvel + time * qacc
        mujoco.mj_integratePos(
            robot.model, qpos, situation.qvel + 0.5 * time * qacc, time
        )
        robot.update(qpos, qvel)
        velocities.append(robot.com_velocity())
    acceleration = (velocities[0] - velocities[1]) / (2.0 * step)
    acceleration[2] += robot.gravity
    np.testing.assert_allclose(
        result.forces.sum(axis=0), robot.mass * acceleration, atol=1e-4
    )


# -- (b) CoP ---------------------------------------------------------------------


@pytest.mark.parametrize("support", SUPPORTS)
@pytest.mark.parametrize("seed", range(5))
def test_forces_have_no_horizontal_moment_about_the_cop(
    robot: RobotModel, situate: Situate, seed: int, support: tuple[bool, bool]
) -> None:
    """The definition of the CoP holds for the one that is reported."""
    situation = situate(seed, support)
    result = situation.solve()
    cop = situation.shares @ situation.contacts
    np.testing.assert_allclose(result.cop, cop[:2], atol=1e-12)
    moment = np.cross(result.contacts - cop, result.forces).sum(axis=0)
    np.testing.assert_allclose(moment[:2], 0.0, atol=1e-9)


def test_load_is_shared_as_asked(robot: RobotModel, situate: Situate) -> None:
    """On level contacts each foot carries its share, a swinging foot nothing."""
    for support in SUPPORTS:
        situation = situate(6, support, is_level=True)
        result = situation.solve()
        load = result.forces[:, 2] / result.forces[:, 2].sum()
        np.testing.assert_allclose(load, situation.shares, atol=1e-12)
        for i in range(2):
            if not support[i]:
                np.testing.assert_array_equal(result.forces[i], 0.0)


@pytest.mark.parametrize("yaw", [20.0, -20.0])
def test_yaw_couple_leaves_the_equations_of_motion(
    robot: RobotModel, situate: Situate, yaw: float
) -> None:
    """A yaw moment beyond torsion keeps the base's rows on level contacts."""
    situation = situate(7, yaw=yaw, is_level=True)
    result = situation.solve()
    couple = result.forces - situation.shares[:, None] * result.forces.sum(axis=0)
    assert np.abs(couple[:, :2]).max() > 1.0  # the couple is needed
    residual, twist = equation_residual(robot, situation, result)
    np.testing.assert_allclose(residual, 0.0, atol=1e-8)
    assert abs(twist) == pytest.approx(TORSION * result.forces[:, 2].sum(), rel=1e-9)


def test_yaw_couple_costs_no_more_than_the_contacts_heights(
    robot: RobotModel, situate: Situate
) -> None:
    """Forces at two contacts give no moment along the line between them.

    A couple about the vertical therefore leaves its share along that line where
    one contact is higher than the other, and nothing else.
    """
    for yaw in (20.0, -20.0):
        situation = situate(7, yaw=yaw)
        span = situation.contacts[0] - situation.contacts[1]
        assert abs(span[2]) > 1e-3
        result = situation.solve()
        residual, _ = equation_residual(robot, situation, result)
        np.testing.assert_allclose(residual[:3], 0.0, atol=1e-8)
        couple = float(np.cross(span, result.forces[0] - result.forces[1])[2])
        bound = abs(couple * span[2]) / float(np.hypot(span[0], span[1]))
        assert 0.0 < float(np.abs(residual[3:6]).max()) <= bound


# -- (c) mirror --------------------------------------------------------------------


def mirrored(situation: Situation, mirror: Mirror) -> Situation:
    """Return the reflection of a situation."""
    wanted, robot = situation.wanted, situation.robot
    joints = np.zeros(robot.joint_count)
    joints[robot.upper_dofs - 6] = wanted.upper_joints
    upper = mirror.joints(joints)[robot.upper_dofs - 6]
    soles = np.hstack(
        (mirror.vectors(wanted.soles[:, :3]), mirror.axials(wanted.soles[:, 3:]))
    )
    return replace(
        situation,
        qpos=mirror.qpos(situation.qpos),
        qvel=mirror.qvel(situation.qvel),
        wanted=WholeBodyAccelerations(
            trunk_angular=mirror.axials(wanted.trunk_angular),
            com_vertical=wanted.com_vertical,
            horizontal_force=mirror.vectors(wanted.horizontal_force),
            soles=soles[::-1],
            upper_joints=upper,
        ),
        touching=mirror.vectors(situation.touching)[::-1],
        contacts=mirror.vectors(situation.contacts)[::-1],
        shares=situation.shares[::-1].copy(),
    )


@pytest.mark.parametrize("support", SUPPORTS)
@pytest.mark.parametrize("yaw", [0.0, 20.0])
def test_mirrored_state_gives_mirrored_forces(
    robot: RobotModel,
    situate: Situate,
    mirror: Mirror,
    support: tuple[bool, bool],
    yaw: float,
) -> None:
    """Reflecting state and wishes reflects torques, accelerations and forces."""
    situation = situate(12, support, yaw)
    result = situation.solve()
    image = mirrored(situation, mirror).solve()
    np.testing.assert_allclose(
        image.joint_torques, mirror.joints(result.joint_torques), atol=1e-8
    )
    np.testing.assert_allclose(
        image.joint_accelerations, mirror.joints(result.joint_accelerations), atol=1e-8
    )
    np.testing.assert_allclose(
        image.forces, mirror.vectors(result.forces)[::-1], atol=1e-8
    )
    np.testing.assert_allclose(image.cop, mirror.vectors(result.cop), atol=1e-12)


# -- (d) limits of the compliance, yaw ---------------------------------------------


@pytest.mark.parametrize("support", SUPPORTS)
def test_no_compliance_moves_the_trunk_as_wanted(
    robot: RobotModel, situate: Situate, support: tuple[bool, bool]
) -> None:
    """Where a deviation of the force is free, the trunk tilts exactly as asked for."""
    situation = situate(15, support)
    result = situation.solve(compliance=0.0)
    rotation = robot.data.xmat[robot.trunk_id].reshape(3, 3)
    deviation = rotation @ (result.trunk_angular - situation.wanted.trunk_angular)
    np.testing.assert_allclose(deviation[:2], 0.0, atol=1e-9)
    # Where the feet can twist enough, in yaw too.
    result = situation.solve(0.0, torsion_arm=10.0)
    np.testing.assert_allclose(
        result.trunk_angular, situation.wanted.trunk_angular, atol=1e-9
    )


@pytest.mark.parametrize("support", SUPPORTS)
def test_full_compliance_keeps_the_pendulums_force(
    robot: RobotModel, situate: Situate, support: tuple[bool, bool]
) -> None:
    """Where a deviation of the force is dear, the force is exactly the pendulum's."""
    situation = situate(16, support)
    wanted = situation.wanted.horizontal_force
    errors = [
        np.abs(
            situation.solve(compliance, torsion_arm=10.0).forces.sum(axis=0)[:2]
            - wanted
        ).max()
        for compliance in (0.0, 1e4, 1e12)
    ]
    assert errors[0] > 10.0
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-5


def test_compliance_trades_force_for_tilt(robot: RobotModel, situate: Situate) -> None:
    """The deviations are the least weighted sum: any other trunk motion costs more."""
    situation = situate(17)
    price = 300.0
    result = situation.solve(price)
    rotation = robot.data.xmat[robot.trunk_id].reshape(3, 3)

    def cost(found: ContactForces) -> float:
        tilt = (rotation @ (found.trunk_angular - situation.wanted.trunk_angular))[:2]
        force = found.forces.sum(axis=0)[:2] - situation.wanted.horizontal_force
        return float(tilt @ tilt + price * force @ force / robot.mass**2)

    least = cost(result)
    # Solutions of all other prices lie on the same set of possible motions.
    for other in (0.0, 30.0, 200.0, 450.0, 3000.0, 1e9):
        assert cost(situation.solve(other)) > least


@pytest.mark.parametrize("support", SUPPORTS)
@pytest.mark.parametrize("yaw", [60.0, -60.0])
def test_yaw_is_limited_by_torsion_and_couple(
    robot: RobotModel, situate: Situate, support: tuple[bool, bool], yaw: float
) -> None:
    """However fast the trunk shall turn, the feet twist no more than they can."""
    situation = situate(18, support, yaw)
    result = situation.solve()
    base = situation.shares @ situation.contacts
    moment = np.cross(result.contacts - base, result.forces).sum(axis=0)[2]
    load = result.forces[:, 2].sum()
    span = np.linalg.norm((situation.contacts[0] - situation.contacts[1])[:2])
    couple = ForceLimits(*HALF).couple_friction * situation.shares.min() * span
    assert abs(moment) <= couple * load + 1e-9
    _, twist = equation_residual(robot, situation, result)
    assert abs(twist) <= TORSION * load + 1e-6
    if not all(support):
        assert moment == pytest.approx(0.0, abs=1e-9)
    # At the limit, and not far below it.
    assert abs(moment + twist) == pytest.approx((TORSION + couple) * load, rel=1e-6)
    small = situate(18, support, 0.0)
    turned = small.solve().trunk_angular[2]
    assert (result.trunk_angular[2] - turned) * yaw > 0.0
