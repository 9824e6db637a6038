"""The controller ``wheeled-lip``: the block diagram as one readable function.

    sensors -> state estimate -> ideal CoP -> footstep planner -> CoM and foot
    targets -> inverse kinematics and contact forces -> joint targets
"""

from __future__ import annotations

import numpy as np

from ballsim_controllers.balance.ideal_cop import compute_mirrored_poles
from ballsim_controllers.balance.pole_assignment import place_poles
from ballsim_controllers.body_pendulum import (
    STATE_SIZE,
    TILT,
    BodyCoupling,
    TrunkResponse,
    body_matrices,
    compute_coupling,
    settled_state,
)
from ballsim_controllers.estimation.state_estimator import StateEstimator
from ballsim_controllers.footsteps.gait import LEFT, RIGHT, GaitClock, GaitTiming
from ballsim_controllers.footsteps.planner import FootstepPlanner, Plan, PlannerLimits
from ballsim_controllers.footsteps.preview import AxisModel, CellModel
from ballsim_controllers.footsteps.swing import SwingFoot, SwingReference
from ballsim_controllers.footsteps.timeline import build_timeline
from ballsim_controllers.frontal.sway import compute_sway
from ballsim_controllers.geometry import quaternion_to_rotation
from ballsim_controllers.messages import (
    Array,
    Command,
    ControllerSetup,
    GaitPhase,
    JointTargets,
    SensorReading,
    StateEstimate,
    Telemetry,
)
from ballsim_controllers.reference import RampReference, ReferenceSample
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.settings import (
    BalanceSettings,
    WheeledLipSettings,
    load_settings,
)
from ballsim_controllers.wheeled_lip import (
    BallPendulumParameters,
    discretise,
)
from ballsim_controllers.whole_body.body_control import BodyCommand, BodyControl

__all__ = ["WheeledLipController", "create_wheeled_lip"]


def create_wheeled_lip(setup: ControllerSetup) -> WheeledLipController:
    """Build the controller ``wheeled-lip`` (entry point)."""
    settings = load_settings(WheeledLipSettings, "wheeled-lip", setup.settings)
    return WheeledLipController(setup, settings)


class WheeledLipController:
    """Balances and walks on a ball, from sensor readings alone.

    Args:
        setup: Robot, ball and control period.
        settings: Gains and limits.
    """

    def __init__(self, setup: ControllerSetup, settings: WheeledLipSettings) -> None:
        """Design the gains and build every block."""
        self._settings = s = settings
        self._dt = setup.control_period
        self._ball = ball = setup.ball
        self.robot_model = robot = RobotModel(setup.robot)
        self.estimator = StateEstimator(robot, ball, self._dt)
        self._com_height = self.estimator.nominal_com_height
        params = BallPendulumParameters(ball, robot.mass, self._com_height, robot.gravity)
        self._params = params
        cell = s.rates.preview_period_s
        couplings = compute_coupling(robot, self.estimator.stance.qpos, self._com_height)
        sagittal, lateral = (
            _axis_model(
                params,
                coupling,
                TrunkResponse(s.forces.trunk_stiffness, s.forces.trunk_damping, compliance),
                s.balance,
                poles,
                cell,
            )
            for coupling, compliance, poles in zip(
                couplings,
                (s.forces.pitch_compliance, s.forces.roll_compliance),
                (s.balance.sagittal_poles_rad_s, s.balance.lateral_poles_rad_s),
                strict=True,
            )
        )
        gait = s.gait
        self._sway = compute_sway(
            lateral,
            setup.robot.stance_half_width,
            round(gait.double_support_s / cell),
            round(gait.single_support_s / cell),
        )
        self._planner = FootstepPlanner(
            sagittal,
            lateral,
            PlannerLimits(
                half_length=s.forces.cop_half_length_m,
                half_width=s.forces.cop_half_width_m,
                nominal_lateral=setup.robot.stance_half_width,
                sagittal_reach=min(s.planner.sagittal_reach_m, 0.45 * ball.radius),
                lateral_inward=s.planner.lateral_inward_m,
                lateral_outward=s.planner.lateral_outward_m,
                separation=s.planner.separation_m,
                sagittal_weight=s.planner.sagittal_weight,
                lateral_weight=s.planner.lateral_weight,
            ),
            s.planner.cells,
        )
        self._clock = GaitClock(
            GaitTiming(
                single_support=gait.single_support_s,
                double_support=gait.double_support_s,
                first_double_support=gait.first_double_support_s,
                earliest_touchdown=gait.earliest_touchdown,
                touchdown_force=gait.touchdown_force_n,
                latest_touchdown=gait.latest_touchdown_s,
            )
        )
        self._swing = SwingFoot(
            ball.radius, gait.lift_m, gait.freeze_time_s, gait.descent_speed_m_s
        )
        self._body = BodyControl(robot, s.forces, ball.radius, s.rates.ik_period_s)
        self._reference = RampReference(
            min(s.reference.max_speed_rad_s, s.reference.max_speed_m_s / ball.radius),
            min(
                s.reference.max_acceleration_rad_s2,
                s.reference.max_acceleration_m_s2 / ball.radius,
            ),
            s.reference.smoothing_time_s,
        )
        self._stride = round(cell / self._dt)
        window = self._stride * (s.planner.cells + 1)
        self._window = [ReferenceSample(0.0)] * window
        self._cursor = 0
        self._plan: Plan | None = None
        self._since_plan = 0
        self._landing = np.zeros(2)
        self._cop = np.zeros(2)
        self._internal_cop: Array | None = None
        self._trigger_time = 0.0
        self._patience = 0.0
        self.telemetry: Telemetry | None = None

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        """Return the joint targets that answer one sensor reading."""
        estimate = self.estimator.update(reading)
        return self.control(estimate, command)

    def control(self, estimate: StateEstimate, command: Command) -> JointTargets:
        """Return the joint targets for a state estimate (robot model updated)."""
        dt = self._dt
        self._advance_reference(command)
        changed = self._advance_gait(estimate, command)
        self._since_plan += 1
        if self._plan is None or changed or self._since_plan >= self._stride:
            self._make_plan(estimate)
        assert self._plan is not None
        cop = np.array([self._plan.sagittal.inputs[0], self._plan.lateral.inputs[0]])
        self._advance_internal_cop(cop)
        swing = self._advance_swing(estimate)
        body = self._body.step(
            estimate,
            BodyCommand(
                cop=self._internal_cop,
                stance=self._clock.stance,
                transfer=self._clock.transfer,
                swing=swing,
                com_height=self._com_height,
                heading=0.0,
                ball_acceleration=self._ball_acceleration(estimate),
            ),
            dt,
        )
        self._cop = body.forces.cop
        sample = self._window[self._cursor]
        self.telemetry = Telemetry(
            estimate=estimate,
            phase=self._clock.phase,
            step_count=self._clock.step_count,
            ideal_cop=self._plan.ideal_cop,
            commanded_cop=body.forces.cop,
            target_com=body.target_com,
            target_soles=body.target_soles,
            reference_ball_angle=sample.position,
            joint_torques=body.forces.joint_torques,
        )
        return JointTargets(body.positions)

    # -- reference ------------------------------------------------------------

    def _advance_reference(self, command: Command) -> None:
        """Move the shaped reference on; it runs ahead by the preview's horizon.

        A new target waits until the robot steps: standing feet cannot follow.
        """
        if self._clock.phase != GaitPhase.STAND:
            self._reference.target = command.target_ball_angle
        self._window[self._cursor] = self._reference.advance(self._dt)
        self._cursor = (self._cursor + 1) % len(self._window)

    def _sagittal_reference(self) -> tuple[Array, Array]:
        """Return reference states and CoP commands over the horizon."""
        params, radius, count = self._params, self._ball.radius, self._settings.planner.cells
        size = len(self._window)
        samples = np.array(
            [self._window[(self._cursor + k * self._stride) % size] for k in range(count)]
        ) * radius
        position, velocity, acceleration, _ = samples.T
        return settled_state(
            params, position, velocity, acceleration, self._settings.balance.cop_lag_s
        )

    # -- gait -----------------------------------------------------------------

    def _advance_gait(self, estimate: StateEstimate, command: Command) -> bool:
        clock = self._clock
        if clock.phase == GaitPhase.STAND:
            foot = self._swing_condition(estimate, command)
            if foot is None:
                return False
            commanded = self._trigger_time == 0.0
            settings = self._settings.gait
            duration = (
                settings.first_double_support_s if commanded else settings.double_support_s
            )
            clock.start(foot, duration)
            return True
        before = clock.phase
        forces = (float(estimate.normal_forces[0]), float(estimate.normal_forces[1]))
        # The foot that is to carry alone must carry something already.
        heir = 1 - clock.next_swing
        hold = forces[heir] < self._settings.forces.contact_force_n
        changed = clock.advance(self._dt, forces, hold)
        if changed and clock.phase == GaitPhase.DOUBLE and self._may_stop(estimate, command):
            clock.stop()
            self._trigger_time = 0.0
        if changed and clock.swing_foot is not None:
            self._lift_off(estimate, clock.swing_foot)
        return changed or clock.phase != before

    def _swing_condition(self, estimate: StateEstimate, command: Command) -> int | None:
        """Return the foot to swing first, or None to keep standing."""
        ideal = self._plan.ideal_cop if self._plan is not None else None
        feet = self._robot_soles()
        moving = command.is_stepping or not self._has_arrived(command)
        if ideal is None:
            return None
        limits = self._settings
        share = limits.gait.trigger_share
        low = feet.min(axis=0) - share * np.array(
            [limits.forces.cop_half_length_m, limits.forces.cop_half_width_m]
        )
        high = feet.max(axis=0) + share * np.array(
            [limits.forces.cop_half_length_m, limits.forces.cop_half_width_m]
        )
        outside = bool(np.any(ideal < low) or np.any(ideal > high))
        self._trigger_time = self._trigger_time + self._dt if outside else 0.0
        if self._trigger_time < limits.gait.trigger_time_s:
            self._patience = self._patience + self._dt if moving else 0.0
            is_due = self._patience > limits.gait.start_patience_s
            if not moving or not (is_due or self._is_settled(estimate, feet)):
                return None
        # The foot farther from the ideal CoP is free to go.
        return RIGHT if ideal[1] >= float(feet[:, 1].mean()) else LEFT

    def _is_settled(self, estimate: StateEstimate, feet: Array) -> bool:
        """Return whether a commanded step may begin: at rest over the ball's top."""
        gait = self._settings.gait
        ball = estimate.position_ball_in_world[:2]
        place = np.abs(feet.mean(axis=0) - ball).max()
        lean = np.abs(estimate.position_com_in_world[:2] - ball).max()
        speed = max(
            np.abs(estimate.linear_velocity_com_in_world[:2]).max(),
            np.abs(estimate.linear_velocity_ball_in_world[:2]).max(),
        )
        return bool(
            place < gait.start_offset_m
            and lean < gait.start_offset_m
            and speed < gait.start_speed_m_s
        )

    def _may_stop(self, estimate: StateEstimate, command: Command) -> bool:
        if command.is_stepping or not self._has_arrived(command) or self._plan is None:
            return False
        if self._clock.steps_since_start < 4:
            return False
        feet = self._robot_soles()
        ideal = self._plan.ideal_cop
        half = 0.4 * self._settings.forces.cop_half_length_m
        sagittal = abs(float(ideal[0] - feet[:, 0].mean())) < half
        lateral = abs(float(ideal[1] - feet[:, 1].mean())) < 0.06
        speed = np.abs(estimate.linear_velocity_ball_in_world[:2]).max() < 0.08
        apart = abs(float(feet[0, 0] - feet[1, 0])) < 0.06
        return bool(sagittal and lateral and speed and apart)

    def _has_arrived(self, command: Command) -> bool:
        """Return whether the reference rests at the commanded target."""
        sample = self._window[self._cursor]
        reference = self._reference
        return (
            reference.target == command.target_ball_angle
            and reference.is_at_rest
            and sample.velocity == 0.0
            and sample.position == reference.target
        )

    def _robot_soles(self) -> Array:
        return np.array([foot.position[:2] for foot in self.robot_model.feet])

    # -- planner --------------------------------------------------------------

    def _make_plan(self, estimate: StateEstimate) -> None:
        self._since_plan = 0
        cell = self._settings.rates.preview_period_s
        timeline = build_timeline(self._clock, self._sway, self._settings.planner.cells, cell)
        if self._internal_cop is None:
            self._internal_cop = estimate.cop_in_world.copy()
        rotation = quaternion_to_rotation(estimate.quaternion_trunk_to_world)
        rates = rotation @ estimate.angular_velocity_trunk_in_trunk
        # The tilt is positive where the trunk's top moves against the axis.
        tilts = ((rotation[2, 0], -rates[1]), (rotation[2, 1], rates[0]))
        states = tuple(
            np.array(
                [
                    estimate.position_com_in_world[axis],
                    estimate.linear_velocity_com_in_world[axis],
                    estimate.position_ball_in_world[axis],
                    estimate.linear_velocity_ball_in_world[axis],
                    self._internal_cop[axis],
                    *tilts[axis],
                ]
            )
            for axis in (0, 1)
        )
        reference_states, reference_inputs = self._sagittal_reference()
        gait = self._settings.gait
        self._plan = self._planner.plan(
            timeline,
            (states[0], states[1]),
            self._robot_soles(),
            reference_states,
            reference_inputs,
            stance_delay=gait.double_support_s + 0.5 * gait.single_support_s,
            lateral_offset=0.0,
        )
        if self._plan.landing is not None and self._clock.swing_foot is not None:
            limit = gait.landing_slew_m_s * cell
            change = np.clip(self._plan.landing - self._landing, -limit, limit)
            self._landing = self._landing + change
            self._swing.aim(self._landing, self._clock.time_in_phase)
        elif self._plan.landing is not None:
            self._landing = self._plan.landing

    def _advance_internal_cop(self, cop: Array) -> None:
        """First-order lag from the commanded CoP to the CoP."""
        assert self._internal_cop is not None
        share = 1.0 - np.exp(-self._dt / self._settings.balance.cop_lag_s)
        self._internal_cop = self._internal_cop + share * (cop - self._internal_cop)

    def _ball_acceleration(self, estimate: StateEstimate) -> Array:
        """Return the ball's acceleration that the model predicts, (2,), [m/s^2]."""
        params = self._params
        assert self._internal_cop is not None
        cop = self._internal_cop
        com = estimate.position_com_in_world[:2]
        ball = estimate.position_ball_in_world[:2]
        tilt = 2.0 * self._ball.radius / params.com_height
        acceleration: Array = params.ball_stiffness * ((cop - ball) - tilt * (com - cop))
        return acceleration

    # -- swing ----------------------------------------------------------------

    def _lift_off(self, estimate: StateEstimate, foot: int) -> None:
        sole = self.robot_model.feet[foot]
        ball = estimate.position_ball_in_world
        offset = sole.position - ball
        height = float(np.sqrt(offset @ offset)) - self._ball.radius
        velocity = sole.linear_velocity - estimate.linear_velocity_ball_in_world
        self._swing.lift_off(offset[:2], velocity[:2], height, self._clock.duration)

    def _advance_swing(self, estimate: StateEstimate) -> SwingReference | None:
        if self._clock.swing_foot is None:
            return None
        return self._swing.advance(
            self._clock.time_in_phase,
            self._dt,
            estimate.position_ball_in_world,
            estimate.linear_velocity_ball_in_world,
        )


def _axis_model(
    params: BallPendulumParameters,
    coupling: BodyCoupling,
    trunk: TrunkResponse,
    balance: BalanceSettings,
    poles: tuple[float, ...],
    cell: float,
) -> AxisModel:
    """Return the discrete models of one axis with their placed feedback.

    The poles are placed on the discrete model of pendulum and ball, the trunk
    held; the CoP's lag keeps its own. The trunk has no part in the feedback,
    but in the prediction.
    """
    wanted = (*(poles or compute_mirrored_poles(params)), -1.0 / balance.cop_lag_s)
    discrete_poles = [float(np.exp(pole * cell)) for pole in wanted]
    models = []
    for carried_feet in (4.0, 3.0):
        A, B = body_matrices(params, coupling, trunk, balance.cop_lag_s, carried_feet)
        core = discretise(A[:TILT, :TILT], B[:TILT], cell)
        gain = np.zeros(STATE_SIZE)
        gain[:TILT] = place_poles(core.A, core.B, discrete_poles)[0]
        whole = discretise(A, B, cell)
        models.append(CellModel(whole.A, whole.B[:, 0], gain))
    return AxisModel(*models)
