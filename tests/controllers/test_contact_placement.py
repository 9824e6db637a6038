"""Laws of the contacts: CoP, load shares and forces of one or two soles."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ballsim_controllers.geometry import rotation_from_vector
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.accelerations import (
    WholeBodyAccelerations,
    contact_acceleration,
)
from ballsim_controllers.whole_body.forces import (
    ContactForces,
    ForceDistribution,
    ForceLimits,
)
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

if TYPE_CHECKING:
    from tests.controllers.conftest import Mirror, Situation

Situate = Callable[..., "Situation"]
SUPPORTS = ((True, True), (True, False), (False, True))
HALF = np.array([0.085, 0.035])
LIMITS = ForceLimits(*HALF)


def sole_offsets(robot: RobotModel, contacts: Array) -> Array:
    """Return the contacts in the coordinates of their soles, shape (2, 3)."""
    return np.array(
        [
            foot.rotation.T @ (contact - foot.position)
            for foot, contact in zip(robot.feet, contacts, strict=True)
        ]
    )


@pytest.mark.parametrize("support", SUPPORTS)
def test_contacts_are_in_the_soles_and_shares_are_a_whole(
    robot: RobotModel, situate: Situate, support: tuple[bool, bool]
) -> None:
    """Wherever the CoP, contacts stay in the usable soles and shares sum to 1."""
    generator = np.random.default_rng(8)
    forces = ForceDistribution(robot, LIMITS)
    for seed in range(5):
        situate(seed)
        for _ in range(40):
            cop = generator.normal(scale=0.1, size=2)
            first, second = generator.uniform(size=2)
            contacts, shares = forces.place_contacts(cop, support, (first, second))
            offsets = sole_offsets(robot, contacts)
            assert (np.abs(offsets[:, :2]) <= HALF + 1e-12).all()
            np.testing.assert_allclose(offsets[:, 2], 0.0, atol=1e-12)
            assert shares.sum() == pytest.approx(1.0, abs=1e-12)
            for share, stands in zip(shares, support, strict=True):
                assert share >= LIMITS.minimal_share - 1e-12 if stands else share == 0.0


@pytest.mark.parametrize("is_walking", [False, True])
def test_contacts_give_the_cop_between_the_soles(
    robot: RobotModel, situate: Situate, is_walking: bool
) -> None:
    """A CoP between the sole centres is met by the convex combination.

    Exactly so while the robot stands; to 1 mm while the transfer goes from foot
    to foot with the CoP, where the least share of the load costs a little.
    """
    generator = np.random.default_rng(9)
    forces = ForceDistribution(robot, LIMITS)
    for seed in range(5):
        situate(seed)
        soles = np.array([foot.position[:2] for foot in robot.feet])
        for share in generator.uniform(0.1, 0.9, 20):
            cop = share * soles[0] + (1.0 - share) * soles[1]
            cop[0] += generator.uniform(-0.03, 0.03)
            transfer = (share, 1.0 - share) if is_walking else (0.0, 0.0)
            contacts, shares = forces.place_contacts(cop, (True, True), transfer)
            np.testing.assert_allclose(
                shares @ contacts[:, :2], cop, atol=1e-3 if is_walking else 1e-12
            )


@pytest.mark.parametrize(
    ("transfer", "tolerance"),
    [
        ((0.0, 0.0), 1e-4),
        ((0.5, 0.5), 1e-3),
        ((1.0, 1.0), 1e-3),
        ((1.0, 0.0), 35e-3),
        ((0.4, 1.0), 35e-3),
    ],
)
def test_contacts_give_any_cop_within_reach(
    robot: RobotModel, situate: Situate, transfer: tuple[float, float], tolerance: float
) -> None:
    """Every CoP that two contacts in the soles can give is given.

    Where one contact is held back at its sole's centre, the other's edge may
    cost 35 mm at the far corner of the hull: to make that up, the contact that
    is held back would have to jump.
    """
    forces = ForceDistribution(robot, LIMITS)
    robot.update(solve_nominal_stance(robot, 0.5).qpos, np.zeros(robot.model.nv))
    for x in np.linspace(-0.08, 0.08, 9):
        for y in np.linspace(-0.08, 0.08, 9):
            cop = np.array([x, y])
            contacts, shares = forces.place_contacts(cop, (True, True), transfer)
            np.testing.assert_allclose(shares @ contacts[:, :2], cop, atol=tolerance)


@pytest.mark.parametrize("foot", [0, 1])
def test_single_contact_is_the_cop(
    robot: RobotModel, situate: Situate, foot: int
) -> None:
    """On one foot the contact is the CoP, or the nearest point of the sole."""
    forces = ForceDistribution(robot, LIMITS)
    situate(10)
    sole, support = robot.feet[foot], (foot == 0, foot == 1)
    for offset in ([0.05, -0.03], [-0.084, 0.034], [0.0, 0.0]):
        cop = (sole.position + sole.rotation[:, :2] @ offset)[:2]
        contacts, _ = forces.place_contacts(cop, support, (1.0, 1.0))
        found = sole_offsets(robot, contacts)[foot, :2]
        np.testing.assert_allclose(found, offset, atol=1e-12)
    cop = (sole.position + sole.rotation[:, :2] @ [0.2, -0.01])[:2]
    contacts, _ = forces.place_contacts(cop, support, (1.0, 1.0))
    found = sole_offsets(robot, contacts)[foot, :2]
    np.testing.assert_allclose(found, [HALF[0], -0.01], atol=1e-12)


def test_full_transfer_takes_no_jump_at_lift_off(
    robot: RobotModel, situate: Situate
) -> None:
    """A CoP in the sole that will carry alone has its contact there already."""
    forces = ForceDistribution(robot, ForceLimits(*HALF, minimal_share=0.0))
    situate(11)
    sole = robot.feet[0]
    cop = (sole.position + sole.rotation[:, :2] @ [0.03, -0.02])[:2]
    both, shares = forces.place_contacts(cop, (True, True), (1.0, 0.0))
    alone, _ = forces.place_contacts(cop, (True, False), (1.0, 1.0))
    np.testing.assert_allclose(both[0], alone[0], atol=1e-12)
    assert shares[0] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("transfer", [(0.0, 0.0), (1.0, 0.3)])
def test_mirrored_cop_gives_mirrored_contacts(
    robot: RobotModel, situate: Situate, mirror: Mirror, transfer: tuple[float, float]
) -> None:
    """Reflecting feet, CoP and transfer reflects contacts and shares."""
    situation = situate(13)
    forces = ForceDistribution(robot, LIMITS)
    for cop in np.random.default_rng(14).normal(scale=0.05, size=(20, 2)):
        robot.update(situation.qpos, situation.qvel)
        contacts, shares = forces.place_contacts(cop, (True, True), transfer)
        robot.update(mirror.qpos(situation.qpos), mirror.qvel(situation.qvel))
        image, image_shares = forces.place_contacts(
            mirror.vectors(cop), (True, True), transfer[::-1]
        )
        np.testing.assert_allclose(image, mirror.vectors(contacts)[::-1], atol=1e-12)
        np.testing.assert_allclose(image_shares, shares[::-1], atol=1e-12)


def test_contact_acceleration_is_that_of_a_rolling_ball() -> None:
    """Without slip it is the surface's tangential acceleration; slip decays."""
    radius, alpha, slip = 0.5, np.array([-1.0, 2.0, 0.0]), np.zeros(3)
    floor = np.array([0.3, -0.2, 0.0])
    top = floor + np.array([0.0, 0.0, 2.0 * radius])
    found = contact_acceleration(top, floor, alpha, slip, 30.0)
    centre = radius * np.array([alpha[1], -alpha[0], 0.0])
    np.testing.assert_allclose(found, 2.0 * centre, atol=1e-14)
    slip = np.array([0.01, -0.02, 0.0])
    found = contact_acceleration(top, floor, alpha, slip, 30.0)
    np.testing.assert_allclose(found - 2.0 * centre, -30.0 * slip, atol=1e-14)
    step = 1e-6
    place = rotation_from_vector(0.5 * step**2 * alpha) @ (top - floor)
    np.testing.assert_allclose(
        (place - (top - floor)) / (0.5 * step**2), 2.0 * centre, rtol=1e-3, atol=1e-3
    )


def standing_forces(robot: RobotModel, cop: Array) -> tuple[ContactForces, Array]:
    """Return the forces at rest in the nominal stance, and the shares."""
    qpos = solve_nominal_stance(robot, 0.5).qpos
    robot.update(qpos, np.zeros(robot.model.nv))
    robot.update_dynamics()
    forces = ForceDistribution(robot, LIMITS)
    contacts, shares = forces.place_contacts(cop, (True, True), (0.0, 0.0))
    still = WholeBodyAccelerations(
        np.zeros(3), 0.0, np.zeros(2), np.zeros((2, 6)), np.zeros(len(robot.upper_dofs))
    )
    return forces.solve(still, contacts, contacts, shares), shares


def test_standing_still_needs_the_weight(robot: RobotModel) -> None:
    """At rest over the CoP the forces are the weight, half on each foot.

    Nothing accelerates, and the torques are what the forces do through each joint.
    """
    result, _ = standing_forces(robot, np.zeros(2))
    weight = robot.mass * robot.gravity
    np.testing.assert_allclose(result.forces.sum(axis=0), [0.0, 0.0, weight], atol=1e-7)
    np.testing.assert_allclose(result.forces[:, 2], 0.5 * weight, atol=1e-7)
    np.testing.assert_allclose(result.joint_accelerations, 0.0, atol=1e-9)
    np.testing.assert_allclose(result.trunk_angular, 0.0, atol=1e-9)
    expected = robot.bias[6:].copy()
    for i in range(2):
        jacobian = robot.point_jacobian(i, result.contacts[i])[:3, 6:]
        expected -= jacobian.T @ result.forces[i]
    np.testing.assert_allclose(result.joint_torques, expected, atol=1e-8)


def test_standing_feet_do_not_slide_down_the_ball(robot: RobotModel) -> None:
    """Beside the top the ball carries each foot along its normal: nothing creeps.

    With the load shared unevenly the lighter foot is the one without sideways
    force; the rest is friction under the heavier one.
    """
    result, _ = standing_forces(robot, np.zeros(2))
    for foot, force in zip(robot.feet, result.forces, strict=True):
        tangential = foot.rotation[:, :2].T @ force
        np.testing.assert_allclose(tangential, 0.0, atol=1e-6)
    for side, light in ((1.0, 1), (-1.0, 0)):
        result, shares = standing_forces(robot, np.array([0.0, 0.03 * side]))
        assert shares[light] < 0.4
        local = [
            foot.rotation.T @ force
            for foot, force in zip(robot.feet, result.forces, strict=True)
        ]
        # Less the pendulum's own force, of which each foot has its share.
        own = shares[light] * result.forces.sum(axis=0)
        own_local = robot.feet[light].rotation.T @ (own * [1.0, 1.0, 0.0])
        np.testing.assert_allclose(local[light][1], own_local[1], atol=1.0)
        assert abs(local[1 - light][1]) > 5.0
