"""Laws of the pendulum with legs and trunk, and its second route: the whole body."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ballsim_controllers.body_pendulum import (
    BALL,
    STATE_SIZE,
    TILT,
    BodyCoupling,
    SettledMotion,
    TrunkResponse,
    body_matrices,
    compute_coupling,
)
from ballsim_controllers.messages import BallParameters
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.wheeled_lip import (
    BallPendulumParameters,
    discretise,
    state_matrices,
)
from ballsim_controllers.whole_body.accelerations import (
    WholeBodyAccelerations,
)
from ballsim_controllers.whole_body.forces import (
    ContactForces,
    ForceDistribution,
    ForceLimits,
)
from ballsim_controllers.whole_body.nominal_stance import (
    NominalStance,
    solve_nominal_stance,
)

if TYPE_CHECKING:
    from tests.controllers.conftest import PlainAxis

RADII = (0.25, 0.5, 0.75, 1.0)
LAG = 0.02
TRUNK = TrunkResponse(stiffness=100.0, damping=20.0, compliance=300.0)
AXES = ((0, 1, -1.0), (1, 0, 1.0))  # axis, about, sign of a tilt against the axis


def parameters(radius: float, height: float = 0.874) -> BallPendulumParameters:
    """Return a robot of 65 kg on one of the paper's balls."""
    return BallPendulumParameters(BallParameters(radius, 40.0, 0.5), 65.0, height, 9.81)


# -- matrices ------------------------------------------------------------------


@pytest.mark.parametrize("radius", RADII)
def test_without_coupling_the_plain_pendulum_remains(radius: float) -> None:
    """Massless legs and a free force leave the pendulum on a ball, and its lag."""
    params = parameters(radius)
    still = TrunkResponse(stiffness=0.0, damping=0.0, compliance=0.0)
    A, B = body_matrices(params, BodyCoupling(0.0, 0.05), still, LAG, 4.0)
    plain = state_matrices(params, LAG)
    np.testing.assert_allclose(A[:TILT, :TILT], plain.A, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(B[:TILT, :1], plain.B, rtol=1e-12)
    np.testing.assert_array_equal(A[:TILT, TILT:], 0.0)
    np.testing.assert_array_equal(A[TILT:, :TILT], 0.0)


@pytest.mark.parametrize("radius", RADII)
def test_stiff_force_leaves_the_pendulum_to_itself(radius: float) -> None:
    """Where no deviation of the force is allowed, the trunk answers for the legs."""
    params = parameters(radius)
    coupling = BodyCoupling(0.058, 0.046)
    dear = TrunkResponse(stiffness=100.0, damping=20.0, compliance=1e12)
    A, B = body_matrices(params, coupling, dear, LAG, 4.0)
    plain = state_matrices(params, LAG)
    np.testing.assert_allclose(A[:TILT, :TILT], plain.A, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(A[:TILT, TILT:], 0.0, atol=1e-6)
    # All of the legs' angular momentum, and nothing else, turns the trunk.
    expected = -(4.0 * coupling.leg * A[3] - 2.0 * coupling.leg * A[1]) / coupling.trunk
    np.testing.assert_allclose(A[6], expected, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(B[:4, 0], 0.0)


def test_trunk_without_inertia_is_a_limit() -> None:
    """The limit eta -> 0 is the pendulum with massive legs, not a division by zero."""
    params, leg = parameters(0.5), 0.05
    A, _ = body_matrices(params, BodyCoupling(leg, 0.0), TRUNK, LAG, 4.0)
    near, _ = body_matrices(params, BodyCoupling(leg, 1e-9), TRUNK, LAG, 4.0)
    np.testing.assert_allclose(A, near, atol=1e-4)


@pytest.mark.parametrize("carried_feet", [4.0, 3.0])
@pytest.mark.parametrize("radius", RADII)
def test_angular_momentum_balances(radius: float, carried_feet: float) -> None:
    """Legs' and trunk's momentum is what the force's deviation exerts about the CoM."""
    params, coupling = parameters(radius), BodyCoupling(0.06, 0.05)
    A, B = body_matrices(params, coupling, TRUNK, LAG, carried_feet)
    w2 = params.natural_frequency_squared
    for z in np.random.default_rng(0).normal(size=(10, STATE_SIZE)):
        rate = A @ z + B @ (0.3, 20.0)
        com, ball, tilt = rate[1], rate[3], rate[6]
        momentum = coupling.leg * (carried_feet * ball + 20.0 - 2.0 * com)
        momentum += coupling.trunk * tilt
        deviation = com - w2 * (z[0] - z[4])
        assert momentum == pytest.approx(deviation, abs=1e-9)
        # The ball answers to the CoP and to the whole horizontal force.
        c, slope = params.ball_stiffness, 2.0 * params.ball.radius / params.gravity
        assert ball == pytest.approx(c * (z[4] - z[2] - slope * com), abs=1e-9)


def test_trunk_answers_by_least_squares() -> None:
    """The trunk's deviation is -w times its effect on x'' times the deviation of x''.

    This minimises (trunk - wanted)^2 + w (x'' - pendulum)^2 where the ball's
    acceleration is given, as in `whole_body.forces`. The momentum balance
    (1 + 2 leg) x'' = ... + eta * trunk gives the effect.
    """
    params, coupling = parameters(0.5), BodyCoupling(0.06, 0.05)
    A, _ = body_matrices(params, coupling, TRUNK, LAG, 4.0)
    effect = coupling.trunk / (1.0 + 2.0 * coupling.leg)
    for z in np.random.default_rng(1).normal(size=(10, STATE_SIZE)):
        rate = A @ z
        deviation = rate[1] - params.natural_frequency_squared * (z[0] - z[4])
        wanted = -TRUNK.stiffness * z[5] - TRUNK.damping * z[6]
        expected = -TRUNK.compliance * effect * deviation
        assert rate[6] - wanted == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("radius", RADII)
def test_place_on_the_floor_does_not_matter(radius: float) -> None:
    """Moving CoM, ball and CoP alike, and the command with them, changes nothing."""
    A, B = body_matrices(parameters(radius), BodyCoupling(0.06, 0.05), TRUNK, LAG, 4.0)
    shift = np.zeros(STATE_SIZE)
    shift[[0, BALL, 4]] = 1.0
    np.testing.assert_allclose(A @ shift + B[:, 0], 0.0, atol=1e-12)


@pytest.mark.parametrize("radius", RADII)
def test_settled_state_is_a_motion_of_the_pendulum(radius: float) -> None:
    """At constant acceleration the settled state obeys the model with massless legs."""
    params = parameters(radius)
    still = TrunkResponse(stiffness=0.0, damping=0.0, compliance=0.0)
    A, B = body_matrices(params, BodyCoupling(0.0, 0.05), still, LAG, 4.0)
    acceleration, time = 0.07, np.linspace(0.0, 3.0, 7)
    angles = np.column_stack(
        (0.5 * acceleration * time**2, acceleration * time, np.full(7, acceleration))
    )
    # Twice the motion in units of half a metre is the motion.
    states, commands = SettledMotion(params, LAG).follow(2.0 * angles, 0.5)
    rates = states @ A.T + np.outer(commands, B[:, 0])
    expected = np.zeros((7, STATE_SIZE))
    expected[:, [0, 2, 4]] = (acceleration * time)[:, None]
    expected[:, [1, 3]] = acceleration
    np.testing.assert_allclose(rates, expected, atol=1e-10)


@pytest.mark.parametrize("radius", RADII)
def test_feedback_has_the_wanted_poles(
    axis: Callable[[float], PlainAxis], radius: float
) -> None:
    """The core, trunk held, closed by K has the placed poles in both supports."""
    plain = axis(radius)
    wanted = np.sort(np.exp(np.array([-50.0, -6.1, -6.0, -2.1, -2.0]) * 0.02))
    for carried_feet, cell in ((4.0, plain.model.double), (3.0, plain.model.single)):
        A, B = body_matrices(
            plain.params, plain.coupling, plain.trunk, LAG, carried_feet
        )
        core = discretise(A[:TILT, :TILT], B[:TILT, :1], 0.02)
        closed = core.A - core.B @ cell.gain[None, :TILT]
        np.testing.assert_allclose(
            np.sort(np.linalg.eigvals(closed).real), wanted, atol=1e-5
        )
        np.testing.assert_array_equal(cell.gain[TILT:], 0.0)


@pytest.mark.parametrize("radius", RADII)
def test_feedback_is_stable_with_the_trunk(
    axis: Callable[[float], PlainAxis], radius: float
) -> None:
    """The trunk, which the feedback does not see, leaves the closed loop stable."""
    for cell in (axis(radius).model.double, axis(radius).model.single):
        closed = cell.transition - np.outer(cell.input, cell.gain)
        assert np.abs(np.linalg.eigvals(closed)).max() < 1.0


# -- second route: force distribution and rigid bodies ---------------------------


def distribute(
    robot: RobotModel,
    stance: NominalStance,
    params: BallPendulumParameters,
    axis: int,
    cop: float,
    ball_acceleration: float,
    tilt_acceleration: float,
) -> ContactForces:
    """Return what the whole-body layer does for a CoP in the nominal stance."""
    limits = ForceLimits(
        0.085,
        0.035,
        pitch_compliance=TRUNK.compliance,
        roll_compliance=TRUNK.compliance,
    )
    forces = ForceDistribution(robot, limits)
    robot.update(stance.qpos, np.zeros(robot.model.nv))
    robot.update_dynamics()
    target = np.zeros(2)
    target[axis] = cop
    contacts, shares = forces.place_contacts(target, (True, True), (0.0, 0.0))
    np.testing.assert_allclose(shares @ contacts[:, :2], target, atol=1e-6)
    acceleration = np.zeros(3)
    acceleration[axis] = ball_acceleration
    spin = np.array([-acceleration[1], acceleration[0], 0.0]) / params.ball.radius
    touching = np.array([foot.position for foot in robot.feet])
    soles = np.zeros((2, 6))
    soles[:, :3] = np.cross(spin, touching)  # the ball rolls about the origin
    trunk = np.zeros(3)
    trunk[AXES[axis][1]] = AXES[axis][2] * tilt_acceleration
    com = robot.position_com_in_world
    place = np.append(target, shares @ contacts[:, 2])
    lever = com - place
    push = robot.mass * params.gravity * lever[:2] / lever[2]
    upper = np.zeros(len(robot.upper_dofs))
    wanted = WholeBodyAccelerations(trunk, 0.0, push, soles, upper)
    return forces.solve(wanted, touching, contacts, shares)


def roll_of_ball(
    forces: ContactForces, params: BallPendulumParameters, axis: int
) -> float:
    """Return the ball's acceleration from its angular momentum about the floor."""
    about, sign = AXES[axis][1], -AXES[axis][2]
    moment = np.cross(forces.contacts, -forces.forces).sum(axis=0)
    ball = params.ball
    inertia = ball.inertia + ball.mass * ball.radius**2
    return float(sign * moment[about] * ball.radius / inertia)


def compare_with_whole_body(
    robot: RobotModel, radius: float, axis: int, tolerance: float
) -> None:
    """Compare A z with the whole body's answer to a CoP and to a tilt.

    The other route: the force distribution on the rigid-body model in the
    nominal stance, both soles moving with the ball's surface, and the ball's
    own equation of motion under the forces that come out.
    """
    stance = solve_nominal_stance(robot, radius)
    params = parameters(radius, stance.com_height)
    coupling = compute_coupling(robot, stance.qpos, stance.com_height)[axis]
    A, _ = body_matrices(params, coupling, TRUNK, LAG, 4.0)
    about, sign = AXES[axis][1:]
    for cop, tilt in ((0.005, 0.0), (-0.005, 0.0), (0.0, 0.005)):
        z = np.zeros(STATE_SIZE)
        z[4], z[5] = cop, tilt
        rate = A @ z
        wanted = -TRUNK.stiffness * tilt
        result = distribute(robot, stance, params, axis, cop, rate[3], wanted)
        com = result.forces.sum(axis=0)[axis] / robot.mass
        ball = roll_of_ball(result, params, axis)
        trunk = sign * result.trunk_angular[about]
        # x'' is a small difference of what pendulum, legs and trunk do.
        scale = params.natural_frequency_squared * abs(cop)
        scale += coupling.trunk * abs(wanted)
        assert com == pytest.approx(rate[1], abs=tolerance * scale)
        assert ball == pytest.approx(rate[3], rel=tolerance)
        assert trunk == pytest.approx(rate[6], rel=tolerance)
        assert abs(trunk) > 0.2


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("radius", RADII)
def test_linear_model_is_the_whole_body(
    robot: RobotModel, radius: float, axis: int
) -> None:
    """CoM, ball and trunk accelerate as in A z + B u, to a tenth."""
    compare_with_whole_body(robot, radius, axis, 0.1)


@pytest.mark.parametrize("radius", RADII)
def test_lateral_model_is_the_whole_body_closely(
    robot: RobotModel, radius: float
) -> None:
    """Across the heading, where the stance is symmetric, the model is good to 4 %."""
    compare_with_whole_body(robot, radius, 1, 0.04)


@pytest.mark.parametrize("axis", [0, 1])
def test_linear_model_is_exact_to_first_order(robot: RobotModel, axis: int) -> None:
    """Halving the CoP's offset halves every acceleration: the model is a tangent."""
    stance = solve_nominal_stance(robot, 0.5)
    params = parameters(0.5, stance.com_height)
    coupling = compute_coupling(robot, stance.qpos, stance.com_height)[axis]
    A, _ = body_matrices(params, coupling, TRUNK, LAG, 4.0)
    slopes = []
    for cop in (0.008, 0.004, 0.002):
        result = distribute(robot, stance, params, axis, cop, A[3, 4] * cop, 0.0)
        slopes.append(result.forces.sum(axis=0)[axis] / robot.mass / cop)
    assert slopes[1] == pytest.approx(slopes[0], rel=0.02)
    assert slopes[2] == pytest.approx(slopes[1], rel=0.01)
