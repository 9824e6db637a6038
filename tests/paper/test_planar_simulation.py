"""Whole runs of the paper's loop against simplified-model.md sections 3 to 6."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ballsim.paper.experiments import CONSTANT_TARGETS, Laboratory
from ballsim.paper.measures import largest_deviation, mean_step_length, steady_state
from ballsim.paper.observer_gains import make_balance
from ballsim.paper.parameter_sets import PARAMETER_SETS, RADII, StageReading
from ballsim.paper.planar_simulation import NO_FOOT, simulate
from ballsim.paper.speed_limits import planner_speed_limit, roll_faster_and_faster
from ballsim.paper.targets import Moment, SpeedRamp, SteppedTarget, VelocityStages
from ballsim_controllers.footsteps.conditions import swing_speed_limit
from ballsim_controllers.wheeled_lip import equilibrium_direction

LARGEST_TARGETS = {"S1": (1.6, 2.1, 2.2, 1.9), "S2": (1.5, 1.2, 1.0, 0.8)}
LARGEST_LEANS = {"S1": (0.062, 0.114, 0.146, 0.210), "S2": (0.062, 0.106, 0.094, 0.090)}


@pytest.fixture(scope="module")
def laboratory():
    """Return what runs experiments, with its controllers built only once."""
    return Laboratory()


@pytest.mark.parametrize(
    ("radius", "count"), list(zip(RADII, (8, 16, 14, 13), strict=True))
)
def test_step_counts_of_s1(laboratory, radius, count):
    """Half a radian takes the reference's steps, and none deviates."""
    experiment = laboratory.roll_to("S1", radius, (0.0, 0.5))
    assert abs(experiment.run.step_count - count) <= 3
    assert largest_deviation(experiment.run) < 1e-9
    assert experiment.run.outputs[-1, 0] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("index", range(4))
@pytest.mark.parametrize("set_name", ["S1", "S2"])
def test_envelope_of_constant_targets(laboratory, set_name, index):
    """Just within the largest target it arrives to 1e-3 rad; a third more falls."""
    radius, largest = RADII[index], LARGEST_TARGETS[set_name][index]
    inside = laboratory.roll_to(set_name, radius, (0.0, 0.95 * largest), duration=14.0)
    assert inside.run.fall_time is None
    assert inside.run.outputs[-1, 0] == pytest.approx(0.95 * largest, abs=1e-3)
    outside = laboratory.roll_to(set_name, radius, (0.0, 1.35 * largest), duration=5.0)
    assert outside.run.fall_time is not None


@pytest.mark.parametrize("set_name", CONSTANT_TARGETS)
def test_settling_time(laboratory, set_name):
    """The ball is within 2 % of its target after 6.1 to 6.0 s, on every ball."""
    for radius, expected in zip(RADII, (6.135, 6.086, 6.036, 5.984), strict=True):
        angle = CONSTANT_TARGETS[set_name]
        run = laboratory.roll_to(set_name, radius, (0.0, angle), duration=8.0).run
        outside = np.flatnonzero(np.abs(run.outputs[:, 0] - angle) > 0.02 * angle)
        assert run.time[outside[-1]] == pytest.approx(expected, abs=0.05)


def test_response_is_linear_and_mirrored(laboratory):
    """Where the CoP never deviates, theta scales with the target, also below 0."""
    runs = [
        laboratory.roll_to("S1", 0.5, (0.0, angle), duration=3.0).run
        for angle in (0.5, 1.0, -1.0)
    ]
    half, full, back = (run.outputs for run in runs)
    np.testing.assert_allclose(2.0 * half, full, atol=2e-3)
    np.testing.assert_allclose(back, -full, atol=1e-9)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize(
    "points",
    [((0.0, 0.5), (3.0, 1.0), (7.0, 0.2)), ((0.0, 0.5), (2.0, -0.3), (3.5, 0.5))],
)
def test_changing_targets_of_s1(laboratory, radius, points):
    """The widest set follows both changes of Fig. 9 without a deviation."""
    experiment = laboratory.roll_to("S1", radius, *points, duration=15.0)
    assert experiment.run.fall_time is None
    assert largest_deviation(experiment.run) < 1e-9
    assert experiment.run.outputs[-1, 0] == pytest.approx(points[-1][1], abs=5e-3)


@pytest.mark.parametrize("index", range(4))
@pytest.mark.parametrize("set_name", ["S1", "S2"])
def test_recovery_from_an_initial_lean(laboratory, set_name, index):
    """From 9/10 of the reference's lean it recovers, from 1.5 times it falls."""
    radius, largest = RADII[index], LARGEST_LEANS[set_name][index]
    choices = PARAMETER_SETS[set_name]
    balance = laboratory.balance(choices, radius)
    for factor, is_fall in ((0.9, False), (-0.9, False), (1.5, True)):
        start = np.array([0.0, 0.0, factor * largest])
        footsteps = choices.footsteps(radius)
        run = simulate(balance, footsteps, SteppedTarget(), 4.0, start=start)
        assert (run.fall_time is not None) == is_fall


@pytest.mark.parametrize("radius", RADII)
def test_speed_limit_of_the_planner(radius):
    """With t_s kept, the CoP first deviates at the lower of the two limits."""
    choices = replace(PARAMETER_SETS["S1"], max_foot_angle=None)
    limit = planner_speed_limit(choices.footsteps(radius))
    found = roll_faster_and_faster(choices, radius, 1.2 * limit).first_deviation
    assert found is not None
    # A foot swings for less than half of the time: the swing bound, which limits
    # the smallest ball, is a safe one.
    assert 1.0 <= found / limit <= (1.2 if radius == 0.25 else 1.04)


@pytest.mark.parametrize("radius", RADII)
def test_swing_bound_is_the_limit_of_short_steps(radius):
    """With a small alpha t_s no longer counts, and the swing bound limits."""
    choices = PARAMETER_SETS["S1"]
    limit = swing_speed_limit(choices.footsteps(radius).max_swing_rate)
    found = roll_faster_and_faster(choices, radius, 1.2 * limit).first_deviation
    assert found is not None
    assert 1.0 <= found / limit <= 1.2


def test_planner_keeps_up_below_its_limit():
    """A ramp to 0.9 of the limit shows no deviation at all."""
    choices = replace(PARAMETER_SETS["S1"], max_foot_angle=None)
    limit = planner_speed_limit(choices.footsteps(0.5))
    assert roll_faster_and_faster(choices, 0.5, 0.9 * limit).first_deviation is None


def test_printed_swing_gain_cannot_follow(laboratory):
    """With k1 = k2 = 0.2 as printed, 0.5 rad falls on the balls from 0.5 m on."""
    for radius in (0.5, 0.75, 1.0):
        choices = PARAMETER_SETS["S1"]
        footsteps = replace(choices.footsteps(radius), k1=0.2, k2=0.2)
        balance = laboratory.balance(choices, radius)
        run = simulate(balance, footsteps, SteppedTarget((0.0, 0.5)), 5.0)
        assert run.fall_time is not None


@pytest.mark.parametrize(
    ("set_name", "radius", "count", "length"),
    [("KNV20", 0.5, 113, 0.420), ("KNV20", 1.0, 57, 0.840)],
)
def test_steps_at_constant_velocity(laboratory, set_name, radius, count, length):
    """A minute at 0.4 rad/s takes the reference's steps, of its length."""
    run = laboratory.roll_steadily(set_name, radius, 60.0).run
    assert abs(run.step_count - count) <= 2
    assert mean_step_length(run) == pytest.approx(length, abs=5e-3)


def test_finer_time_step_calms_the_unit_ball(laboratory):
    """The deviation is the last step of a swing that is too long: dt sets it."""
    choices = replace(PARAMETER_SETS["KNV20"], dt=1e-3)
    balance = laboratory.balance(choices, 1.0)
    target = VelocityStages(balance.lead_time)
    run = simulate(balance, choices.footsteps(1.0), target, 40.0, choices.dt)
    fine = steady_state(run)
    coarse = steady_state(laboratory.roll_steadily("KNV20", 1.0, 60.0).run)
    assert fine is not None
    assert coarse is not None
    assert fine.deviation < 0.5 * coarse.deviation


@pytest.mark.parametrize(
    ("reading", "peak"),
    [
        (StageReading.RESTART, 0.41),
        (StageReading.INTEGRAL, 0.50),
        (StageReading.PRODUCT, 0.61),
    ],
)
def test_readings_of_a_changing_velocity(laboratory, reading, peak):
    """Only a restart of the ramp avoids the overshoot of the last stage."""
    choices = PARAMETER_SETS["S1"]
    balance = laboratory.balance(choices, 0.5)
    target = VelocityStages(balance.lead_time, reading)
    run = simulate(balance, choices.footsteps(0.5), target, 8.0)
    assert run.ball_rates.max() == pytest.approx(peak, abs=0.015)


def test_steps_and_feet_tell_the_same(laboratory):
    """The steps are what the feet did: no foot moves but in its own swing."""
    run = laboratory.roll_to("S2", 0.5, (0.0, 1.0), duration=6.0).run
    landed = [step for step in run.steps if step.landing_time is not None]
    assert len(landed) == run.step_count
    for foot in (0, 1):
        way = sum(step.length for step in run.steps if step.foot == foot)
        assert run.feet[-1, foot] == pytest.approx(way)
        standing = (run.swing_feet[1:] != foot) & (run.swing_feet[:-1] != foot)
        assert not np.diff(run.feet[:, foot])[standing].any()
    assert (run.swing_feet == NO_FOOT).any()


def test_fall_ends_the_run():
    """From beyond the angle of a fall there is nothing to simulate."""
    choices = PARAMETER_SETS["S1"]
    start = np.array([0.0, 0.0, 1.1])
    balance = make_balance(choices, 0.5)
    footsteps = choices.footsteps(0.5)
    run = simulate(balance, footsteps, SteppedTarget(), 1.0, start=start)
    assert run.fall_time == 0.0
    assert len(run.time) == len(run.steps) == 0
    assert largest_deviation(run) == mean_step_length(run) == 0.0
    assert steady_state(run) is None


def test_robot_at_rest_stays():
    """At a multiple of T with the target there, nothing moves."""
    choices = PARAMETER_SETS["S2"]
    balance = make_balance(choices, 0.75)
    rest = 0.02 * equilibrium_direction(balance.params)[:3]
    target = SteppedTarget((0.0, 0.02))
    run = simulate(balance, choices.footsteps(0.75), target, 1.0, start=rest)
    np.testing.assert_allclose(run.outputs, np.tile(rest, (1000, 1)), atol=1e-9)
    assert not run.steps


def test_speed_ramp_integrates_its_speed():
    """theta_1^r is the integral, theta_1^* leads it by KT'/KT."""
    ramp = SpeedRamp(2.5, (0.0, 0.0), (2.0, 0.4), (3.0, 0.1))
    times = np.arange(0.0, 5.0, 1e-3)
    samples = np.array([ramp.sample_at(float(t))[:2] for t in times])
    steps = 0.5e-3 * (samples[1:, 1] + samples[:-1, 1])
    np.testing.assert_allclose(np.diff(samples[:, 0]), steps, atol=1e-9)
    assert samples[-1, 1] == pytest.approx(0.1)
    moment = Moment(1.0, 9.0, 9.0, is_lifting=True)
    assert ramp.advance(moment) == pytest.approx(0.1 + 2.5 * 0.2)
