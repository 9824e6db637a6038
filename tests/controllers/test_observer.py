"""Laws of the observers: poles, echo zeros, noise-free exactness."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim_controllers.balance.observer import (
    F_S_PAIRS,
    BallPendulumObserver,
    assigned_gain,
    decoupled_gain,
    echo_zeros,
    observer_derivative,
)
from ballsim_controllers.balance.paper_controller import (
    OBSERVER_POLES,
    PaperBalanceController,
)
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import BallParameters
from ballsim_controllers.wheeled_lip import (
    BallPendulumParameters,
    WheeledLipParameters,
    discretise,
    equilibrium_direction,
    held_cop_wheeled_lip,
    state_matrices,
    wheeled_lip_matrices,
)

RADII = (0.25, 0.5, 0.75, 1.0)
F_S_BOTTOM = {
    0.25: "173.4525 -53.1375 0 119.12143 -5709.77143 -2331.97714"
    " -363.7875 22591.6125 9407.16",
    0.5: "196.22571 -30.36429 0 72.01786 -6728.53214 -1360.32"
    " -401.74286 45509.05714 9407.16",
    0.75: "205.79707 -20.79293 0 50.68082 -7149.9633 -960.22588"
    " -409.99402 68456.20598 9407.16",
    1.0: "210.84556 -15.74444 0 38.97576 -7379.90152 -741.99273"
    " -412.98889 91408.61111 9407.16",
}
LARGEST_POLE_OF_CONTROLLER = {0.25: 58.8, 0.5: 70.0, 0.75: 76.3, 1.0: 80.6}


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    """Keep the gains of these tests away from the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


def ball_pendulum(radius=0.5):
    """Return the contact-consistent model of the paper's robot."""
    ball = BallParameters(radius=radius, mass=40.0, inertia=0.5)
    return BallPendulumParameters(ball, robot_mass=65.0, com_height=0.9)


@pytest.mark.parametrize("radius", RADII)
def test_decoupled_gain_of_the_paper(radius):
    """F_S is the reference's, has the paper's poles, and splits the channels."""
    A, _ = wheeled_lip_matrices(WheeledLipParameters(radius))
    F = decoupled_gain(A)
    np.testing.assert_allclose(F[:3], np.diag([54.35, 2.05, 54.5]), atol=1e-9)
    expected = np.array(F_S_BOTTOM[radius].split(), dtype=float).reshape(3, 3)
    np.testing.assert_allclose(F[3:], expected, rtol=1e-6, atol=1e-5)
    closed = A - F @ np.eye(3, 6)
    poles = np.sort(np.linalg.eigvals(closed).real)
    np.testing.assert_allclose(poles, sorted(OBSERVER_POLES), rtol=1e-6)
    for i in range(3):
        others = [j for j in range(6) if j % 3 != i]
        np.testing.assert_allclose(closed[np.ix_([i, i + 3], others)], 0, atol=1e-9)


@pytest.mark.parametrize("radius", RADII)
def test_echo_zeros_of_the_decoupled_gain_are_its_own_poles(radius):
    """They are the pole pairs of theta_1 and theta_4, hence stable."""
    A, B = wheeled_lip_matrices(WheeledLipParameters(radius))
    zeros = echo_zeros(A, B, decoupled_gain(A))
    expected = sorted(F_S_PAIRS[0] + F_S_PAIRS[2])
    np.testing.assert_allclose(zeros, expected, rtol=1e-6)


@pytest.mark.parametrize("radius", RADII)
def test_echo_zeros_of_place_are_unstable(radius):
    """`place` gives the same poles but an unstable echo: the paper's loop falls."""
    A, B = wheeled_lip_matrices(WheeledLipParameters(radius))
    F = assigned_gain(A, OBSERVER_POLES)
    poles = np.sort(np.linalg.eigvals(A - F @ np.eye(3, 6)).real)
    np.testing.assert_allclose(poles, sorted(OBSERVER_POLES), rtol=1e-4)
    # The size depends on the version of the library (48 to 199 rad/s seen).
    assert echo_zeros(A, B, F).real.max() > 10.0


@pytest.mark.parametrize("radius", RADII)
def test_echo_zeros_block_the_way_from_torque_to_contact(radius):
    """At a zero s, theta_2 of (s - A + F C)^-1 B vanishes."""
    A, B = wheeled_lip_matrices(WheeledLipParameters(radius))
    F = assigned_gain(A, OBSERVER_POLES)
    closed = A - F @ np.eye(3, 6)
    for zero in echo_zeros(A, B, F):
        response = np.linalg.solve(zero * np.eye(6) - closed, B)[:, 0]
        assert abs(response[1]) < 1e-6 * np.abs(response).max()


@pytest.mark.parametrize("radius", RADII)
def test_controller_alone_is_unstable(radius):
    """A_c = A - B K - F C has the reference's unstable pole: never freeze y."""
    controller = PaperBalanceController(WheeledLipParameters(radius))
    A, B = controller.model
    closed = A - B @ controller.gain - controller.F @ np.eye(3, 6)
    largest = np.linalg.eigvals(closed).real.max()
    assert largest == pytest.approx(LARGEST_POLE_OF_CONTROLLER[radius], abs=0.06)


def test_controller_step_is_equations_6_and_7():
    """An Euler step is x + dt (A_c x + F y + B K T theta_1*)."""
    params = WheeledLipParameters(0.5)
    controller = PaperBalanceController(params)
    (A, B), K, F = controller.model, controller.gain, controller.F
    generator = np.random.default_rng(3)
    estimate, output = generator.normal(size=6), generator.normal(size=3)
    A_c = A - B @ K - F @ np.eye(3, 6)
    target = B @ K @ equilibrium_direction(params) * 0.7
    expected = estimate + 1e-3 * (A_c @ estimate + F @ output + target)
    actual = controller.update(estimate, output, 0.7, 1e-3)
    np.testing.assert_allclose(actual, expected, rtol=1e-9)


def test_true_output_keeps_a_true_estimate():
    """With y = C x the estimate moves as the model does, whatever F is."""
    model = wheeled_lip_matrices(WheeledLipParameters(0.5))
    state = np.random.default_rng(4).normal(size=6)
    rate = observer_derivative(model, decoupled_gain(model.A), state, 3.0, state[:3])
    np.testing.assert_allclose(rate, model.A @ state + model.B[:, 0] * 3.0)


def test_commanded_cop_in_the_output():
    """A contact that lags moves y by (a1, 1, a3): the option takes that back."""
    params = WheeledLipParameters(0.5)
    plain = PaperBalanceController(params)
    option = PaperBalanceController(params, is_commanded_cop_in_output=True)
    echo = held_cop_wheeled_lip(params).B[3:, 0]
    estimate = np.array([0.1, -0.05, 0.3, 0.0, 0.1, 0.0])
    output = np.array([0.1, -0.05, 0.3])
    lagging = output + 0.02 * echo
    np.testing.assert_allclose(
        option.update(estimate, lagging, 0.5, 1e-3),
        plain.update(estimate, output, 0.5, 1e-3),
        rtol=1e-9,
    )
    on_time = option.update(estimate, output, 0.5, 1e-3)
    expected = plain.update(estimate, output, 0.5, 1e-3)
    np.testing.assert_allclose(on_time, expected, rtol=1e-12)


def test_gain_of_the_wrong_shape_is_refused():
    """The error tells the shape of F."""
    with pytest.raises(InvalidSettingError, match=r"shape \(6, 3\)"):
        PaperBalanceController(WheeledLipParameters(0.5), observer_gain=np.eye(6))


@pytest.mark.parametrize("dt", [1e-3, 5e-3, 0.1])
@pytest.mark.parametrize("radius", RADII)
def test_ball_pendulum_observer_has_its_pole_at_any_step(radius, dt):
    """The error of one step shrinks by exp(pole dt) in every direction."""
    model = state_matrices(ball_pendulum(radius))
    observer = BallPendulumObserver(model, dt, pole=-20.0)
    zero = np.zeros(4)
    step = np.array([observer.update(e, zero, np.zeros(1)) for e in np.eye(4)]).T
    np.testing.assert_allclose(step, np.exp(-20.0 * dt) * np.eye(4), atol=1e-9)


def test_ball_pendulum_observer_is_exact_without_noise():
    """In any motion the error dies out: the CoP is a known input."""
    model, dt = state_matrices(ball_pendulum()), 0.002
    A, B = discretise(*model, dt)
    observer = BallPendulumObserver(model, dt, pole=-30.0)
    generator = np.random.default_rng(5)
    state, estimate = np.array([0.02, 0.1, 0.0, 0.2]), np.zeros(4)
    for _ in range(600):
        cop = state[0] + 0.2 * state[1] + generator.normal(scale=0.01)
        state = A @ state + B[:, 0] * cop
        estimate = observer.update(estimate, state, np.array([cop]))
    assert np.abs(state).max() > 1e-2
    np.testing.assert_allclose(estimate, state, rtol=1e-9, atol=1e-11)


def test_ball_pendulum_observer_averages_noise():
    """The estimate is less noisy than the readings that it came from."""
    model = state_matrices(ball_pendulum())
    observer = BallPendulumObserver(model, 0.002, pole=-30.0)
    generator, estimate, errors = np.random.default_rng(6), np.zeros(4), []
    for _ in range(3000):
        measured = generator.normal(scale=1e-3, size=4)
        estimate = observer.update(estimate, measured, np.zeros(1))
        errors.append(estimate)
    rms = np.sqrt(np.mean(np.square(errors[300:]), axis=0))
    assert (rms < 0.4e-3).all()


def test_unstable_observer_pole_is_refused():
    """A pole that does not decay is an error in the settings."""
    with pytest.raises(InvalidSettingError, match="stable"):
        BallPendulumObserver(state_matrices(ball_pendulum()), 0.002, pole=0.0)
