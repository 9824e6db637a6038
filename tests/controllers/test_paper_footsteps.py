"""The paper's planner: its conditions, and whole runs on the planar plant.

Golden numbers: simplified-model.md section 5 (th1* in rad, dt = 1 ms, 20 s).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from ballsim.paper.planar_plant import PlanarPlant
from ballsim_controllers.balance.paper_controller import PaperBalanceController
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.footsteps.conditions import (
    FootstepParameters,
    FootstepState,
    PaperFootstepPlanner,
    choose_swing_foot,
    cop_speed_limit,
    double_support_domain,
    foot_rotation,
    has_passed_cop,
    limit_actual_cop,
    swing_speed_limit,
    swing_velocity,
)
from ballsim_controllers.reference import RampReference, constant_velocity_target
from ballsim_controllers.wheeled_lip import (
    WheeledLipParameters,
    discretise,
    equilibrium_direction,
    held_cop_wheeled_lip,
)

MAX_SWING_RATE = {0.25: 1.0, 0.5: 2.0, 0.75: 2.667, 1.0: 4.0}
DT = 1e-3


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    """Keep the gains of these tests away from the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@dataclass
class Run:
    """What a run of the paper's loop left behind."""

    steps: list[list[float]]  # lift [s], land [s], length [rad]
    angles: np.ndarray  # (n, 3), [rad]
    estimates: np.ndarray  # (n, 6)
    deviation: float  # largest |ideal - actual theta_2|, [rad]
    has_fallen: bool


def set_s1(radius):
    """Return the planner of parameter set S1."""
    rate = MAX_SWING_RATE[radius]
    return FootstepParameters(radius, rate, k1=2.0, k2=2.0, max_foot_angle=0.05)


def set_s2(radius):
    """Return the planner of parameter set S2."""
    return FootstepParameters(radius, MAX_SWING_RATE[radius])


def simulate(footsteps, target, duration=20.0, delay=0, **options):
    """Run controller, planner and plant; `target` maps the time to theta_1*."""
    radius = footsteps.ball_radius
    params = WheeledLipParameters(radius)
    controller = PaperBalanceController(params, **options)
    planner, plant = PaperFootstepPlanner(footsteps), PlanarPlant(params)
    state, feet, estimate = plant.start(np.zeros(3)), FootstepState(), np.zeros(6)
    pending, run = [0.0] * delay, Run([], np.zeros(0), np.zeros(0), 0.0, False)
    outputs, estimates = [], []
    for i in range(round(duration / DT)):
        output = plant.angles(state)
        outputs.append(output)
        pendulum = output[0] + params.wheel_ratio * output[1] + output[2]
        if max(abs(pendulum), abs(output[0] + output[1])) > 1.0:
            run.has_fallen = True
            break
        estimate = controller.update(estimate, output, target(i * DT), DT)
        estimates.append(estimate)
        before, angles = feet, (float(estimate[0]), float(estimate[1]))
        feet = planner.advance(
            feet, angles, (float(estimate[3]), float(estimate[4])), DT
        )
        if before.swing_foot is None and feet.swing_foot is not None:
            start = before.feet[feet.swing_foot]
            run.steps.append([i * DT, np.nan, -start])
        if feet.step_count > before.step_count:
            assert before.swing_foot is not None
            run.steps[-1][1] = i * DT
            run.steps[-1][2] += feet.feet[before.swing_foot]
        actual = planner.actual_cop(feet, angles[1])
        run.deviation = max(run.deviation, abs(actual - angles[1]))
        pending.append(actual)
        state = plant.step(state, pending.pop(0), DT)
    run.angles, run.estimates = np.array(outputs), np.array(estimates)
    return run


@pytest.mark.parametrize(
    ("radius", "peak_rate", "dip", "peak_contact", "contact_rates", "at_2_s"),
    [
        (
            0.5,
            (0.43405, 1.338),
            (-0.06551, 0.497),
            (0.12338, 0.520),
            (-0.4969, 0.5308),
            (0.4617, -0.4742, 2.3792),
        ),
        (
            1.0,
            (0.48427, 1.267),
            (-0.10685, 0.525),
            (0.22922, 0.544),
            (-0.7678, 0.9866),
            (0.4716, -0.4976, 4.9948),
        ),
    ],
)
def test_continuous_limit(radius, peak_rate, dip, peak_contact, contact_rates, at_2_s):
    """The exact closed loop has the reference's extremes."""
    params = WheeledLipParameters(radius)
    controller = PaperBalanceController(params)
    (A, B), K = controller.model, controller.gain
    step = discretise(A - B @ K, B @ K @ equilibrium_direction(params)[:, None], DT)
    states = [np.zeros(6)]
    for _ in range(10_000):
        states.append(step.A @ states[-1] + step.B[:, 0])
    x = np.array(states)
    for column, find, (value, time) in (
        (3, np.argmax, peak_rate),
        (0, np.argmin, dip),
        (1, np.argmax, peak_contact),
    ):
        i = find(x[:, column])
        assert x[i, column] == pytest.approx(value, rel=1e-3)
        assert i * DT == pytest.approx(time, abs=1.1e-3)
    assert (x[:, 4].min(), x[:, 4].max()) == pytest.approx(contact_rates, rel=1e-3)
    assert x[2000, :3] == pytest.approx(at_2_s, rel=1e-3)
    at_rest = equilibrium_direction(params)
    np.testing.assert_allclose(x[-1], at_rest, atol=1e-2)


@pytest.mark.parametrize(
    ("target", "radius", "count", "lift", "land", "length"),
    [
        (
            0.5,
            0.5,
            4,
            (0.307, 1.131, 2.292, 2.643),
            (0.508, 1.332, 2.493, 2.844),
            (0.156, -0.404, -0.297, -0.237),
        ),
        (
            0.5,
            1.0,
            5,
            (0.196, 1.144, 1.952, 3.121),
            (0.299, 1.345, 2.153, 3.349),
            (0.336, -0.555, -0.382, -0.182),
        ),
        (
            1.0,
            0.5,
            7,
            (0.224, 1.048, 1.266, 1.921),
            (0.407, 1.265, 1.467, 2.122),
            (0.362, -0.436, -0.404, -0.404),
        ),
    ],
)
def test_sequence_s2(target, radius, count, lift, land, length):
    """Set S2 gives the reference's foot sequence and ends on the target."""
    run = simulate(set_s2(radius), lambda _: target)
    steps = np.array(run.steps)
    assert abs(len(steps) - count) <= 1
    np.testing.assert_allclose(steps[:4, 0], lift, atol=2e-3)
    np.testing.assert_allclose(steps[:4, 1], land, atol=2e-3)
    np.testing.assert_allclose(steps[:4, 2], length, atol=2e-3)
    assert run.deviation < 1e-9
    assert run.angles[-1, 0] == pytest.approx(target, abs=1e-6)


def test_s2_falls_beyond_its_envelope():
    """A raw step of 1 rad on the unit ball falls at 1.55 s with set S2."""
    run = simulate(set_s2(1.0), lambda _: 1.0, duration=3.0)
    assert run.has_fallen
    assert len(run.angles) * DT == pytest.approx(1.55, abs=0.01)


@pytest.mark.parametrize(
    ("radius", "count", "first_lift"),
    [(0.25, 16, 1.075), (0.5, 27, 0.224), (0.75, 24, 0.062), (1.0, 40, 0.034)],
)
def test_sequence_s1(radius, count, first_lift):
    """Set S1 follows the ideal CoP on every ball, one foot at a time."""
    run = simulate(set_s1(radius), lambda _: 1.0)
    assert abs(len(run.steps) - count) <= 3
    assert run.steps[0][0] == pytest.approx(first_lift, abs=2e-3)
    assert run.deviation < 1e-9
    assert run.angles[-1, 0] == pytest.approx(1.0, abs=1e-6)
    for first, second in pairwise(run.steps):
        assert first[1] <= second[0]


def test_plain_loop_approaches_the_continuous_limit():
    """Where the planner never limits the CoP, 1 ms steps cost 0.2 %."""
    run = simulate(set_s1(0.5), lambda _: 1.0, duration=3.0)
    rates = np.diff(run.angles[:, 0]) / DT
    assert rates.max() == pytest.approx(0.43405, rel=2e-3)


def test_shaped_reference_walks_beyond_the_step_limit():
    """A raw 1 rad falls (S2, unit ball); 3 rad by ramp and equation (9) do not."""
    ramp = RampReference(max_speed=0.3, max_acceleration=0.1)
    ramp.target = 3.0
    controller = PaperBalanceController(WheeledLipParameters(1.0))

    def target(_):
        return constant_velocity_target(ramp.advance(DT), controller.lead_time)

    run = simulate(set_s2(1.0), target, duration=18.0)
    assert not run.has_fallen
    assert run.deviation < 5e-3
    # Equation (9) is for constant speed: braking leaves about 2 s^2 of it over.
    assert run.angles[:, 0].max() < 3.0 + 2.1 * ramp.max_acceleration
    assert run.angles[-1, 0] == pytest.approx(3.0, abs=1e-2)


def test_commanded_cop_in_the_output_survives_a_delay():
    """2 ms from ideal to actual CoP fell the plain loop, not the mended one."""
    plain = simulate(set_s1(0.5), lambda _: 0.5, duration=4.0, delay=2)
    mended = simulate(
        set_s1(0.5), lambda _: 0.5, 4.0, delay=2, is_commanded_cop_in_output=True
    )
    assert plain.has_fallen
    assert not mended.has_fallen


def test_plant_without_differentiation_equals_the_differentiated_form():
    """The z-form is (18) with the second difference of theta_2 as its input."""
    params = WheeledLipParameters(0.5)
    plant, (A, B) = PlanarPlant(params), held_cop_wheeled_lip(params)
    contacts = np.cumsum(np.random.default_rng(7).normal(scale=1e-3, size=50))
    contacts[:2] = 0.0
    theta, rates = np.array([0.01, 0.0, -0.02]), np.zeros(3)
    state = plant.start(theta)
    for before, now in pairwise(contacts):
        second = ((now - before) / DT - rates[1]) / DT
        rates = rates + DT * (A[3:, :3] @ theta + B[3:, 0] * second)
        theta = theta + DT * rates
        state = plant.step(state, now, DT)
        np.testing.assert_allclose(plant.angles(state), theta, atol=1e-12)
        assert plant.angles(state)[1] == now


def test_plant_stays_at_its_equilibrium():
    """Every multiple of T is at rest."""
    params = WheeledLipParameters(0.75)
    plant, rest = PlanarPlant(params), 0.3 * equilibrium_direction(params)[:3]
    state = plant.start(rest)
    for _ in range(100):
        state = plant.step(state, float(rest[1]), DT)
    np.testing.assert_allclose(plant.angles(state), rest, atol=1e-12)


@pytest.mark.parametrize(
    ("cop", "feet", "expected"),
    [
        (0.05, (0.0, 0.3), None),  # within the domain
        (-0.039, (0.0, 0.3), None),
        (-0.041, (0.0, 0.3), 1),  # beyond its lower end: the upper foot goes
        (0.341, (0.0, 0.3), 0),  # beyond its upper end: the lower foot goes
        (0.341, (0.3, 0.0), 1),
        (0.06, (0.0, 0.0), 0),  # level: as asked
    ],
)
def test_swing_condition(cop, feet, expected):
    """The foot on the far side goes as soon as both theta_d pass lambda l/r0."""
    half, shrink = 0.2, 0.2
    assert choose_swing_foot(cop, feet, half, shrink) == expected
    rotations = [foot_rotation(cop, foot, half) for foot in feet]
    paper = all(r < -shrink * half for r in rotations) or all(
        r > shrink * half for r in rotations
    )
    assert paper == (expected is not None)


def test_mirrored_feet_swing_mirrored():
    """Mirroring the ball mirrors the conditions."""
    generator = np.random.default_rng(8)
    for cop, first, second in generator.uniform(-1, 1, size=(200, 3)):
        feet, mirror = (first, second), (-first, -second)
        assert choose_swing_foot(cop, feet, 0.2, 0.2) == choose_swing_foot(
            -cop, mirror, 0.2, 0.2
        )
        for swing in (None, 0, 1):
            assert limit_actual_cop(cop, feet, swing, 0.2) == pytest.approx(
                -limit_actual_cop(-cop, mirror, swing, 0.2)
            )
        assert has_passed_cop(cop, first, second, 0.5) == has_passed_cop(
            -cop, -first, -second, 0.5
        )


def test_actual_cop_is_the_ideal_one_wherever_the_feet_allow():
    """In double support between the outer ends, in single support on one foot."""
    feet = (0.0, 1.0)
    assert double_support_domain(feet, 0.2) == (-0.2, 1.2)
    assert limit_actual_cop(0.5, feet, None, 0.2) == 0.5
    assert limit_actual_cop(1.5, feet, None, 0.2) == 1.2
    assert limit_actual_cop(0.5, feet, 1, 0.2) == pytest.approx(0.2)
    assert limit_actual_cop(0.5, feet, 0, 0.2) == pytest.approx(0.8)
    assert limit_actual_cop(0.1, feet, 1, 0.2) == pytest.approx(0.1)


def test_swing_velocity_is_bounded():
    """Equation (14): -k1 theta_1' + k2 theta_2', within its bound."""
    assert swing_velocity(0.4, -0.4, 2.0, 3.0, 9.0) == pytest.approx(-2.0)
    assert swing_velocity(0.4, -0.4, 2.0, 3.0, 1.5) == -1.5


def test_landing_condition():
    """Late or far out, and beyond k3 of the way to the CoP; strictly."""
    planner = PaperFootstepPlanner(set_s2(0.5))
    late = FootstepState(feet=(0.2, 0.0), swing_foot=0, swing_time=0.201)
    early = FootstepState(feet=(0.2, 0.0), swing_foot=0, swing_time=0.2)
    assert planner.is_landing(late, (0.0, 0.3))
    assert not planner.is_landing(early, (0.0, 0.3))
    assert planner.is_landing(early, (0.2, 0.3))  # 0.2 + 0.2 > alpha
    assert not planner.is_landing(late, (0.0, 0.5))  # not beyond half of the way
    assert not planner.is_landing(late, (0.0, -0.1))  # on the wrong side
    assert not planner.is_landing(late, (0.0, 0.0))  # CoP under the support foot
    assert not planner.is_landing(FootstepState(), (0.0, 0.0))


def test_level_feet_take_turns():
    """Where both feet are at the same place, the one that stood last time goes."""
    planner = PaperFootstepPlanner(set_s2(0.5))
    swinging = FootstepState(feet=(0.2, 0.0), swing_foot=0, swing_time=0.3)
    landed = planner.advance(swinging, (0.0, 0.3), (0.0, 0.0), DT)
    assert landed == FootstepState((0.2, 0.0), None, 0.3 + DT, 1, 1)
    level = FootstepState(feet=(0.2, 0.2), next_foot=landed.next_foot)
    assert planner.advance(level, (0.0, 0.5), (0.0, 0.0), DT).swing_foot == 1


def test_speed_limits():
    """They are those of the reference for the four balls."""
    limits = [cop_speed_limit(0.1, 0.2, r, 0.2) for r in MAX_SWING_RATE]
    np.testing.assert_allclose(limits, (1.6, 0.8, 0.533, 0.4), atol=1e-3)
    swings = [swing_speed_limit(rate) for rate in MAX_SWING_RATE.values()]
    np.testing.assert_allclose(swings, (0.5, 1.0, 1.33, 2.0), atol=4e-3)


@pytest.mark.parametrize(
    ("key", "value"),
    [("shrink", 1.0), ("shrink", -0.1), ("half_length", 0.0), ("k3", -1.0)],
)
def test_wrong_parameters_are_refused(key, value):
    """The error names the parameter."""
    with pytest.raises(InvalidSettingError, match=key):
        FootstepParameters(0.5, 2.0, **{key: value})
