"""Laws of the whole-body layer: from CoP and feet to joint set-points."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ballsim_controllers.footsteps.swing import SwingReference
from ballsim_controllers.geometry import (
    rotation_from_vector,
    rotation_to_quaternion,
    sole_rotation_on_ball,
)
from ballsim_controllers.messages import Array, StateEstimate
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.settings import WheeledLipSettings, load_settings
from ballsim_controllers.whole_body.body_control import (
    BodyCommand,
    BodyControl,
    BodyResult,
)
from ballsim_controllers.whole_body.inverse_kinematics import (
    InverseKinematics,
    PostureTargets,
)
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance

if TYPE_CHECKING:
    from tests.controllers.conftest import Mirror

RADIUS, DT = 0.5, 0.004
SETTINGS = load_settings(WheeledLipSettings, "wheeled-lip", {})
PERIOD = SETTINGS.rates.ik_period_s
LOADED = (318.0, 318.0)


class Bench:
    """The robot in its nominal stance, and what the whole-body layer is given."""

    def __init__(self, robot: RobotModel) -> None:
        """Find the stance."""
        stance = solve_nominal_stance(robot, RADIUS)
        self.robot = robot
        self.pose = stance.qpos
        self.height = stance.com_height

    def control(self) -> BodyControl:
        """Return a fresh whole-body layer with the shipped gains."""
        return BodyControl(self.robot, SETTINGS.forces, RADIUS, PERIOD)

    def step(self, estimate: StateEstimate, command: BodyCommand) -> BodyResult:
        """Return the first answer of a fresh whole-body layer."""
        return self.control().step(estimate, command, DT)

    def estimate(
        self,
        qpos: Array | None = None,
        qvel: Array | None = None,
        loads: tuple[float, float] = LOADED,
        ball_velocity: tuple[float, float] = (0.0, 0.0),
    ) -> StateEstimate:
        """Return the estimate of a state, the robot model left in that state."""
        robot = self.robot
        qpos = self.pose if qpos is None else qpos
        qvel = np.zeros(robot.model.nv) if qvel is None else qvel
        robot.update(qpos, qvel)
        contacts = np.array([foot.position for foot in robot.feet])
        normal, (vx, vy) = np.array(loads), ball_velocity
        return StateEstimate.of(
            time=0.0,
            quaternion_trunk_to_world=qpos[3:7].copy(),
            angular_velocity_trunk_in_trunk=qvel[3:6].copy(),
            position_trunk_in_world=qpos[:3].copy(),
            linear_velocity_trunk_in_world=qvel[:3].copy(),
            position_com_in_world=robot.position_com_in_world,
            linear_velocity_com_in_world=robot.com_velocity(),
            position_ball_in_world=np.array([0.0, 0.0, RADIUS]),
            linear_velocity_ball_in_world=np.array([vx, vy, 0.0]),
            angular_velocity_ball_in_world=np.array([-vy, vx, 0.0]) / RADIUS,
            contacts_in_world=contacts,
            normal_forces=normal,
            cop_in_world=normal @ contacts[:, :2] / max(normal.sum(), 1.0),
        )

    def command(self, **changes: Any) -> BodyCommand:
        """Return the command to stand still, with changes."""
        plain = BodyCommand(
            cop=np.zeros(2),
            stance=(True, True),
            transfer=(0.0, 0.0),
            swing=None,
            com_height=self.height,
            heading=0.0,
            ball_acceleration=np.zeros(2),
        )
        return replace(plain, **changes)


@pytest.fixture
def bench(robot: RobotModel) -> Bench:
    """Return the robot in its nominal stance."""
    return Bench(robot)


def com_acceleration(bench: Bench, result: BodyResult) -> Array:
    """Return the acceleration of the CoM under the contact forces."""
    robot = bench.robot
    gravity = np.array([0.0, 0.0, robot.gravity])
    acceleration: Array = result.forces.forces.sum(axis=0) / robot.mass - gravity
    return acceleration


def test_standing_robot_holds_its_weight(bench: Bench) -> None:
    """In the nominal stance the drives' torques are those that leave it at rest."""
    estimate = bench.estimate()
    result = bench.step(estimate, bench.command())
    np.testing.assert_allclose(result.forces.joint_accelerations, 0.0, atol=1e-6)
    np.testing.assert_allclose(com_acceleration(bench, result), 0.0, atol=1e-6)
    drive = bench.robot.kp * (result.positions - bench.pose[7:])
    np.testing.assert_allclose(drive, result.forces.joint_torques, atol=0.2)
    for target, present in (
        (result.target_com, estimate.position_com_in_world),
        (result.target_soles, estimate.contacts_in_world),
    ):
        np.testing.assert_allclose(target, present, atol=1e-6)


@pytest.mark.parametrize("error", [0.01, -0.02, 0.2, -0.2])
def test_height_is_restored_within_its_limit(bench: Bench, error: float) -> None:
    """The CoM accelerates to its height like a spring, limited both ways."""
    s = SETTINGS.forces
    result = bench.step(
        bench.estimate(), bench.command(com_height=bench.height + error)
    )
    limit = s.max_com_acceleration_m_s2
    expected = min(max(s.height_stiffness * error, -limit), limit)
    assert com_acceleration(bench, result)[2] == pytest.approx(expected, abs=1e-6)


def test_cop_moves_the_com_away(bench: Bench) -> None:
    """The CoM accelerates away from the CoP, about as a pendulum does."""
    estimate = bench.estimate()
    for cop in ([0.02, 0.0], [0.0, -0.02]):
        result = bench.step(estimate, bench.command(cop=np.array(cop)))
        np.testing.assert_allclose(result.forces.cop, cop, atol=1e-6)
        acceleration = com_acceleration(bench, result)[:2]
        pendulum = -bench.robot.gravity / bench.height * np.array(cop)
        assert acceleration @ pendulum > 0.5 * pendulum @ pendulum


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_trunk_is_turned_back(bench: Bench, axis: int) -> None:
    """A tilted or turned trunk accelerates towards upright, straight ahead."""
    for sign in (1.0, -1.0):
        tilt = 0.05 * sign * np.eye(3)[axis]
        tilted = bench.pose.copy()
        tilted[3:7] = rotation_to_quaternion(rotation_from_vector(tilt))
        result = bench.step(bench.estimate(tilted), bench.command())
        assert sign * result.forces.trunk_angular[axis] < -0.5


def test_heading_is_followed(bench: Bench) -> None:
    """The trunk turns to the side where the commanded heading is."""
    for heading in (0.2, -0.2):
        result = bench.step(bench.estimate(), bench.command(heading=heading))
        assert result.forces.trunk_angular[2] * heading > 0.1


def captured_velocities(monkeypatch: pytest.MonkeyPatch) -> list[Array]:
    """Return a list that grows by what the inverse kinematics answers."""
    answers: list[Array] = []
    solve = InverseKinematics.solve

    def record(ik: InverseKinematics, qpos: Array, targets: PostureTargets) -> Array:
        answers.append(solve(ik, qpos, targets))
        return answers[-1]

    monkeypatch.setattr(InverseKinematics, "solve", record)
    return answers


def test_set_points_add_both_roads(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drive torque = tau + kp (q_ik - q): damping is made up for by the set-point.

    All of that in the middle of the tick for which the set-point holds. At the standing
    ankles the damping is made up for the IK's velocity only.
    """
    answers = captured_velocities(monkeypatch)
    qvel = np.random.default_rng(0).normal(scale=0.1, size=bench.robot.model.nv)
    command = bench.command(cop=np.array([0.01, 0.01]))
    result = bench.step(bench.estimate(qvel=qvel), command)
    assert len(answers) == 1
    ik_velocity = answers[0]
    robot, limits = bench.robot, bench.robot.torque_limits
    torque = np.clip(result.forces.joint_torques, -limits, limits)
    gain = DT * result.forces.joint_accelerations
    expected = torque + robot.kp * 0.5 * DT * ik_velocity + robot.kv * gain
    ankles = np.concatenate([leg[4:] - 6 for leg in robot.leg_dofs])
    slip = ik_velocity - qvel[6:]
    expected[ankles] += (robot.kv * (slip - gain))[ankles]
    drive = robot.kp * (result.positions - bench.pose[7:]) - robot.kv * qvel[6:]
    np.testing.assert_allclose(drive, expected, atol=1e-8)
    assert np.abs(slip[ankles]).max() > 0.01


def test_torques_are_limited(bench: Bench) -> None:
    """The feed-forward never asks a drive for more than it has."""
    bench.robot.record["torque_limits"] = 5.0
    result = bench.step(bench.estimate(), bench.command())
    assert np.abs(result.forces.joint_torques).max() > 30.0
    drive = bench.robot.kp * (result.positions - bench.pose[7:])
    assert np.abs(drive).max() < 5.0 + 0.2
    assert np.abs(drive).max() > 4.5


def test_inverse_kinematics_runs_at_its_own_rate(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """mink is asked in the first tick and then once per IK period."""
    answers = captured_velocities(monkeypatch)
    control = bench.control()
    counts = []
    for _ in range(11):
        control.step(bench.estimate(), bench.command(), DT)
        counts.append(len(answers))
    stride = round(PERIOD / DT)
    assert counts == [1 + k // stride for k in range(11)]


def swing_reference(bench: Bench, foot: int, lift: float) -> SwingReference:
    """Return the reference of a sole above where it is."""
    sole = bench.robot.feet[foot]
    normal = sole.position - np.array([0.0, 0.0, RADIUS])
    normal /= np.linalg.norm(normal)
    return SwingReference.of(
        position=sole.position + lift * normal,
        rotation=sole_rotation_on_ball(normal),
        linear_velocity=np.zeros(3),
        linear_acceleration=np.array([0.3, 0.0, 0.5]),
        angular_velocity=np.zeros(3),
        angular_acceleration=np.zeros(3),
    )


@pytest.mark.parametrize("foot", [0, 1])
def test_swinging_foot_carries_nothing(bench: Bench, foot: int) -> None:
    """The other foot carries all, the swinging sole is drawn to its reference.

    Its reference moves with the ball, so the ball's acceleration is added.
    """
    estimate = bench.estimate()
    swing = swing_reference(bench, foot, 0.01)
    stance, ball = (foot != 0, foot != 1), np.array([0.2, -0.1])
    other = bench.robot.feet[1 - foot].position[:2]
    command = bench.command(
        cop=other,
        stance=stance,
        transfer=(1.0, 1.0),
        swing=swing,
        ball_acceleration=ball,
    )
    result = bench.step(estimate, command)
    np.testing.assert_array_equal(result.forces.forces[foot], 0.0)
    assert result.forces.shares.tolist() == [float(s) for s in stance]
    np.testing.assert_allclose(result.forces.cop, other, atol=1e-9)
    # The IK's target of this sole is half of a T^2 ahead.
    pull = swing.linear_acceleration + SETTINGS.forces.swing_stiffness * (
        swing.position - estimate.contacts_in_world[foot]
    )
    pull[:2] += ball
    moved = result.target_soles[foot] - estimate.contacts_in_world[foot]
    np.testing.assert_allclose(moved, 0.5 * PERIOD**2 * pull, atol=1e-9)


def test_bounced_foot_is_led_back(bench: Bench) -> None:
    """A foot that stands but feels nothing gets no load and goes to the ball."""
    lifted = bench.pose.copy()
    knee = 7 + bench.robot.joint_names.index("left_knee")
    lifted[knee - 1 : knee + 2] += (-0.01, 0.02, -0.01)
    estimate = bench.estimate(lifted, loads=(0.0, 630.0))
    result = bench.step(estimate, bench.command())
    np.testing.assert_array_equal(result.forces.forces[0], 0.0)
    assert result.forces.forces[1, 2] > 500.0
    sole, target = bench.robot.feet[0].position, result.target_soles[0]
    centre = estimate.position_ball_in_world
    heights = [np.linalg.norm(place - centre) for place in (sole, target)]
    gap, s = heights[0] - RADIUS, SETTINGS.forces
    assert gap > 1e-3
    pull = s.swing_stiffness * gap + s.swing_damping * s.landing_speed_m_s
    fall = 0.5 * PERIOD**2 * pull
    assert heights[0] - heights[1] == pytest.approx(fall, rel=1e-3)


def test_unfelt_feet_are_trusted_to_stand(bench: Bench) -> None:
    """Where no foot feels a load the commanded stance is kept: something must carry."""
    estimate = bench.estimate(loads=(0.0, 0.0))
    result = bench.step(estimate, bench.command())
    np.testing.assert_allclose(result.forces.shares, [0.5, 0.5], atol=1e-9)


def test_standing_soles_move_with_the_ball(bench: Bench) -> None:
    """On a ball that rolls the IK's soles are carried at the surface's speed."""
    speed = 0.1
    estimate = bench.estimate(ball_velocity=(speed, 0.0))
    spin = estimate.angular_velocity_ball_in_world
    surface = np.cross(spin, estimate.contacts_in_world)
    result = bench.step(estimate, bench.command())
    moved = result.target_soles - estimate.contacts_in_world
    np.testing.assert_allclose(moved, PERIOD * surface, atol=1e-4)


def test_slip_and_rocking_are_braked(bench: Bench) -> None:
    """A standing contact follows the ball's surface less its slip, foot by foot.

    Its acceleration is alpha x arm - gain * slip; the sole's turning is damped.
    """
    s, robot, ball = SETTINGS.forces, bench.robot, np.array([0.2, -0.1])
    qvel = np.random.default_rng(2).normal(scale=0.05, size=robot.model.nv)
    estimate = bench.estimate(qvel=qvel, ball_velocity=(0.1, 0.05))
    result = bench.step(estimate, bench.command(ball_acceleration=ball))
    qacc = np.concatenate(
        (np.zeros(3), result.forces.trunk_angular, result.forces.joint_accelerations)
    )
    rest = robot.mass_matrix[:3] @ qacc + robot.bias[:3]
    qacc[:3] = (result.forces.forces.sum(axis=0) - rest) / robot.mass
    alpha = np.array([-ball[1], ball[0], 0.0]) / RADIUS
    omega = estimate.angular_velocity_ball_in_world
    for i, foot in enumerate(robot.feet):
        found = robot.point_jacobian(i, foot.position) @ qacc
        found += robot.point_bias_acceleration(i, foot.position)
        slip = foot.linear_velocity - np.cross(omega, foot.position)
        expected = np.cross(alpha, foot.position) - s.slip_gain * slip
        np.testing.assert_allclose(found[:3], expected, atol=1e-6)
        turning = -s.stance_rotation_damping * foot.angular_velocity
        np.testing.assert_allclose(found[3:], turning, atol=1e-6)


def wild_state(bench: Bench) -> tuple[Array, Array]:
    """Return a state near the stance without any symmetry."""
    generator = np.random.default_rng(1)
    qpos, qvel = bench.pose.copy(), generator.normal(scale=0.1, size=24)
    qpos[3:7] = rotation_to_quaternion(
        rotation_from_vector(generator.normal(scale=0.03, size=3))
    )
    qpos[7:] += generator.normal(scale=0.02, size=18)
    return qpos, qvel


def test_mirrored_state_gives_mirrored_set_points(bench: Bench, mirror: Mirror) -> None:
    """Reflecting state and command reflects torques and set-points."""
    qpos, qvel = wild_state(bench)
    cop = np.array([0.01, 0.02])
    estimate = bench.estimate(qpos, qvel, (400.0, 230.0), (0.05, 0.02))
    command = bench.command(
        cop=cop, transfer=(0.7, 0.3), ball_acceleration=np.array([0.1, 0.2])
    )
    result = bench.step(estimate, command)
    image = bench.estimate(
        mirror.qpos(qpos), mirror.qvel(qvel), (230.0, 400.0), (0.05, -0.02)
    )
    command = replace(
        command,
        cop=mirror.vectors(cop),
        transfer=(0.3, 0.7),
        ball_acceleration=np.array([0.1, -0.2]),
    )
    mirrored = bench.step(image, command)
    np.testing.assert_allclose(
        mirrored.forces.joint_torques,
        mirror.joints(result.forces.joint_torques),
        atol=1e-7,
    )
    np.testing.assert_allclose(
        mirrored.positions, mirror.joints(result.positions), atol=1e-5
    )
    np.testing.assert_allclose(
        mirrored.target_soles, mirror.vectors(result.target_soles)[::-1], atol=1e-9
    )


def test_estimate_is_left_alone(bench: Bench) -> None:
    """Nothing in the estimate is changed, and results are not shared."""
    estimate = bench.estimate(ball_velocity=(0.1, 0.0))
    command = bench.command()
    before = [np.copy(getattr(estimate, f)) for f in estimate.__dataclass_fields__]
    control = bench.control()
    first = control.step(estimate, command, DT)
    kept = first.positions.copy()
    for field, value in zip(estimate.__dataclass_fields__, before, strict=True):
        np.testing.assert_array_equal(getattr(estimate, field), value)
    first.positions[:] = 7.0
    second = control.step(bench.estimate(), command, DT)
    np.testing.assert_allclose(second.positions, kept, atol=0.05)
