"""Laws of the reduced models: the paper's and the contact-consistent one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import BallParameters
from ballsim_controllers.wheeled_lip import (
    BallPendulumParameters,
    WheeledLipParameters,
    discretise,
    equilibrium_direction,
    gravity_matrix,
    held_cop_matrix,
    held_cop_wheeled_lip,
    mass_matrix,
    state_matrices,
    velocity_direction,
    wheeled_lip_matrices,
)

RADII = (0.25, 0.5, 0.75, 1.0)
FREE_MODES = {
    0.25: (4.451, 58.296),
    0.5: (4.204, 49.036),
    0.75: (3.909, 44.666),
    1.0: (3.657, 42.096),
}
HELD_MODES = {
    0.25: (2.267, 12.670),
    0.5: (1.803, 11.166),
    0.75: (1.538, 10.546),
    1.0: (1.362, 10.218),
}
ECHOES = {
    0.25: (-0.049457, -3.846196),
    0.5: (-0.044560, -6.635991),
    0.75: (-0.042035, -9.424774),
    1.0: (-0.040617, -12.212700),
}


def ball_pendulum(radius: float = 0.5, com_height: float = 0.9):
    """Return the contact-consistent model of the paper's robot."""
    ball = BallParameters(radius=radius, mass=40.0, inertia=0.5)
    return BallPendulumParameters(ball, robot_mass=65.0, com_height=com_height)


def unstable_modes(A):
    """Return the unstable eigenvalues, slow first; all must be real."""
    values = np.linalg.eigvals(A)
    unstable = values[values.real > 1e-3]
    assert np.allclose(unstable.imag, 0.0)
    return np.sort(unstable.real)


def test_lagrangian_linearised_upright_gives_mass_and_gravity_matrices():
    """M and G are the Hessians of kinetic and potential energy, upright."""
    sympy = pytest.importorskip("sympy")
    names = "r0 m0 I0 m1 I1 r1 L0 g"
    r0, m0, I0, m1, I1, r1, L0, g = constants = sympy.symbols(names)
    angles = sympy.Matrix(sympy.symbols("th1 th2 th4"))
    rates = sympy.Matrix(sympy.symbols("w1 w2 w4"))
    top = angles[0] + angles[1]
    swing = angles[0] + (1 + r0 / r1) * angles[1] + angles[2]
    com = sympy.Matrix(
        [
            r0 * angles[0] + (r0 + r1) * sympy.sin(top) + L0 * sympy.sin(swing),
            r0 + (r0 + r1) * sympy.cos(top) + L0 * sympy.cos(swing),
        ]
    )
    velocity = com.jacobian(angles) * rates
    swing_rate = (sympy.Matrix([swing]).jacobian(angles) * rates)[0]
    kinetic = (
        (m0 * r0**2 + I0) * rates[0] ** 2
        + m1 * velocity.dot(velocity)
        + I1 * swing_rate**2
    ) / 2
    upright = dict.fromkeys(angles, 0)
    M = sympy.hessian(kinetic, list(rates)).subs(upright)
    G = sympy.hessian(m1 * g * com[1], list(angles)).subs(upright)
    params = WheeledLipParameters(0.7, 31.0, 0.9, 52.0, 1.3, 0.13, 0.77, 9.7)
    values = (0.7, 31.0, 0.9, 52.0, 1.3, 0.13, 0.77, 9.7)
    for symbolic, numeric in ((M, mass_matrix(params)), (G, gravity_matrix(params))):
        expected = sympy.lambdify(constants, symbolic)(*values)
        np.testing.assert_allclose(numeric, expected, rtol=1e-12)


@pytest.mark.parametrize("radius", RADII)
def test_mass_matrix_determinant(radius):
    """Its determinant is I1 m1 (I0 + m0 r0^2) (r0 + r1)^2."""
    p = WheeledLipParameters(radius)
    expected = (
        p.robot_inertia
        * p.robot_mass
        * (p.ball_inertia + p.ball_mass * radius**2)
        * (radius + p.wheel_radius) ** 2
    )
    assert np.linalg.det(mass_matrix(p)) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("radius", RADII)
def test_equilibrium_and_velocity_directions(radius):
    """G T1 = 0, A T = 0 and A T' = T; nothing else is at rest."""
    params = WheeledLipParameters(radius)
    G, A = gravity_matrix(params), wheeled_lip_matrices(params).A
    T, T_rate = equilibrium_direction(params), velocity_direction(params)
    assert np.abs(G @ T[:3]).max() < 1e-12 * np.abs(G).max()
    assert np.linalg.matrix_rank(G) == 2
    assert np.abs(A @ T).max() < 1e-9 * np.abs(A).max()
    np.testing.assert_allclose(A @ T_rate, T, atol=1e-12)


@pytest.mark.parametrize("radius", RADII)
def test_modes_of_the_wheeled_lip(radius):
    """The modes are a double integrator and the two pairs of the reference."""
    A, B = wheeled_lip_matrices(WheeledLipParameters(radius))
    np.testing.assert_allclose(unstable_modes(A), FREE_MODES[radius], atol=6e-4)
    reachable = np.hstack([np.linalg.matrix_power(A / 50.0, i) @ B for i in range(6)])
    observable = np.vstack([np.eye(3, 6), np.eye(3, 6) @ A])
    scaled = reachable / np.linalg.norm(reachable, axis=0)
    assert np.linalg.svd(scaled, compute_uv=False)[-1] > 1e-12
    assert np.linalg.matrix_rank(observable) == 6


@pytest.mark.parametrize("radius", RADII)
def test_modes_with_held_contact(radius):
    """With theta_2'' = 0 the modes and echoes are those of the reference."""
    A, B = held_cop_wheeled_lip(WheeledLipParameters(radius))
    np.testing.assert_allclose(unstable_modes(A), HELD_MODES[radius], atol=6e-4)
    np.testing.assert_allclose(B[[3, 5], 0], ECHOES[radius], rtol=2e-5)


@pytest.mark.parametrize("radius", RADII)
def test_held_contact_equals_equation_18(radius):
    """The elimination gives -M^-1 G + m2^T m2 G / m22 and m2^T / m22."""
    params = WheeledLipParameters(radius)
    inverse, G = np.linalg.inv(mass_matrix(params)), gravity_matrix(params)
    m2, m22 = inverse[1:2], inverse[1, 1]
    A, B = held_cop_wheeled_lip(params)
    expected = -inverse @ G + m2.T @ m2 @ G / m22
    np.testing.assert_allclose(A[3:, :3], expected, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_allclose(B[3:], m2.T / m22, rtol=1e-8)
    assert not A[4].any()


def test_only_gravity_moves_the_angular_momentum_about_the_floor_contact():
    """The CoP is internal: m1 (2r0+h) x'' + (I0+m0 r0^2) b''/r0 = m1 g (x-b)."""
    generator = np.random.default_rng(1)
    for radius in RADII:
        params = ball_pendulum(radius)
        A, B = state_matrices(params)
        state, cop = generator.normal(size=4), generator.normal()
        rate = A @ state + B[:, 0] * cop
        height = 2.0 * radius + params.com_height
        inertia = params.ball.inertia + params.ball.mass * radius**2
        momentum_rate = (
            params.robot_mass * height * rate[1] + inertia / radius * rate[3]
        )
        moment = params.robot_mass * params.gravity * (state[0] - state[2])
        assert momentum_rate == pytest.approx(moment, rel=1e-12)


def test_contact_consistent_model_is_the_limit_of_a_vanishing_wheel():
    """With r1 -> 0 and I1 -> 0 the paper's model moves x and b the same way."""
    lip = WheeledLipParameters(0.5, wheel_radius=1e-5, robot_inertia=1e-9)
    held, r0 = held_cop_wheeled_lip(lip), lip.ball_radius
    params = ball_pendulum(com_height=lip.pendulum_length)
    lean = r0 + lip.wheel_radius
    com = np.array([r0 + lean, lean, 0.0]) + lip.pendulum_length * np.array(
        [1.0, lip.wheel_ratio, 1.0]
    )
    generator = np.random.default_rng(2)
    for _ in range(5):
        position_com, ball_angle, contact, push = generator.normal(size=4)
        swing = position_com - com[:2] @ (ball_angle, contact)
        angles = np.array([ball_angle, contact, swing / com[2]])
        acceleration = held.A[3:, :3] @ angles + held.B[3:, 0] * push
        cop = r0 * ball_angle + r0 * (ball_angle + contact)
        state = np.array([position_com, 0.0, r0 * ball_angle, 0.0])
        A, B = state_matrices(params)
        expected = (A @ state + B[:, 0] * cop)[[1, 3]]
        actual = np.array([com @ acceleration, r0 * acceleration[0]])
        np.testing.assert_allclose(actual, expected, rtol=2e-3, atol=2e-3)


def test_modes_approach_those_of_the_contact_consistent_model():
    """The error of the held modes falls in proportion to the wheel's radius."""
    limit = unstable_modes(held_cop_matrix(ball_pendulum(com_height=0.8)))
    lip = WheeledLipParameters(0.5, robot_inertia=1e-9)
    errors = [
        np.abs(unstable_modes(held_cop_wheeled_lip(replace(lip, wheel_radius=r)).A))
        - limit
        for r in (1e-2, 1e-3, 1e-4)
    ]
    np.testing.assert_allclose(errors[0] / errors[1], 10.0, rtol=0.15)
    np.testing.assert_allclose(errors[1] / errors[2], 10.0, rtol=0.15)
    np.testing.assert_allclose(errors[2], 0.0, atol=2e-3)


def test_held_modes_of_the_contact_consistent_model():
    """They are +-10.4 and +-1.78 at r0 = 0.5 (for h = 0.87)."""
    modes = unstable_modes(held_cop_matrix(ball_pendulum(com_height=0.87)))
    np.testing.assert_allclose(modes, (1.78, 10.4), atol=0.01)
    values = np.sort(np.linalg.eigvals(held_cop_matrix(ball_pendulum())).real)
    np.testing.assert_allclose(values, -values[::-1], atol=1e-9)


def test_rest_and_steady_rolling_are_free_motions():
    """With x = b = p the model rests, or rolls on at any speed."""
    A, B = state_matrices(ball_pendulum())
    np.testing.assert_allclose(A @ [1, 0, 1, 0] + B[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(
        A @ [1, 0.3, 1, 0.3] + B[:, 0], [0.3, 0, 0.3, 0], atol=1e-12
    )


def test_discretisation_is_exact():
    """One step equals many small ones, and the integral of expm."""
    A, B = state_matrices(ball_pendulum())
    whole, part = discretise(A, B, 0.02), discretise(A, B, 0.02 / 16)
    state, cop = np.array([0.1, -0.2, 0.05, 0.3]), np.array([0.07])
    fine = state
    for _ in range(16):
        fine = part.A @ fine + part.B @ cop
    np.testing.assert_allclose(whole.A @ state + whole.B @ cop, fine, rtol=1e-11)
    np.testing.assert_allclose(whole.A, scipy.linalg.expm(A * 0.02), rtol=1e-12)
    closed = np.linalg.solve(A, (whole.A - np.eye(4)) @ B)
    np.testing.assert_allclose(whole.B, closed, rtol=1e-9)


def test_cop_lag_reaches_the_command_with_its_time_constant():
    """The fifth state is the CoP: it covers 1 - 1/e of a step in one lag."""
    params = ball_pendulum()
    A, B = state_matrices(params, cop_lag=0.03)
    step = discretise(A, B, 0.03)
    assert step.B[4, 0] == pytest.approx(1.0 - np.exp(-1.0))
    plain = state_matrices(params)
    np.testing.assert_array_equal(A[:4, :4], plain.A)
    np.testing.assert_array_equal(A[:4, 4:], plain.B)
    assert not B[:4].any()


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_parameters_must_be_positive(value):
    """A parameter that is no positive number is refused by its name."""
    with pytest.raises(InvalidSettingError, match="wheel_radius"):
        WheeledLipParameters(0.5, wheel_radius=value)
    with pytest.raises(InvalidSettingError, match=r"ball\.radius"):
        ball_pendulum(radius=value)
    with pytest.raises(InvalidSettingError, match="com_height"):
        ball_pendulum(com_height=value)
    with pytest.raises(InvalidSettingError, match="cop_lag"):
        state_matrices(ball_pendulum(), cop_lag=value)
    with pytest.raises(InvalidSettingError, match="dt"):
        discretise(np.eye(1), np.eye(1), value)
