"""The controller `paper`: the paper's laws, in the paper's numbers, on real soles.

It falls within seconds (full-physics.md section 2). What is tested is that it is
the paper's controller, and that its falls are orderly.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from ballsim.config import CommandConfig, CommandPoint
from ballsim.config_io import load_config
from ballsim.paths import robot_description_path
from ballsim.preparation import prepare
from ballsim.simulation import KeptRun, run_prepared
from ballsim_controllers.footsteps.decisions import StepSituation
from ballsim_controllers.footsteps.gait import LEFT, RIGHT
from ballsim_controllers.footsteps.paper_decisions import PaperDecisions
from ballsim_controllers.messages import (
    ESTIMATE,
    BallParameters,
    Command,
    ControllerSetup,
    GaitPhase,
    JointTargets,
    SensorReading,
    StateEstimate,
)
from ballsim_controllers.paper import PaperController, create_paper, measure_angles
from ballsim_controllers.paper_settings import load_paper_settings
from ballsim_controllers.robot import load_robot_description
from ballsim_controllers.wheeled_lip import (
    WheeledLipParameters,
    equilibrium_direction,
)

RADII = (0.25, 0.5, 0.75, 1.0)
DT = 2e-3


def make(radius=0.5, **tables) -> PaperController:
    """Return the controller on one of the paper's balls."""
    robot = load_robot_description(robot_description_path("biped"))
    ball = BallParameters(radius, 40.0, 0.5)
    return create_paper(ControllerSetup(robot, ball, DT, tables))


class Watched:
    """Steps a controller and keeps what it thinks."""

    def __init__(self, controller: PaperController) -> None:
        self.controller = controller
        self.rows: list[tuple] = []
        self._replacing_cop = controller._replacing_cop
        controller._replacing_cop = self._keep_cop

    @property
    def telemetry(self):
        return self.controller.telemetry

    def _keep_cop(self):
        self.cop = self._replacing_cop()
        return self.cop

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        targets = self.controller.step(reading, command)
        assert self.controller.angles is not None
        self.rows.append(
            (
                self.telemetry,
                self.controller.angles.copy(),
                self.controller.target_angle,
                self.cop[0],
                [foot.position[0] for foot in self.controller.robot_model.feet],
            )
        )
        return targets


@functools.lru_cache(maxsize=8)
def simulate(radius: float, is_commanded: bool = False) -> tuple[KeptRun, Watched]:
    """Run `roll-to`, the target given at once, for up to 3 s."""
    config = load_config("roll-to", ["duration_s=3", f"ball.radius_m={radius}"]).config
    command = CommandConfig((CommandPoint(0.0, 1.0),))
    config = dataclasses.replace(config, command=command)
    feedback = {"is_commanded_cop_in_output": is_commanded}
    watched = Watched(make(radius, feedback=feedback))
    return run_prepared(prepare(config, watched)), watched


def test_measured_angles_are_those_of_the_pendulum():
    """CoM and CoP of a posture (theta_1, theta_2, theta_4) give it back."""
    params = WheeledLipParameters(0.5)
    r0, r1, length = params.ball_radius, params.wheel_radius, 0.77
    generator = np.random.default_rng(3)
    for first, second, last in generator.normal(scale=0.1, size=(20, 3)):
        ball = r0 * first
        wheel = ball + (r0 + r1) * (first + second)
        com = wheel + length * (first + params.wheel_ratio * second + last)
        y = measure_angles(params, length, com, ball, ball + r0 * (first + second))
        np.testing.assert_allclose(y, (first, second, last), atol=1e-12)
    at_rest = measure_angles(params, length, com=0.2, ball=0.2, cop=0.2)
    np.testing.assert_allclose(at_rest, 0.4 * equilibrium_direction(params)[:3])


def test_target_follows_equation_9():
    """theta_1* leads the moving reference by KT'/KT times its speed."""
    config = load_config("stand", ["duration_s=0.1"]).config
    prepared = prepare(config, watched := Watched(make()))
    reading = prepared.sensors.read(0.0, prepared.plant.compute_first_sensordata())
    for _ in range(800):  # nothing moves but the reference
        watched.step(reading, Command(target_ball_angle=1.0))
    reference = np.array([row[0].reference_ball_angle for row in watched.rows])
    target = np.array([row[2] for row in watched.rows])
    speed = np.gradient(reference, DT)
    assert speed.max() > 0.03
    inner = slice(1, -1)
    expected = reference + 2.474544 * speed
    np.testing.assert_allclose(target[inner], expected[inner], atol=1e-5)


@pytest.mark.parametrize("radius", RADII)
def test_it_runs_on_every_ball(radius):
    """It stands for some tenths of a second and falls without any exception."""
    result, watched = simulate(radius)
    assert result.is_upright == (result.fall_reason is None)
    assert result.simulated_time > 0.3
    assert np.isfinite(result.series.ctrl[: result.series.n_ticks]).all()
    assert all(np.isfinite(row[0].ideal_cop).all() for row in watched.rows)


@pytest.mark.parametrize("radius", RADII)
def test_ideal_cop_is_the_estimated_contact(radius):
    """It is b + r0 (theta_1 + theta_2); what is commanded lies in the soles."""
    _, watched = simulate(radius)
    assert watched.rows
    for telemetry, angles, _, cop, feet in watched.rows:
        if telemetry.phase not in (GaitPhase.STAND, GaitPhase.DOUBLE):
            break
        ball = telemetry.estimate.position_ball_in_world[0]
        contact = angles[0] + angles[1]
        ideal = telemetry.ideal_cop[0]
        assert abs(ideal - ball) < radius + 1e-12
        if abs(contact) < 1.0:
            assert ideal == pytest.approx(ball + radius * contact, abs=1e-12)
        limited = np.clip(ideal, min(feet) - 0.085, max(feet) + 0.085)
        assert cop == pytest.approx(limited, abs=1e-12)


def test_same_start_gives_the_same_bits():
    """Nothing but the readings decides."""
    first, _ = simulate(0.5)
    simulate.cache_clear()
    second, _ = simulate(0.5)
    for name in ("qpos", "ctrl"):
        one, two = getattr(first.series, name), getattr(second.series, name)
        assert one.tobytes() == two.tobytes()


def test_commanded_cop_in_the_output_stands_longer():
    """The lag of the measured CoP fells it first (simplified-model.md, Delay)."""
    plain, _ = simulate(0.5)
    mended, _ = simulate(0.5, is_commanded=True)
    assert plain.fall_time is not None
    assert mended.simulated_time > 1.5 * plain.fall_time


def _swing(controller: PaperController) -> list[float]:
    """Swing the right foot in the air; return the time of its path per period."""
    clock, times = controller._clock, []
    clock.start(RIGHT, 0.1)
    while clock.swing_foot is None:
        clock.advance(DT, (300.0, 300.0), False)
    while not clock.advance(DT, (600.0, 0.0), False):
        controller._advance_foot(RIGHT)
        times.append(clock.time_in_phase)
    return times


def test_swing_foot_waits_for_the_landing_condition():
    """It stays at the top of its path, but no longer than the gait allows."""
    controller = make()
    controller.angles = np.zeros(6)  # the CoP under the support foot: never true
    times = np.array(_swing(controller))
    is_still = np.isclose(np.diff(times), 0.0, atol=1e-9)
    assert is_still.sum() * DT == pytest.approx(0.15, abs=2 * DT)
    np.testing.assert_allclose(times[1:][is_still], 0.1, atol=1.1 * DT)


def test_swing_foot_lands_where_the_paper_integrates_it():
    """Ahead of the CoP it does not wait; theta_c moves by (14) and (15)."""
    controller = make()
    controller.angles = np.array([0.0, 0.05, 0.0, -0.05, 0.05, 0.0])
    times = np.array(_swing(controller))
    is_still = np.isclose(np.diff(times), 0.0, atol=1e-9)
    assert is_still.sum() <= 1  # the swing time must exceed t_s
    rate = 5.0 * 0.05 + 5.0 * 0.05
    swung = len(times) * DT
    assert controller._feet[RIGHT] == pytest.approx(rate * swung)


def _situation(cop, soles) -> StepSituation:
    estimate = StateEstimate(np.zeros(1, ESTIMATE))
    return StepSituation(
        estimate=estimate,
        soles=np.array(soles),
        ideal_cop=np.array(cop),
        capture=np.zeros(2),
        find_reference=lambda: np.zeros(2),
        is_wanted=True,
        find_swing=lambda: LEFT,
    )


@pytest.mark.parametrize(
    ("cop", "soles", "foot"),
    [
        ((0.019, 0.0), ((0.0, 0.06), (0.0, -0.06)), None),
        ((0.021, 0.01), ((0.0, 0.06), (0.0, -0.06)), RIGHT),  # level: the farther
        ((0.021, -0.01), ((0.0, 0.06), (0.002, -0.06)), LEFT),
        ((0.021, -0.01), ((0.1, 0.06), (0.0, -0.06)), None),
        ((0.121, -0.01), ((0.1, 0.06), (0.0, -0.06)), RIGHT),  # the one behind
        ((-0.021, -0.01), ((0.1, 0.06), (0.0, -0.06)), LEFT),
        ((0.0, 0.11), ((0.0, 0.06), (0.0, -0.06)), RIGHT),  # sideways
    ],
)
def test_swing_condition_in_both_planes(cop, soles, foot):
    """The CoP leaves the reduced domain of the soles: the foot behind it goes."""
    shared, paper = load_paper_settings({})
    decisions = PaperDecisions(shared, paper.footsteps.make_parameters(0.5), DT)
    situation = _situation(cop, soles)
    assert decisions.first_swing(situation) == foot
    assert decisions.may_stop(situation, 1) == (foot is None)
    decisions.is_stepping = True
    assert not decisions.may_stop(situation, 1)
