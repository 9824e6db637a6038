"""Laws of stepping sideways: where the feet land, and how wide."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim_controllers.body_pendulum import BALL, STATE_SIZE, SettledMotion
from ballsim_controllers.footsteps.side_steps import (
    LateralMotion,
    SideSteps,
    plan_side_steps,
)
from ballsim_controllers.messages import BallParameters
from ballsim_controllers.wheeled_lip import BallPendulumParameters

PARAMS = BallPendulumParameters(BallParameters(0.5, 40.0, 0.5), 65.0, 0.9)
STEP_TIME, DELAY, SEPARATION, WIDTH = 0.34, 0.23, 0.1, 0.06
CELLS = np.array([8, 25])
IN_PLACE = np.array([WIDTH, -WIDTH])  # left, then right


def side_steps(velocity: float, start: float = 0.0) -> SideSteps:
    """Return the steps of a ball that rolls sideways at a constant velocity."""
    time = 0.02 * np.arange(40)
    rest = np.zeros(40)
    motion = np.column_stack((start + velocity * time, rest + velocity, rest))
    states, inputs = SettledMotion(PARAMS, 0.02).follow(motion)
    lateral = LateralMotion(states, inputs, STEP_TIME)
    return plan_side_steps(lateral, IN_PLACE, CELLS, DELAY, SEPARATION)


@pytest.mark.parametrize("start", [-2.0, 0.0, 0.7])
def test_ball_at_rest_is_stepped_on_in_place(start: float) -> None:
    """Wherever the ball rests, offsets from its centre are those of steps in place."""
    side = side_steps(0.0, start)
    assert side.widening == 1.0
    np.testing.assert_allclose(side.landings, IN_PLACE, atol=1e-12)
    np.testing.assert_allclose(side.play, 0.0, atol=1e-12)


@pytest.mark.parametrize("velocity", [-0.3, -0.08, 0.05, 0.25])
def test_feet_keep_their_separation_at_each_landing(velocity: float) -> None:
    """A foot that stood for a step has been carried towards or away from the other."""
    left, right = side_steps(velocity).landings
    carried = STEP_TIME * velocity
    for apart in (left - (right + carried), (left + carried) - right):
        assert apart >= SEPARATION - 1e-12


@pytest.mark.parametrize("velocity", [-0.2, 0.1, 0.3])
def test_sole_is_in_its_place_in_mid_stance(velocity: float) -> None:
    """The mean of both feet is over the reference CoP half way through a stance."""
    side = side_steps(velocity)
    mean = 0.5 * (side.landings[0] + side.landings[1])
    lag = 0.02 * velocity  # of the CoP behind its command
    assert mean + DELAY * velocity == pytest.approx(lag)


def test_mirrored_motion_gives_mirrored_steps() -> None:
    """To the left and to the right are the same with feet and signs exchanged."""
    one, other = side_steps(0.2), side_steps(-0.2)
    assert one.widening == other.widening
    shifts = [side.landings - side.widening * IN_PLACE for side in (one, other)]
    np.testing.assert_allclose(shifts[0], -shifts[1], atol=1e-12)
    np.testing.assert_allclose(one.play, -other.play[::-1, ::-1], atol=1e-12)


def test_bounds_move_with_the_nominal_landings() -> None:
    """The reach is centred on the nominal place and grows with the speed."""
    side = side_steps(0.2)
    shift = side.landings - IN_PLACE
    np.testing.assert_allclose(side.play.mean(axis=0), shift, atol=1e-12)
    np.testing.assert_allclose(side.play[1] - side.play[0], 0.6 * 0.2, atol=1e-12)


def test_horizon_without_a_landing_has_no_steps() -> None:
    """Nothing lands while the robot stands."""
    states = np.zeros((40, STATE_SIZE))
    states[:, BALL] = 0.3
    motion = LateralMotion(states, np.full(40, 0.3), STEP_TIME)
    none = np.zeros(0)
    side = plan_side_steps(motion, none, none.astype(int), DELAY, SEPARATION)
    assert side.widening == 1.0
    assert len(side.landings) == 0
