"""Laws of the decisions when to begin and when to end stepping."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ballsim_controllers.footsteps.decisions import StepDecisions, StepSituation
from ballsim_controllers.footsteps.gait import LEFT, RIGHT
from ballsim_controllers.messages import StateEstimate
from ballsim_controllers.settings import WheeledLipSettings, load_settings

DT = 0.004
SETTINGS = load_settings(WheeledLipSettings, "wheeled-lip", {})
GAIT, FORCES = SETTINGS.gait, SETTINGS.forces
RADIUS = 0.5
SOLES = np.array([[0.0, 0.06], [0.0, -0.06]])
#: Where a capture point asks for a step.
EDGE = np.array([0.0, 0.06]) + GAIT.trigger_share * np.array(
    [FORCES.cop_half_length_m, FORCES.cop_half_width_m]
)
PREFERRED = LEFT


def make_estimate(**changes: Any) -> StateEstimate:
    """Return the estimate of a robot at rest over the ball's top."""
    zeros = np.zeros(3)
    plain = StateEstimate.of(
        time=0.0,
        quaternion_trunk_to_world=np.array([1.0, 0.0, 0.0, 0.0]),
        angular_velocity_trunk_in_trunk=zeros,
        position_trunk_in_world=zeros,
        linear_velocity_trunk_in_world=zeros,
        position_com_in_world=np.array([0.0, 0.0, 1.9]),
        linear_velocity_com_in_world=zeros,
        position_ball_in_world=np.array([0.0, 0.0, 0.5]),
        linear_velocity_ball_in_world=zeros,
        angular_velocity_ball_in_world=zeros,
        contacts_in_world=np.zeros((2, 3)),
        normal_forces=np.full(2, 318.0),
        cop_in_world=np.zeros(2),
    )
    return plain.changed(**changes)


def situation(**changes: Any) -> StepSituation:
    """Return the situation of a robot that stands and shall stand, with changes."""
    plain = StepSituation(
        estimate=make_estimate(),
        soles=SOLES,
        ideal_cop=np.zeros(2),
        capture=np.zeros(2),
        find_reference=lambda: np.zeros(2),
        is_wanted=False,
        find_swing=lambda: PREFERRED,
    )
    return replace(plain, **changes)


def time_to_swing(seen: StepSituation, limit: float = 20.0) -> tuple[float, int] | None:
    """Return when a constant situation makes a foot swing, and which; None = never."""
    decisions = StepDecisions(GAIT, FORCES, DT, RADIUS)
    for tick in range(round(limit / DT)):
        foot = decisions.first_swing(seen)
        if foot is not None:
            return tick * DT, foot
    return None


def test_balanced_robot_stands() -> None:
    """With the capture point between the soles no foot swings, wherever the CoP is."""
    assert time_to_swing(situation()) is None
    assert time_to_swing(situation(ideal_cop=np.array([0.5, -0.5]))) is None


@pytest.mark.parametrize("direction", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_lost_robot_swings_a_foot_soon(direction: tuple[int, int]) -> None:
    """A capture point beyond the margin, for a while: the preferred foot swings."""
    found = time_to_swing(situation(capture=EDGE * direction * 1.01))
    assert found is not None
    assert found[0] == pytest.approx(GAIT.trigger_time_s, abs=1.5 * DT)
    assert found[1] == PREFERRED
    assert time_to_swing(situation(capture=EDGE * direction * 0.99)) is None


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_feet_that_were_carried_off_may_stay(direction: float) -> None:
    """A robot that rests over the ball's top steps only from feet that are far off.

    Each other cause makes it step at once: a ball that rolls, a CoM that is off.
    """
    half = FORCES.cop_half_length_m
    between = 0.5 * (GAIT.trigger_share + GAIT.rest_share) * half
    carried = SOLES + np.array([direction * between, 0.0])
    assert time_to_swing(situation(soles=carried)) is None
    far = SOLES + np.array([direction * 1.01 * GAIT.rest_share * half, 0.0])
    assert time_to_swing(situation(soles=far)) is not None
    velocity = np.array([1.01 * GAIT.rest_speed_m_s, 0.0, 0.0])
    rolling = make_estimate(linear_velocity_ball_in_world=velocity)
    assert time_to_swing(situation(soles=carried, estimate=rolling)) is not None
    capture = np.array([-direction * 1.01 * GAIT.start_offset_m, 0.0])
    assert time_to_swing(situation(soles=carried, capture=capture)) is not None


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_foot_at_the_end_of_its_ankle_has_to_step(side: float) -> None:
    """A sole far down the flank cannot stay there, wherever the capture point is."""
    for share, is_due in ((1.01, True), (0.99, False)):
        place = share * GAIT.stand_reach_share * RADIUS
        soles = np.array([[0.0, place], [0.0, place - 0.12]]) * [1.0, side]
        middle = soles.mean(axis=0)
        seen = situation(soles=soles[:: int(side)], capture=middle)
        found = time_to_swing(seen)
        assert (found is not None) is is_due


def test_foot_farther_from_the_cop_begins() -> None:
    """A commanded step begins with the foot on the other side of the ideal CoP."""
    for side, foot in ((1.0, RIGHT), (-1.0, LEFT)):
        ideal = np.array([0.0, 0.01 * side])
        found = time_to_swing(situation(ideal_cop=ideal, is_wanted=True))
        assert found is not None
        assert found[1] == foot


def test_short_excursions_are_forgiven() -> None:
    """The time outside counts anew after each return."""
    decisions = StepDecisions(GAIT, FORCES, DT, RADIUS)
    outside = situation(capture=EDGE * [1.5, 0.0])
    short = max(round(0.7 * GAIT.trigger_time_s / DT), 1)
    for _ in range(20):
        assert all(decisions.first_swing(outside) is None for _ in range(short))
        assert decisions.first_swing(situation()) is None


def test_wanted_step_begins_at_rest() -> None:
    """A commanded step begins at once where the robot rests over the ball's top."""
    found = time_to_swing(situation(is_wanted=True))
    assert found is not None
    assert found[0] == 0.0


@pytest.mark.parametrize(
    "changes",
    [
        {"position_com_in_world": np.array([0.05, 0.0, 1.9])},
        {"position_ball_in_world": np.array([0.0, -0.05, 0.5])},
        {"linear_velocity_com_in_world": np.array([0.0, 0.1, 0.0])},
        {"linear_velocity_ball_in_world": np.array([-0.1, 0.0, 0.0])},
    ],
)
def test_wanted_step_waits_for_rest_but_not_for_ever(changes: dict[str, Any]) -> None:
    """A robot that moves or leans steps when its patience ends."""
    seen = situation(estimate=make_estimate(**changes), is_wanted=True)
    found = time_to_swing(seen)
    assert found is not None
    assert found[0] == pytest.approx(GAIT.start_patience_s, abs=1.5 * DT)


def test_patience_is_spent_on_one_wish_only() -> None:
    """The waiting time starts anew when the wish is withdrawn."""
    decisions = StepDecisions(GAIT, FORCES, DT, RADIUS)
    moving = make_estimate(linear_velocity_com_in_world=np.array([0.1, 0.0, 0.0]))
    half = round(0.6 * GAIT.start_patience_s / DT)
    for _ in range(3):
        wanted = situation(estimate=moving, is_wanted=True)
        assert all(decisions.first_swing(wanted) is None for _ in range(half))
        assert decisions.first_swing(situation(estimate=moving)) is None


def test_walk_ends_when_all_is_calm() -> None:
    """After some steps, unwanted, at rest with the ball at its place, it stays."""
    decisions = StepDecisions(GAIT, FORCES, DT, RADIUS)
    assert decisions.may_stop(situation(), GAIT.stop_steps)
    assert not decisions.may_stop(situation(), GAIT.stop_steps - 1)
    assert not decisions.may_stop(situation(is_wanted=True), 100)


@pytest.mark.parametrize(
    "changes",
    [
        {"capture": EDGE * [0.6, 0.0]},
        {"capture": (EDGE - [0.0, 0.06]) * [0.0, -0.6] - [0.0, 0.06]},
        {"find_reference": lambda: np.array([1.1 * GAIT.stop_offset_m, 0.0])},
        {"find_reference": lambda: np.array([0.0, -1.1 * GAIT.stop_offset_m])},
        {"soles": SOLES + np.array([[1.1 * GAIT.stop_offset_m, 0.0], [0.0, 0.0]])},
        {"soles": SOLES * [1.0, 1.01 * GAIT.stop_reach_share * RADIUS / 0.06]},
        {
            "estimate": make_estimate(
                linear_velocity_ball_in_world=np.array(
                    [0.0, -1.1 * GAIT.stop_speed_m_s, 0.0]
                )
            )
        },
    ],
)
def test_walk_goes_on_otherwise(changes: dict[str, Any]) -> None:
    """A capture point off the middle, a ball away from its place or rolling, feet
    apart forbid to stop.
    """
    decisions = StepDecisions(GAIT, FORCES, DT, RADIUS)
    assert not decisions.may_stop(situation(**changes), 100)
