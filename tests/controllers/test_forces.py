"""Laws of the force distribution: Newton and Euler, CoP, limits, mirror."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import pytest

from ballsim_controllers.messages import Array
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


def full_acceleration(robot: RobotModel, result: ContactForces) -> Array:
    """Return the whole qacc: the base's linear part follows from the forces.

    The mean of the forces over the mass is the CoM's acceleration less gravity.
    """
    qacc = np.zeros(robot.model.nv)
    qacc[3:6] = result.trunk_angular
    qacc[6:] = result.joint_accelerations
    rest = robot.mass_matrix[:3] @ qacc + robot.bias[:3]
    qacc[:3] = (result.forces.sum(axis=0) - rest) / robot.mass
    return qacc


def contact_wrench(
    robot: RobotModel, situation: Situation, result: ContactForces, twist: float
) -> Array:
    """Return the generalised force of the contacts, twist shared by load."""
    total = np.zeros(robot.model.nv)
    for i in range(2):
        if situation.shares[i] > 0.0:
            jacobian = robot.point_jacobian(i, result.contacts[i])
            moment = np.array([0.0, 0.0, situation.shares[i] * twist])
            total += jacobian.T @ np.concatenate((result.forces[i], moment))
    return total


def equation_residual(
    robot: RobotModel, situation: Situation, result: ContactForces
) -> tuple[Array, float]:
    """Return M qacc + h - S' tau - J' f on every row, and the twist that it needs.

    The twist about the vertical is not reported; the yaw row gives it.
    """
    qacc = full_acceleration(robot, result)
    residual = robot.mass_matrix @ qacc + robot.bias
    residual[6:] -= result.joint_torques
    residual -= contact_wrench(robot, situation, result, 0.0)
    # A pure moment about the world's z acts on the base through its third row.
    rotation = robot.data.xmat[robot.trunk_id].reshape(3, 3)
    twist = float(rotation[2] @ residual[3:6])
    pure = contact_wrench(robot, situation, result, twist)
    residual -= pure - contact_wrench(robot, situation, result, 0.0)
    return residual, twist


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


def inner_wrench(
    robot: RobotModel, result: ContactForces, twist: float, squeeze: float
) -> Array:
    """Return the generalised force of what the feet do to each other."""
    span = result.contacts[0] - result.contacts[1]
    along = squeeze / np.linalg.norm(span) * span
    wrench = np.append(along, [0.0, 0.0, twist])
    left, right = (robot.point_jacobian(i, result.contacts[i]) for i in range(2))
    total: Array = left.T @ wrench - right.T @ wrench
    return total


@pytest.mark.parametrize("seed", range(3))
def test_twist_and_squeeze_are_between_the_feet(
    robot: RobotModel, situate: Situate, seed: int
) -> None:
    """They move nothing, and are the feet's own: only torques of the legs give them."""
    situation = situate(seed)
    plain = situation.solve()
    inner = replace(situation, twist=0.3, squeeze=-5.0).solve()
    np.testing.assert_array_equal(inner.accelerations, plain.accelerations)
    np.testing.assert_allclose(
        inner.forces.sum(axis=0), plain.forces.sum(axis=0), atol=1e-9
    )
    wrench = inner_wrench(robot, plain, 0.3, -5.0)
    np.testing.assert_allclose(wrench[:6], 0.0, atol=1e-10)
    np.testing.assert_allclose(
        inner.joint_torques, plain.joint_torques - wrench[6:], atol=1e-9
    )


def test_twist_and_squeeze_are_what_contacts_can_give(
    robot: RobotModel, situate: Situate
) -> None:
    """As much as torsion leaves on one foot, and a share of the smaller load."""
    situation = situate(4, yaw=1.0)
    plain = situation.solve()
    _, torsion = equation_residual(robot, situation, plain)
    loads = situation.shares * plain.forces[:, 2].sum()
    free = TORSION * loads - situation.shares * abs(torsion)
    squeeze = ForceLimits(*HALF).couple_friction * loads.min()
    for sign in (1.0, -1.0):
        inner = replace(situation, squeeze=sign * 1e4).solve()
        given = float(np.linalg.norm(inner.forces[0] - plain.forces[0]))
        assert given == pytest.approx(squeeze, rel=1e-9)
        inner = replace(situation, twist=sign * 1e3).solve()
        unit = inner_wrench(robot, plain, sign, 0.0)[6:]
        given = float(
            (plain.joint_torques - inner.joint_torques) @ unit / (unit @ unit)
        )
        assert given == pytest.approx(float(free.min()), rel=0.02)
    one_foot = replace(situate(4, (True, False)), twist=1.0, squeeze=1.0)
    np.testing.assert_array_equal(
        one_foot.solve().joint_torques, situate(4, (True, False)).solve().joint_torques
    )


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
