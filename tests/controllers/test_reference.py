"""Laws of the command shaper: limits, smoothness, exact arrival."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.reference import (
    RampReference,
    ReferenceSample,
    compute_lead_time,
    constant_velocity_target,
    plan_trapezoid,
)

SPEED, ACCELERATION, WINDOW = 0.4, 0.15, 0.5


def record(ramp, n_steps, dt):
    """Return the samples of some steps, shape (n_steps, 4)."""
    return np.array([ramp.advance(dt) for _ in range(n_steps)])


def random_drive(seed, window, dt=0.01):
    """Return the samples of a ramp whose target jumps about, and the ramp."""
    generator = np.random.default_rng(seed)
    ramp, parts = RampReference(SPEED, ACCELERATION, window), []
    for _ in range(12):
        ramp.target = generator.uniform(-2.0, 2.0)
        parts.append(record(ramp, int(generator.integers(1, 400)), dt))
    return np.vstack(parts), ramp


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("window", [0.0, 0.03, WINDOW])
def test_limits_hold_whatever_the_target_does(seed, window):
    """Speed, acceleration and jerk stay within their limits."""
    samples, _ = random_drive(seed, window)
    assert np.abs(samples[:, 1]).max() <= SPEED * (1 + 1e-9)
    assert np.abs(samples[:, 2]).max() <= ACCELERATION * (1 + 1e-9)
    if window:
        bound = 2.0 * ACCELERATION / window
        assert np.abs(samples[:, 3]).max() <= bound * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_rates_are_the_derivatives(seed):
    """Position, velocity, acceleration and jerk belong together."""
    dt = 0.01
    samples, _ = random_drive(seed, WINDOW, dt)
    jerk = 2.0 * ACCELERATION / WINDOW
    bounds = (ACCELERATION * dt / 2, jerk * dt / 2, 2.0 * jerk)
    for column, bound in enumerate(bounds):
        slope = np.diff(samples[:, column]) / dt
        middle = 0.5 * (samples[1:, column + 1] + samples[:-1, column + 1])
        assert np.abs(slope - middle).max() <= bound


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("window", [0.0, WINDOW])
def test_arrival_is_exact_and_final(seed, window):
    """Left alone, the reference comes to rest on the very target."""
    _, ramp = random_drive(seed, window)
    record(ramp, 2500, 0.01)
    assert ramp.is_at_rest
    assert ramp.sample == ReferenceSample(ramp.target, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("distance", [1e-9, 1e-3, 0.05, 1.0, 4.0, -2.5])
@pytest.mark.parametrize("window", [0.0, WINDOW])
def test_no_overshoot_from_rest(distance, window):
    """From rest the way is monotonic and ends at the target in minimal time."""
    ramp = RampReference(SPEED, ACCELERATION, window, position=0.7)
    ramp.target = 0.7 + distance
    way = (record(ramp, 2000, 0.01)[:, 0] - 0.7) * np.sign(distance)
    assert np.diff(way).min() >= -1e-14
    assert way[-1] == abs(ramp.target - 0.7)
    size = abs(distance)
    if size > SPEED**2 / ACCELERATION:
        duration = size / SPEED + SPEED / ACCELERATION
    else:
        duration = 2.0 * np.sqrt(size / ACCELERATION)
    last = np.flatnonzero(way < way[-1])[-1] + 1 if way[0] < way[-1] else 0
    assert last * 0.01 <= duration + window + 0.011


def test_retargeting_within_reach_does_not_overshoot():
    """A new target ahead of the braking distance is never passed."""
    ramp = RampReference(SPEED, ACCELERATION, WINDOW)
    ramp.target = 4.0
    record(ramp, 500, 0.01)
    stop = ramp.sample.position + SPEED * WINDOW + SPEED**2 / (2 * ACCELERATION)
    ramp.target = stop + 0.01
    way = record(ramp, 1500, 0.01)[:, 0]
    assert np.diff(way).min() >= -1e-14
    assert way[-1] == stop + 0.01


def test_retargeting_behind_overshoots_by_the_braking_distance_at_most():
    """Where braking cannot end in time, the reference comes back smoothly."""
    ramp = RampReference(SPEED, ACCELERATION, WINDOW)
    ramp.target = 4.0
    record(ramp, 500, 0.01)
    turning_point = (
        ramp.sample.position + SPEED * WINDOW + SPEED**2 / (2 * ACCELERATION)
    )
    ramp.target = 0.5
    way = record(ramp, 2500, 0.01)[:, 0]
    assert 1.5 < way.max() <= turning_point
    assert way[-1] == 0.5


@pytest.mark.parametrize("window", [0.0, WINDOW])
def test_step_size_does_not_matter(window):
    """The same instants give the same reference for every way to get there."""
    coarse = RampReference(SPEED, ACCELERATION, window)
    fine = RampReference(SPEED, ACCELERATION, window)
    coarse.target = fine.target = 1.3
    for target in (1.3, 0.2, -0.4):
        coarse.target = fine.target = target
        for _ in range(9):
            expected = coarse.advance(0.25)
            for _ in range(50):
                actual = fine.advance(0.005)
            np.testing.assert_allclose(actual[:3], expected[:3], atol=1e-9)


def test_repeating_the_target_changes_nothing():
    """Setting the same target each tick equals setting it once."""
    once, always = (RampReference(SPEED, ACCELERATION, WINDOW) for _ in range(2))
    once.target = 2.0
    for _ in range(1000):
        always.target = 2.0
        assert always.advance(0.01) == once.advance(0.01)


def test_mirrored_target_gives_mirrored_reference():
    """The shaper has no preferred direction."""
    left, right = (RampReference(SPEED, ACCELERATION, WINDOW) for _ in range(2))
    left.target, right.target = -1.1, 1.1
    a, b = record(left, 800, 0.01), record(right, 800, 0.01)
    np.testing.assert_allclose(a, -b, atol=1e-14)


def test_target_that_moves_every_tick_is_followed():
    """A slow target is caught up with, and no history piles up."""
    ramp = RampReference(SPEED, ACCELERATION, WINDOW)
    for i in range(3000):
        ramp.target = 0.1 * 0.01 * (i + 1)
        sample = ramp.advance(0.01)
    assert sample.velocity == pytest.approx(0.1, abs=0.02)
    assert abs(ramp.target - sample.position) < 0.15
    assert len(ramp._table) < 4 * WINDOW / 0.01


@pytest.mark.parametrize("seed", range(4))
def test_trapezoid_ends_at_rest_at_the_distance(seed):
    """Integrating the phases gives the distance and no velocity."""
    generator = np.random.default_rng(seed)
    for _ in range(50):
        distance, velocity = generator.uniform(-3, 3), generator.uniform(-1, 1)
        position, speed = 0.0, velocity
        for duration, acceleration in plan_trapezoid(distance, velocity, 1.0, 0.7):
            position += speed * duration + 0.5 * acceleration * duration**2
            speed += acceleration * duration
            assert abs(speed) <= 1.0 + 1e-12
        assert position == pytest.approx(distance, abs=1e-12)
        assert speed == pytest.approx(0.0, abs=1e-12)


def test_equation_9_leads_by_the_sum_of_the_time_constants():
    """theta_1^* = theta_1^r + KT'/KT theta_1^r', and a complex pair counts real."""
    assert constant_velocity_target(ReferenceSample(2.0, -0.4), 2.5) == 1.0
    assert compute_lead_time([-1 + 1j, -1 - 1j]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ((0.0, 1.0), "max_speed"),
        ((1.0, -1.0), "max_acceleration"),
        ((1.0, 1.0, -0.1), "smoothing_time"),
    ],
)
def test_wrong_limits_are_refused(arguments, key):
    """The error names the setting."""
    with pytest.raises(InvalidSettingError, match=key):
        RampReference(*arguments)
    ramp = RampReference(1.0, 1.0)
    with pytest.raises(InvalidSettingError, match="dt"):
        ramp.advance(0.0)
    with pytest.raises(InvalidSettingError, match="target"):
        ramp.target = np.nan


@pytest.mark.parametrize("speed", [0.3, -0.6])
def test_cruise_comes_to_its_speed_and_keeps_it(speed):
    """The speed is met within the acceleration limit and kept for as long as it is."""
    dt = 0.01
    ramp = RampReference(SPEED, ACCELERATION, WINDOW)
    ramp.cruise(speed)
    samples = record(ramp, 4000, dt)
    assert np.abs(samples[:, 2]).max() <= ACCELERATION * (1 + 1e-9)
    duration = abs(speed) / ACCELERATION + WINDOW
    after = samples[round(duration / dt) :]
    np.testing.assert_allclose(after[:, 1], speed, atol=1e-9)
    np.testing.assert_allclose(np.diff(after[:, 0]), speed * dt, atol=1e-9)
    assert not ramp.is_at_rest
    assert np.isnan(ramp.target)


def test_repeating_the_speed_changes_nothing():
    """A speed that is commanded at every tick is one command."""
    once, often = (RampReference(SPEED, ACCELERATION, WINDOW) for _ in range(2))
    once.cruise(0.2)
    for _ in range(500):
        often.cruise(0.2)
        assert often.advance(0.01) == once.advance(0.01)


@pytest.mark.parametrize("speed", [0.2, 0.9])
@pytest.mark.parametrize("distance", [-1.0, 0.5, 6.0])
def test_target_ends_a_cruise(speed, distance):
    """From any cruise, also above the speed of other ways, the target is reached."""
    dt = 0.01
    ramp = RampReference(SPEED, ACCELERATION, WINDOW)
    ramp.cruise(speed)
    cruise = record(ramp, 1000, dt)
    ramp.target = cruise[-1, 0] + distance
    samples = np.vstack((cruise, record(ramp, 4000, dt)))
    assert np.abs(samples[:, 2]).max() <= ACCELERATION * (1 + 1e-9)
    assert np.abs(np.diff(samples[:, 1])).max() <= ACCELERATION * dt * (1 + 1e-6)
    assert samples[-1].tolist() == [ramp.target, 0.0, 0.0, 0.0]
    assert ramp.is_at_rest
