"""Laws of what the feet do to each other: a twist and a squeeze."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.controllers.force_balance import equation_residual

from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.forces import ContactForces, ForceLimits

if TYPE_CHECKING:
    from tests.controllers.conftest import Situation

Situate = Callable[..., "Situation"]
LIMITS = ForceLimits(0.085, 0.035)


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
    free = LIMITS.torsion_arm * loads - situation.shares * abs(torsion)
    squeeze = LIMITS.couple_friction * loads.min()
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
