"""Laws of the ball's estimate: what its gyro says, integrated."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ballsim_controllers.estimation.ball import BallEstimator
from ballsim_controllers.geometry import integrate_rotation
from ballsim_controllers.messages import Array


def track_ball(dt: float, spin: float) -> tuple[float, float, float]:
    """Return the estimator's largest errors of attitude rate, place and heading.

    The truth is integrated in steps of 0.5 ms, midpoint rule; the gyro is exact.
    """
    radius, fine = 0.5, 5e-4
    estimator = BallEstimator(radius, dt)
    rotation, place = np.eye(3), np.zeros(2)
    rate_error = place_error = velocity_error = 0.0
    every = round(dt / fine)

    def angular_velocity(time: float) -> Array:
        return np.array([math.sin(1.3 * time), 0.8 * math.sin(2.1 * time), spin])

    for tick in range(round(4.0 / fine) + 1):
        time = tick * fine
        omega = angular_velocity(time)
        if tick % every == 0:
            estimator.update(rotation.T @ omega)
            rate_error = max(
                rate_error, float(np.abs(estimator.angular_velocity - omega).max())
            )
            place_error = max(
                place_error, float(np.abs(estimator.position[:2] - place).max())
            )
            velocity = radius * np.array([omega[1], -omega[0], 0.0])
            velocity_error = max(
                velocity_error,
                float(np.abs(estimator.linear_velocity - velocity).max()),
            )
        middle = angular_velocity(time + 0.5 * fine)
        rotation = integrate_rotation(rotation, rotation.T @ middle, fine)
        place = place + fine * radius * np.array([middle[1], -middle[0]])
    assert estimator.position[2] == radius
    return rate_error, place_error, velocity_error


@pytest.mark.parametrize("spin", [0.0, 0.7])
def test_ball_rolls_as_its_gyro_says(spin: float) -> None:
    """From the gyro in the rotating ball come rate, place and velocity, spin or not."""
    rate_error, place_error, velocity_error = track_ball(0.004, spin)
    assert rate_error < 1e-4
    assert place_error < 1e-4
    assert velocity_error < 1e-4


def test_ball_estimate_is_of_second_order() -> None:
    """Half the period gives a quarter of the error."""
    coarse, fine = track_ball(0.02, 0.5)[0], track_ball(0.01, 0.5)[0]
    assert 3.0 < coarse / fine < 5.0


def test_spin_alone_does_not_move_the_ball() -> None:
    """Turning about the vertical leaves the ball where it is."""
    estimator = BallEstimator(0.5, 0.004)
    for _ in range(500):
        estimator.update(np.array([0.0, 0.0, 2.0]))
    np.testing.assert_array_equal(estimator.position, [0.0, 0.0, 0.5])
    np.testing.assert_allclose(estimator.angular_velocity, [0.0, 0.0, 2.0], atol=1e-12)


def test_larger_ball_rolls_farther() -> None:
    """Place and velocity are proportional to the radius at the same rotation."""
    places = []
    for radius in (0.25, 1.0):
        estimator = BallEstimator(radius, 0.004)
        for tick in range(200):
            estimator.update(np.array([0.3, math.sin(0.02 * tick), 0.1]))
        places.append(np.append(estimator.position[:2], estimator.linear_velocity))
    np.testing.assert_allclose(places[1], 4.0 * places[0], rtol=1e-12)
