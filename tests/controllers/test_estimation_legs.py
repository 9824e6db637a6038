"""Laws of the leg odometry: what legs that disagree tell together."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ballsim_controllers.estimation.ball import BALL_STATE
from ballsim_controllers.estimation.contacts import CONTACT
from ballsim_controllers.estimation.legs import FUSION, fuse_legs
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.robot_kinematics import FEET

RADIUS, DT = 0.5, 0.005
BOTH, LEFT, RIGHT = (300.0, 300.0), (640.0, 0.0), (0.0, 640.0)
PLACE = np.array([0.01, -0.02, 1.4])


class Legs:
    """Legs of a robot on a ball at rest; what each adds to the place is given.

    Args:
        errors: What each leg adds to the place, in the trunk, shape (2, 3), [m].
    """

    def __init__(self, errors: Array) -> None:
        """Start with an odometry that knows nothing."""
        self.errors = errors
        self.fusion: Record = np.zeros(1, FUSION)
        self.fusion["radius"], self.fusion["dt"] = RADIUS, DT
        self.fusion["leg_trust"] = 1.0

    def fuse(
        self, forces: tuple[float, float], ticks: int = 1, heading: float = 0.0
    ) -> Array:
        """Return the place after some readings, seen along the heading, (3,), [m]."""
        contacts: Record = np.zeros(2, CONTACT)
        contacts["normal_force"] = forces
        contacts["confidence"] = np.array(forces) > 0.0
        turn = Rotation.from_euler("z", heading).as_matrix()
        feet: Record = np.zeros(1, FEET)
        for i, width in enumerate((0.06, -0.06)):
            normal = np.array([0.0, width, np.sqrt(RADIUS**2 - width**2)]) / RADIUS
            across = np.array([1.0, 0.0, 0.0])
            sole = np.column_stack((across, np.cross(normal, across), normal))
            feet["rotation"][0, i] = turn @ sole
            told = PLACE + self.errors[i]
            feet["position"][0, i] = turn @ (RADIUS * normal - told)
        ball: Record = np.zeros(1, BALL_STATE)
        for _ in range(ticks):
            place, _, _ = fuse_legs(contacts, feet[0], ball[0], self.fusion[0], turn)
        found: Array = turn.T @ place
        return found


APART = np.array([0.012, -0.004, 0.002])


@pytest.mark.parametrize("heading", [0.0, 1.3])
def test_place_does_not_jump_from_leg_to_leg(heading: float) -> None:
    """Legs that have stood together tell one place afterwards, also once turned."""
    legs = Legs(np.array([APART, -APART]))
    np.testing.assert_allclose(legs.fuse(LEFT), PLACE + APART, atol=1e-12)
    np.testing.assert_allclose(legs.fuse(RIGHT), PLACE - APART, atol=1e-12)
    legs.fuse(BOTH, ticks=10)
    for forces in (LEFT, RIGHT, BOTH, (600.0, 40.0)):
        found = legs.fuse(forces, heading=heading)
        np.testing.assert_allclose(found, PLACE, atol=1e-12)


def test_error_that_both_legs_share_is_not_seen() -> None:
    """Only the difference is known: half-way between both legs is where they are."""
    legs = Legs(np.array([3.0 * APART, APART]))
    legs.fuse(BOTH, ticks=10)
    for forces in (LEFT, RIGHT):
        np.testing.assert_allclose(legs.fuse(forces), PLACE + 2.0 * APART, atol=1e-12)


def test_legs_that_agree_are_left_alone() -> None:
    """Without a difference every share of the load gives the same place."""
    legs = Legs(np.zeros((2, 3)))
    for forces in (BOTH, LEFT, (10.0, 500.0), RIGHT):
        np.testing.assert_allclose(legs.fuse(forces), PLACE, atol=1e-12)


def test_a_leg_that_is_not_trusted_tells_nothing() -> None:
    """The other one alone counts and nothing is learnt; without both, nothing is."""
    legs = Legs(np.array([APART, -APART]))
    legs.fusion["trunk_from_ball"] = PLACE
    for trust, told in (([0, 1], -APART), ([1, 0], APART), ([0, 0], 0.0 * APART)):
        legs.fusion["leg_trust"] = trust
        np.testing.assert_allclose(legs.fuse(BOTH, 10), PLACE + told, atol=1e-12)
    assert not legs.fusion["disagreement"].any()


def test_change_is_learnt_within_seconds() -> None:
    """A leg that changes is followed: the mean forgets what is older than a second."""
    legs = Legs(np.zeros((2, 3)))
    legs.fuse(BOTH, ticks=1000)
    legs.errors = np.array([APART, -APART])
    legs.fuse(BOTH, ticks=round(1.0 / DT))
    left = legs.fuse(LEFT) - PLACE
    assert np.linalg.norm(left) < 0.45 * np.linalg.norm(APART)
    legs.fuse(BOTH, ticks=round(4.0 / DT))
    assert np.linalg.norm(legs.fuse(LEFT) - PLACE) < 0.01 * np.linalg.norm(APART)
