"""The controller ``wheeled-lip``: the block diagram as one readable function.

    sensors -> state estimate -> ideal CoP -> footstep planner -> CoM and foot
    targets -> inverse kinematics and contact forces -> joint targets

The ideal CoP is the paper's: state feedback by pole assignment on the wheeled
LIP, from an observer. Where feedback alone cannot hold (frontal plane, landing
places, CoP at the soles' edges) the planner looks ahead on the same model; see
`footsteps.preview`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np

from ballsim_controllers.balance.design import design_balance
from ballsim_controllers.balance.stride_memory import make_stride_memory
from ballsim_controllers.body_pendulum import BALL, STATE_SIZE
from ballsim_controllers.commanded_motion import CommandedMotion
from ballsim_controllers.estimation.health import HealthMonitor
from ballsim_controllers.estimation.state_estimator import StateEstimator
from ballsim_controllers.footsteps.calibration import find_calibration_margins
from ballsim_controllers.footsteps.decisions import StepDecisions, StepSituation
from ballsim_controllers.footsteps.gait import GaitClock, time_gait
from ballsim_controllers.footsteps.gait_plans import find_gait_plans
from ballsim_controllers.footsteps.planner import ANYWHERE, Plan
from ballsim_controllers.footsteps.schedule import StepSchedule
from ballsim_controllers.footsteps.swing import SWING, SwingFoot, slew
from ballsim_controllers.footsteps.timeline import Timeline
from ballsim_controllers.footsteps.touchdown import TouchdownMemory
from ballsim_controllers.heading_frame import find_leads, turn_memory
from ballsim_controllers.messages import (
    ESTIMATE,
    Array,
    Command,
    ControllerSetup,
    GaitPhase,
    JointTargets,
    Record,
    SensorReading,
    StateEstimate,
    Telemetry,
    telemetry_dtype,
)
from ballsim_controllers.rehearsal import rehearse
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.settings import WheeledLipSettings, load_settings
from ballsim_controllers.settings_checks import check_settings, count_ticks
from ballsim_controllers.tick import CONSTANTS, act, finish, sense
from ballsim_controllers.wheeled_lip import BallPendulumParameters
from ballsim_controllers.whole_body.body_control import BodyControl
from ballsim_controllers.whole_body.forces import ContactForces
from ballsim_controllers.whole_body.standing_soles import make_standing_soles

__all__ = ["WheeledLipController", "create_wheeled_lip"]

_NO_COP = np.full(2, np.nan)


def create_wheeled_lip(setup: ControllerSetup) -> WheeledLipController:
    """Build the controller ``wheeled-lip`` (entry point).

    The first one of a process rehearses: see `rehearsal`.
    """
    controller = _build(setup)
    rehearse(_build, setup)
    return controller


def _build(setup: ControllerSetup) -> WheeledLipController:
    settings = load_settings(WheeledLipSettings, "wheeled-lip", setup.settings)
    return WheeledLipController(setup, settings)


class WheeledLipController:
    """Balances and walks on a ball, from sensor readings alone.

    Args:
        setup: Robot, ball and control period.
        settings: Gains and limits.

    Raises:
        InvalidSettingError: A setting does not fit, or the ball is too small.
    """

    def __init__(self, setup: ControllerSetup, settings: WheeledLipSettings) -> None:
        """Design the gains and build every block."""
        self._settings = s = settings
        self._dt = setup.control_period
        self._ball = ball = setup.ball
        check_settings(s, setup.robot)
        self._stride = count_ticks("controller.rates.preview_period_s", s, self._dt)
        self.robot_model = robot = RobotModel(
            setup.robot, has_own_model=s.estimation.com_offset_m > 0.0
        )
        self.estimator = StateEstimator(
            robot, ball, self._dt, setup.sensors, s.estimation.com_offset_m
        )
        self._is_com_uncertain = not setup.sensors.are_perfect
        self._com_height = self.estimator.nominal_com_height
        self._params = BallPendulumParameters(
            ball, robot.mass, self._com_height, robot.gravity
        )
        stance = self.estimator.stance.qpos
        balance = design_balance(s, robot, self._params, stance, self._dt)
        #: Observers of both axes, shape (2,), dtype `AXIS`.
        self._axes: Record = np.concatenate([axis.record for axis in balance])
        self._memory: Record = make_stride_memory(
            self._dt,
            s.balance.cop_learning_rate,
            s.balance.cop_learning_lead_s,
            self._params.ball_stiffness,
        )
        sagittal, lateral = (axis.model for axis in balance)
        gait = s.gait
        cell = s.rates.preview_period_s
        timing = time_gait(gait, ball.radius, cell)
        margins = find_calibration_margins(robot, stance, s, setup.sensors)
        plans = find_gait_plans((sagittal, lateral), s, timing, setup, margins)
        self._timelines, self._planner = plans.timelines, plans.planner
        self._schedule = StepSchedule(plans.timelines, timing, gait, cell)
        self._clock = GaitClock(timing)
        self._decisions = StepDecisions(gait, s.forces, self._dt, ball.radius)
        self._swing = SwingFoot(
            ball.radius, gait.lift_m, gait.freeze_time_s, gait.descent_speed_m_s
        )
        self._touchdowns = TouchdownMemory(
            gait.descent_speed_m_s,
            gait.touchdown_tolerance_s,
            0.0 if setup.sensors.are_perfect else gait.touchdown_depth_m,
        )
        self._body = BodyControl(robot, s.forces, ball.radius, s.rates.ik_period_s)
        self._bodies: Record = np.zeros(1, self._body.body_dtype)
        self.health = HealthMonitor(
            robot.joint_count,
            self._dt,
            robot.mass * robot.gravity,
            ContactForces(self._bodies).accelerations,
        )
        self._motion = CommandedMotion(
            s.reference,
            self._params,
            s.balance.cop_lag_s,
            self._dt,
            self._stride,
            s.planner.cells,
            timing.single_support + timing.double_support,
        )
        #: What `act` takes behind the decisions, up to the whole-body layer's part.
        constants: Record = np.zeros(1, CONSTANTS)
        constants["dt"] = self._dt
        constants["ball_stiffness"] = self._params.ball_stiffness
        constants["ball_tilt"] = 2.0 * ball.radius / self._com_height
        constants["com_height"] = self._com_height
        self._acting: tuple[Record, Record, Record, Record, Record, Record] = (
            self._axes,
            self._memory,
            np.zeros(1, SWING),
            self._swing.path,
            make_standing_soles(not setup.sensors.are_perfect),
            constants,
        )
        self._leads = find_leads(s.forces, timing.stance_delay)
        self._is_hanging = False  # the swinging foot
        self._is_wanted = False  # a step: the command needs it
        self._plan: Plan | None = None
        self._since_plan = 0
        self._landing = np.zeros(2)
        # Records of a tick, written anew at each one.
        self._report: Record = np.zeros(1, telemetry_dtype(robot.joint_count))
        self._estimate = StateEstimate(np.zeros(1, ESTIMATE))  # in the robot's frame
        size = self._report.dtype.itemsize
        self._report_content = self._report.view(np.dtype((np.void, size)))
        self._landings: Array = self._report["landings"][0]
        self._landings[:] = np.nan
        self._has_stepped = False

    @property
    def telemetry(self) -> Telemetry | None:
        """Return what the last ``step`` did, or None before the first."""
        if not self._has_stepped:
            return None
        # NumPy copies a record field by field, which takes ten times as long.
        content = self._report_content.copy()
        return Telemetry(np.ndarray(1, self._report.dtype, content))

    @property
    def settings_table(self) -> Mapping[str, Any]:
        """Return every setting with its value, as the configuration has them."""
        return asdict(self._settings)

    def step(self, reading: SensorReading, command: Command) -> JointTargets:
        """Return the joint targets that answer one sensor reading."""
        clock, layer = self._clock, self._body
        report, estimate, bodies = self._report, self._estimate, self._bodies
        states = np.empty((2, STATE_SIZE))
        if self._motion.is_turning:
            self._turn()
        loads = sense(
            states,
            report,
            estimate.record,
            reading.record,
            self._motion.frame,
            self._axes,
            clock.swing_foot is not None,
            *self.health.arguments,
            *self.estimator.arguments,
        )
        self._advance_reference(command)
        self._is_wanted = command.is_stepping or not self._motion.has_arrived(command)
        has_changed = self._advance_gait(estimate, states, loads)
        plan = self._update_plan(states, has_changed)
        act(
            bodies,
            estimate.record,
            plan.command,
            self._replacing_cop(),
            *clock.stance,
            *clock.transfer,
            -1.0 if clock.swing_foot is None else clock.time_in_phase,
            self._is_hanging,
            *self._acting,
            *layer.arguments,
        )
        if layer.is_ik_due(self._dt):
            layer.solve_ik(estimate.record, bodies)
        positions = np.empty(self.robot_model.joint_count)
        finish(
            positions,
            report,
            bodies,
            int(clock.phase),
            clock.step_count,
            self._motion.angle,
            plan.ideal_cop,
            *layer.targets,
            layer.ik_positions,
            layer.ik_velocity,
            self._dt,
            self.robot_model.record,
            self._motion.frame,
        )
        self._has_stepped = True
        return JointTargets(positions)

    # -- balance --------------------------------------------------------------

    def _replacing_cop(self) -> Array:
        """Return the CoP that takes the plan's place at once, NaN for none, (2,)."""
        return _NO_COP

    def _turn(self) -> None:
        """Move the robot's frame on, and turn all that is kept with it."""
        motion, plan = self._motion, self._plan
        assert plan is not None  # it turns stepping only
        velocity = self._memory["ball_velocity"]
        vectors = np.array([self._landing, plan.command, plan.ideal_cop, velocity[0]])
        turn_memory(self._axes, self._swing.path, vectors, *motion.turn())
        self._landing, velocity[0] = vectors[0], vectors[3]
        self._plan = replace(plan, command=vectors[1], ideal_cop=vectors[2])
        trunk, sole = self._leads
        self._acting[-1]["heading"] = trunk * motion.turn_rate
        self._swing.path["heading"] = sole * motion.turn_rate

    # -- gait -----------------------------------------------------------------

    def _advance_reference(self, command: Command) -> None:
        """Move the reference on; a new target waits until the robot steps."""
        is_standing = self._clock.phase == GaitPhase.STAND
        self._motion.advance(None if is_standing else command)

    def _advance_gait(
        self,
        estimate: StateEstimate,
        states: Array,
        loads: tuple[float, float],
    ) -> bool:
        """Advance the gait clock; return True where the phase has changed."""
        clock, gait = self._clock, self._settings.gait
        if self._plan is None:
            return False
        if clock.phase == GaitPhase.STAND:
            situation = self._situation(estimate, states, self._plan)
            foot = self._decisions.first_swing(situation)
            if foot is not None:
                clock.start(foot, gait.first_double_support_s)
            return foot is not None
        # The foot that is to carry alone must carry something already.
        hold = loads[1 - clock.next_swing] < self._settings.forces.contact_force_n
        if not clock.advance(self._dt, loads, hold):
            return False
        foot = clock.swing_foot
        if foot is not None:
            sole, depth = self.robot_model.feet[foot], self._touchdowns.depth(foot)
            self._swing.leave(sole, estimate, clock.duration, depth)
        else:
            self._touchdowns.learn(1 - clock.next_swing, clock.lateness)
            situation = self._situation(estimate, states, self._plan)
            if self._decisions.may_stop(situation, clock.steps_since_start):
                clock.stop()
        return True

    def _situation(
        self, estimate: StateEstimate, states: Array, plan: Plan
    ) -> StepSituation:
        """Return what the decisions to step or to stop look at."""
        return StepSituation(
            estimate=estimate,
            soles=self._soles(),
            ideal_cop=plan.ideal_cop,
            capture=plan.capture,
            find_reference=self._motion.find_place,
            is_wanted=self._is_wanted,
            find_swing=lambda: self._schedule.begin(partial(self._make_plan, states)),
        )

    def _soles(self) -> Array:
        """Return the soles' centres in the world (left, right), (2, 2), [m]."""
        soles: Array = self.robot_model.record["feet"]["position"][0, :, :2]
        return soles

    # -- planner --------------------------------------------------------------

    def _update_plan(self, states: Array, has_changed: bool) -> Plan:
        """Return the plan, renewed once per cell and at each change of phase."""
        self._since_plan += 1
        is_fresh = self._since_plan < self._stride and not has_changed
        if self._plan is not None and is_fresh:
            return self._plan
        elapsed, self._since_plan = self._since_plan * self._dt, 0
        is_needed = self._is_com_uncertain or self._clock.phase != GaitPhase.STAND
        self._motion.correct(float(states[0, BALL]), elapsed, is_needed)
        timeline = self._timelines.look_up(self._clock)
        plan = self._make_plan(states, timeline)
        if self._clock.phase == GaitPhase.DOUBLE:
            plan, timeline = self._reschedule(plan, timeline, states)
        self._plan = plan
        if plan.landing is None:
            self._landings[:] = np.nan
        else:
            if self._clock.swing_foot is None:
                self._landing = plan.landing
            else:
                rates, gait = self._settings.rates, self._settings.gait
                limit = gait.landing_slew_m_s * rates.preview_period_s
                self._landing = slew(self._landing, plan.landing, limit)
                self._swing.aim(self._landing, self._clock.time_in_phase)
            self._report_landings(timeline.landings[0].foot, plan)
        return plan

    def _report_landings(self, foot: int, plan: Plan) -> None:
        """Report where the feet are to land.

        The report keeps it until the next plan: none of this costs the other ticks.

        Args:
            foot: Foot that lands first.
            plan: The plan.
        """
        places, along, across = self._landings, plan.sagittal, plan.lateral
        places[foot] = self._landing
        places[1 - foot] = np.nan
        if len(along.landings) > 1:
            places[1 - foot] = along.landings[1], across.landings[1]
        _, sine, cosine = self._motion.frame[0].tolist()
        if sine != 0.0:
            places[:] = places @ [[cosine, sine], [-sine, cosine]]

    def _make_plan(self, states: Array, timeline: Timeline) -> Plan:
        """Return the plan for a timeline."""
        clock, gait = self._clock, self._settings.gait
        landing_range = ANYWHERE
        if clock.swing_foot is not None:
            landing_range = self._swing.landing_range(
                self._landing, clock.time_in_phase, gait.landing_slew_m_s
            )
        return self._planner.plan(
            timeline,
            states,
            self._soles(),
            *self._motion.foresee(),
            stance_delay=clock.timing.stance_delay,
            swing=self._swing.path["offset"][0],
            landing_range=landing_range,
            lateral_motion=self._motion.foresee_sideways(),
            is_resting=not (timeline.landings and self._is_wanted),
        )

    def _reschedule(
        self, plan: Plan, timeline: Timeline, states: Array
    ) -> tuple[Plan, Timeline]:
        """Return plan and timeline of the schedule of the least effort."""
        make_plan, speed = partial(self._make_plan, states), self._motion.speed
        return self._schedule.revise(self._clock, plan, timeline, make_plan, speed)
