"""Heading from the direction in which the ball rolls: what it finds, and when not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from ballsim_controllers.estimation.ball import BALL_STATE
from ballsim_controllers.estimation.corrections import (
    N_HEADING_ERRORS,
    TILT_STATE,
    correct,
)
from ballsim_controllers.estimation.error_covariance import N_ERRORS, Levers
from ballsim_controllers.estimation.heading import correct_heading
from ballsim_controllers.estimation.rolling import make_level
from ballsim_controllers.geometry import rotation_from_vector
from ballsim_controllers.messages import Array
from ballsim_controllers.sensor_figures import SensorFigures

_DT, _RADIUS, _HEIGHT = 0.005, 0.5, 0.9
_LEVERS = Levers(
    imu_over_contact=1.0,
    imu_over_trunk=0.1,
    trunk_over_ball=1.4,
    com_over_contact=_HEIGHT,
    radius=_RADIUS,
)
_MID = SensorFigures(
    gyro_noise=2.4e-4,
    gyro_bias=5e-4,
    ball_gyro_noise=2.4e-4,
    ball_gyro_bias=5e-4,
    ball_gyro_scale=3e-3,
    ball_gyro_axes=3e-3,
)
_QUIET, _NONE, _EXACT = np.zeros(10), np.zeros(3), np.zeros((3, 3))
_UNKNOWN = _MID.ball_gyro_bias**2  # variance: nothing has been found elsewhere


class _Rolling:
    """A trunk over a ball that rolls, as an estimator with a wrong heading sees it.

    The trunk does not turn, nor does the ball spin, unless noise says so.
    """

    def __init__(
        self,
        figures: SensorFigures,
        velocity: Array,
        ball_bias: Array = _NONE,
        ball_axes: Array = _EXACT,
        levers: Levers = _LEVERS,
    ) -> None:
        """Start; the ball's gyro has a bias and wrong axes, (3,), [rad/s], (3, 3)."""
        self.levels = make_level(_DT, figures, levers)
        self.tilts, self.balls = np.zeros(1, TILT_STATE), np.zeros(1, BALL_STATE)
        self.tilts["rotation"], self.balls["rotation"] = np.eye(3), np.eye(3)
        self._velocity = np.array([*velocity, 0.0])
        self.omega = np.array([-velocity[1], velocity[0], 0.0]) / _RADIUS
        self._ball, self._ball_bias, self._axes = np.eye(3), ball_bias, ball_axes
        self._place = np.zeros(3)
        self.bias_variance = _UNKNOWN  # that is found elsewhere while the ball rests
        self.both_bear = False  # of both soles

    @property
    def heading(self) -> float:
        """Heading that is estimated, [rad]; the true one is 0."""
        rotation = self.tilts["rotation"][0]
        return float(np.arctan2(rotation[1, 0], rotation[0, 0]))

    @property
    def direction(self) -> float:
        """By how much the ball seems to roll too far to the left, [rad]."""
        error = self.balls["rotation"][0] @ self._ball.T
        return float(np.arctan2(error[1, 0], error[0, 0]))

    @property
    def bias(self) -> float:
        """Bias of the trunk's gyro about the vertical that is estimated, [rad/s]."""
        return float(self.tilts["gyro_bias"][0, 2])

    @property
    def ball_bias(self) -> Array:
        """What is not known of the bias of the ball's gyro, in the ball, (3,)."""
        left: Array = self._ball_bias - self.balls["bias"][0]
        return left

    @property
    def ball_axes(self) -> Array:
        """What is not known of scale and axes of the ball's gyro, (3, 3)."""
        left: Array = self._axes - self.balls["axes"][0]
        return left

    @property
    def strayed(self) -> Array:
        """How far the ball is from where it seems to be on the floor, (2,), [m]."""
        left: Array = (self._place - self.balls["position"][0])[:2]
        return left

    def advance(self, bias: float, place: Array, noise: Array = _QUIET) -> None:
        """Advance by a period.

        Args:
            bias: Of the trunk's gyro about the vertical, [rad/s].
            place: Of the trunk over the ball as measured, (3,), [m].
            noise: Of both gyros, the ball's on three axes, of what soles turn all the
                same and the ball spins, [rad/s], of the legs, [m/s], and of how far
                the ball has spun and soles that stand have turned, [rad], shape (10,).
        """
        tilt, ball = self.tilts[0], self.balls[0]
        true = self.omega + np.array([0.0, 0.0, noise[5]])
        turn, rate = bias - tilt["gyro_bias"][2], self._ball.T @ true
        rate = rate + self._axes @ rate + self.ball_bias
        omega = ball["rotation"] @ (rate - ball["axes"] @ rate)
        ball["mean_angular_velocity"] = omega
        ball["mean_linear_velocity"] = _RADIUS * np.array([omega[1], -omega[0], 0.0])
        ball["position"] += _DT * ball["mean_linear_velocity"]
        self._place += _DT * self._velocity
        tilt["rotation"] = _turned(_DT * (turn + noise[0])) @ tilt["rotation"]
        turned = _DT * (omega + noise[1:4])
        ball["rotation"] = rotation_from_vector(turned) @ ball["rotation"]
        self._ball = rotation_from_vector(_DT * true) @ self._ball
        # The feet are carried off at twice the ball's speed, seen from the trunk.
        feet = _turned(self.heading) @ self._velocity
        trunk = 2.0 * ball["mean_linear_velocity"] - feet
        trunk[:2] += noise[6:8]
        turning = turn - omega[2] + noise[4] + noise[0] - noise[3]
        self.levels["spin"] += noise[8]
        self.levels["pivot"] += noise[9]
        correct_heading(
            self.levels,
            self.tilts,
            self.balls,
            place,
            trunk,
            turning,
            self.both_bear,
            1.0,
            self.bias_variance,
        )
        self.levels["spin"] -= noise[8]
        self.levels["pivot"] -= noise[9]


def _turned(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("direction", [0.0, 1.0, np.pi / 2, -2.5])
def test_bias_is_found_where_the_ball_rolls(direction: float) -> None:
    speed = 0.3 * np.array([np.cos(direction), np.sin(direction)])
    rolling = _Rolling(_MID, speed)
    for _ in range(int(60.0 / _DT)):
        rolling.advance(1e-3, np.zeros(3))
    assert abs(rolling.heading) < 6e-3  # 60e-3 without
    assert rolling.bias == pytest.approx(1e-3, rel=0.1)


def test_heading_follows_the_ball() -> None:
    """The trunk ends up as far off as the direction in which the ball rolls."""
    rolling = _Rolling(_MID, np.array([0.4, 0.0]))
    for _ in range(int(60.0 / _DT)):
        rolling.advance(1e-3, np.zeros(3))
    assert rolling.heading == pytest.approx(rolling.direction, abs=5e-4)


def test_direction_does_not_matter() -> None:
    """What is found is the same whichever way the ball rolls."""
    found = []
    for direction in (0.0, 0.7, 2.0):
        speed = 0.3 * np.array([np.cos(direction), np.sin(direction)])
        rolling = _Rolling(_MID, speed)
        for _ in range(1000):
            rolling.advance(1e-3, np.zeros(3))
        found.append((rolling.heading, rolling.bias))
    np.testing.assert_allclose(found, found[:1] * 3, rtol=1e-3)


def test_ball_at_rest_tells_nothing_but_by_the_soles() -> None:
    """The place over a ball that stands still says nothing of directions."""
    noisy, quiet = _Rolling(_MID, np.zeros(2)), _Rolling(_MID, np.zeros(2))
    rng = np.random.default_rng(0)
    for _ in range(1000):
        noisy.advance(1e-3, 0.01 * rng.standard_normal(3))
        quiet.advance(1e-3, np.zeros(3))
    assert noisy.heading == pytest.approx(quiet.heading, rel=1e-4)
    assert noisy.bias == pytest.approx(quiet.bias, rel=1e-3)
    assert 0.0 < quiet.bias < 1e-3


def test_axes_are_found_before_the_trunk_has_turned_away() -> None:
    """Beside a good gyro of the trunk it shows that the ball rolls off to the side."""
    axes = np.zeros((3, 3))
    axes[0, 1] = 3e-3  # what the ball rolls about seems to roll it to the right, too
    good = replace(_MID, gyro_noise=2.4e-5, gyro_bias=1e-6)
    rolling = _Rolling(good, np.array([0.4, 0.0]), _NONE, axes)
    for _ in range(int(60.0 / _DT)):
        rolling.advance(0.0, np.zeros(3))
    assert abs(rolling.ball_axes[0, 1]) < 0.2 * 3e-3


def test_floor_tells_of_the_balls_gyro() -> None:
    """What a ball seems to spin at rest is a bias, when it rolls wrong axes, too."""
    resting = _Rolling(_MID, np.zeros(2), np.array([0.0, 0.0, 5e-4]))
    for _ in range(int(10.0 / _DT)):
        resting.advance(0.0, np.zeros(3))
    assert abs(resting.ball_bias[2]) < 0.2 * 5e-4
    axes = np.zeros((3, 3))
    axes[2, 1] = 3e-3  # what the ball rolls about seems to spin it, too
    rolling = _Rolling(_MID, np.array([0.4, 0.0]), _NONE, axes)
    for _ in range(int(10.0 / _DT)):
        rolling.advance(0.0, np.zeros(3))
    assert abs(rolling.ball_axes[2, 1]) < 0.2 * 3e-3


def test_soles_that_stand_hold_the_heading() -> None:
    """The bias is found in seconds, and what it has turned is turned back."""
    found, headings = [], []
    for both_bear in (True, False):
        resting = _Rolling(_MID, np.zeros(2))
        resting.both_bear = both_bear
        for _ in range(int(10.0 / _DT)):
            resting.advance(1e-3, np.zeros(3))
        found.append(resting.bias / 1e-3)
        headings.append(abs(resting.heading))
    assert found[0] > 0.9
    assert 0.0 < found[1] < 0.5 * found[0]
    assert headings[0] < 5e-4
    assert 4e-3 < headings[1] < 1e-2  # by which the bias has turned it


def test_soles_that_step_tell_less_where_they_creep_more() -> None:
    """On the flank of a small ball, and where zero positions of the legs are off."""
    found = []
    for radius, zeros in ((1.0, 0.0), (1.0, 1e-3), (1.0, 5e-3), (0.25, 0.0)):
        figures = replace(_MID, encoder_bias=zeros)
        levers = replace(_LEVERS, radius=radius)
        stepping = _Rolling(figures, np.zeros(2), levers=levers)
        for _ in range(int(10.0 / _DT)):
            stepping.advance(1e-3, np.zeros(3))
        found.append(stepping.bias / 1e-3)
    assert 1.0 > found[0] > found[1] > found[2] > found[3] > 0.0
    assert found[0] > 0.7
    assert found[2] < 0.1


def test_soles_that_slip_are_believed() -> None:
    """A turn of a tenth of a radian in a tenth of a second is no bias."""
    resting = _Rolling(_MID, np.zeros(2))
    resting.both_bear = True
    slip = np.zeros(10)
    slip[4] = 1.0
    for k in range(2000):
        resting.advance(0.0, np.zeros(3), slip if 1000 <= k < 1020 else _QUIET)
    assert abs(resting.bias) < 5e-5
    assert abs(resting.heading) < 1e-3


def test_ball_that_slips_is_believed() -> None:
    """A tenth of a radian in a tenth of a second is no error of a gyro."""
    rolling = _Rolling(_MID, np.array([0.4, 0.0]))
    slip = np.zeros(10)
    slip[5] = 1.0
    for k in range(2000):
        rolling.advance(0.0, np.zeros(3), slip if 1000 <= k < 1020 else _QUIET)
    np.testing.assert_allclose(rolling.ball_bias, 0.0, atol=5e-5)
    assert abs(rolling.direction) < 3e-3


def test_way_is_corrected_by_what_is_found_later() -> None:
    """Way and direction fit: where the ball was too is moved by what is found out."""
    rolling = _Rolling(_MID, np.array([0.4, 0.0]), np.array([5e-4, 0.0, 0.0]))
    turned = rotation_from_vector(np.array([0.0, 0.0, 5e-3]))
    rolling.balls["rotation"][0] = turned  # all the way rolled in a wrong direction
    rolling.levels["heading_covariance"][0, 8, 8] = 5e-3**2
    for _ in range(int(20.0 / _DT)):
        rolling.advance(0.0, np.zeros(3))
    assert abs(rolling.strayed[1]) < 5e-3  # 9e-3 where the way stays as it was


def test_at_rest_the_horizontal_bias_is_found_elsewhere() -> None:
    """Nothing of it is found here, and it is as certain as it is said to be."""
    bias = np.array([5e-4, -3e-4, 4e-4])
    resting = _Rolling(_MID, np.zeros(2), bias)
    resting.balls["rotation"][0] = resting._ball = rotation_from_vector(
        np.array([1.0, 0.4, -0.7])
    )
    resting.bias_variance = (1e-4) ** 2
    rng = np.random.default_rng(0)
    for _ in range(1000):
        resting.advance(0.0, 0.003 * rng.standard_normal(3))
    attitude = resting.balls["rotation"][0]
    found = attitude @ resting.balls["bias"][0]
    np.testing.assert_allclose(found[:2], 0.0, atol=1e-6)
    P = resting.levels["heading_covariance"][0, 9:12, 9:12]
    horizontal = np.diagonal(attitude @ P @ attitude.T)[:2]
    assert 0.5 * horizontal.sum() == pytest.approx((1e-4) ** 2, rel=0.01)


def test_what_is_taken_over_leaves_a_covariance() -> None:
    """Symmetric, not negative, and of what is vertical as uncertain as before."""
    resting = _Rolling(_MID, np.zeros(2))
    resting.balls["rotation"][0] = rotation_from_vector(np.array([1.0, 0.4, -0.7]))
    for _ in range(200):
        resting.advance(0.0, np.zeros(3))
    P = resting.levels["heading_covariance"][0]
    up = resting.balls["rotation"][0][2]
    before = up @ P[9:12, 9:12] @ up
    resting.bias_variance = 1e-12
    resting.advance(0.0, np.zeros(3))
    np.testing.assert_allclose(P, P.T, atol=1e-18)
    assert np.linalg.eigvalsh(P).min() > -1e-18
    assert up @ P[9:12, 9:12] @ up == pytest.approx(before, rel=0.01)


def test_sway_is_no_rolling() -> None:
    """The ball rolls once it goes somewhere, and the other filter leaves its bias."""
    rolling, biases = _Rolling(_MID, np.zeros(2)), []
    gains = np.ones(N_ERRORS)
    for k in range(600):
        sway = 0.15 * np.sin(8.0 * k * _DT)
        rolling.omega[:] = 0.0, sway if k < 400 else 0.2, 0.0
        rolling.advance(0.0, np.zeros(3))
        before = rolling.balls["bias"].copy()
        correct(rolling.tilts, rolling.levels, rolling.balls, gains, 1e-9 * np.ones(2))
        biases.append(np.any(rolling.balls["bias"] != before))
    assert all(biases[:400])
    assert not any(biases[500:])


def test_perfect_gyros_are_left_alone() -> None:
    """No bit of an attitude changes, whatever contacts and soles say."""
    figures = SensorFigures(encoder_bias=1e-3)
    levels = make_level(_DT, figures, _LEVERS)
    tilts, balls = np.zeros(1, TILT_STATE), np.zeros(1, BALL_STATE)
    rng = np.random.default_rng(0)
    attitude = rotation_from_vector(rng.standard_normal(3))
    tilts["rotation"] = balls["rotation"] = attitude
    for _ in range(1000):
        balls["mean_angular_velocity"] = rng.standard_normal(3)
        place, velocity = 0.01 * rng.standard_normal(3), rng.standard_normal(3)
        turning = rng.standard_normal()
        correct_heading(levels, tilts, balls, place, velocity, turning, True, 1.0, 0.0)
    for record in (tilts, balls):
        assert np.array_equal(record["rotation"][0], attitude)
    assert not tilts["gyro_bias"].any()
    for name in ("bias", "axes", "position"):
        assert not balls[name].any()


@pytest.mark.parametrize("both_bear", [False, True])
def test_errors_are_as_large_as_said(both_bear: bool) -> None:
    """NEES of directions, biases and way over runs that err as the filter believes.

    Once the robot walks, once it stands for good.
    """
    n_runs, n_ticks = 60, 2000
    rng = np.random.default_rng(1)
    velocity = np.zeros(2) if both_bear else np.array([0.2, -0.1])
    level = make_level(_DT, _MID, _LEVERS)[0]
    growth = np.sqrt(level["heading_process"]) / _DT
    of_place, of_ball, of_soles = np.sqrt(level["heading_variances"])
    start = np.sqrt(np.diagonal(level["heading_covariance"]))
    # What adds to turns is noise of the gyros, too, which is drawn already.
    creep = np.sqrt(growth[21] ** 2 - growth[8] ** 2)
    sole_creep = np.hypot(creep, 0.0 if both_bear else level["sole_creep"] ** 0.5 / _DT)
    of_pivot = of_ball if both_bear else of_soles
    squares = np.zeros(9)
    for _ in range(n_runs):
        draw = start * rng.standard_normal(N_HEADING_ERRORS)
        bias, ball_bias, axes = draw[3], draw[9:12], draw[12:21].reshape(3, 3)
        rolling = _Rolling(_MID, velocity, ball_bias, axes)
        rolling.both_bear = both_bear
        rolling.levels["heading_place"][0] = -draw[:2]
        for _ in range(n_ticks):
            walk = growth * rng.standard_normal(N_HEADING_ERRORS)
            sole, spin = (sole_creep, creep) * rng.standard_normal(2)
            rolling.advance(
                bias,
                of_place * rng.standard_normal(3),
                np.array(
                    [
                        *[walk[2], *walk[6:9], sole, spin, *walk[:2]],
                        *(of_ball, of_pivot) * rng.standard_normal(2),
                    ]
                ),
            )
        P = rolling.levels["heading_covariance"][0]
        errors = [-rolling.heading, bias - rolling.bias, *rolling.strayed]
        errors += [-rolling.direction, *rolling.ball_bias, rolling.ball_axes[0, 1]]
        indices = [2, 3, 4, 5, 8, 9, 10, 11, 13]
        squares += np.square(errors) / np.diagonal(P)[indices]
    low, high = chi2.ppf([0.0025, 0.9975], n_runs) / n_runs
    assert np.all((low < squares / n_runs) & (squares / n_runs < high)), squares
