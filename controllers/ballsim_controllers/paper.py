r"""The controller ``paper``: the paper's equations as printed, errata mended.

    state estimate -> y -> observer and feedback -> ideal CoP -> footsteps

The paper treats the sagittal plane of a wheeled pendulum. Its angles are read
off the state estimate (`measure_angles`), and its answer is the ideal CoP
:math:`b + r_0 (\hat\theta_1 + \hat\theta_2)` and the place :math:`\theta_c` of
the swing foot. What the paper has nothing on is that of `pipeline`: state
estimate, frontal plane, gait clock, path of the swing foot, whole body.

In full physics it falls within seconds. The contact force of its model passes
through the wheel's centre, r1 above the contact, a moment that no sole can
transmit. Worse, its observer expects each move of the CoP in y at once: some
milliseconds from ideal to measured CoP, and estimate and robot leave each other
(simplified-model.md, Delay). With the commanded CoP in y it stands longer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ballsim_controllers.footsteps.conditions import (
    FootstepState,
    PaperFootstepPlanner,
    limit_actual_cop,
    swing_velocity,
)
from ballsim_controllers.footsteps.gait import LEFT
from ballsim_controllers.footsteps.paper_decisions import PaperDecisions
from ballsim_controllers.footsteps.planner import Plan
from ballsim_controllers.footsteps.timeline import Timeline
from ballsim_controllers.messages import Array, Command, ControllerSetup, StateEstimate
from ballsim_controllers.paper_settings import PaperSettings, load_paper_settings
from ballsim_controllers.pipeline import WheeledLipController
from ballsim_controllers.reference import constant_velocity_target
from ballsim_controllers.rehearsal import rehearse
from ballsim_controllers.settings import WheeledLipSettings
from ballsim_controllers.wheeled_lip import WheeledLipParameters

__all__ = ["PaperController", "create_paper", "measure_angles"]

OVERFLOW = 1e100
"""Estimated angle, [rad], at which the observer starts anew: where the CoP cannot
follow, the estimate grows by a power of ten every 50 ms, beyond all numbers."""


def create_paper(setup: ControllerSetup) -> PaperController:
    """Build the controller ``paper`` (entry point).

    The first one of a process rehearses: see `rehearsal`.
    """
    controller = _build(setup)
    rehearse(_build, setup)
    return controller


def _build(setup: ControllerSetup) -> PaperController:
    return PaperController(setup, *load_paper_settings(setup.settings))


def measure_angles(
    params: WheeledLipParameters, length: float, com: float, ball: float, cop: float
) -> Array:
    r"""Return the measured output y of the wheeled pendulum.

    .. math::
        \theta_1 &= b / r_0, \qquad \theta_1 + \theta_2 = (p - b) / r_0 \\
        \theta_1 + k \theta_2 + \theta_4
        &= [x - b - (r_0 + r_1)(\theta_1 + \theta_2)] / L_0

    Args:
        params: Radii of ball and wheel.
        length: L0 of the robot, from the wheel's centre to its CoM, [m].
        com: x, the CoM along the heading, [m].
        ball: b, the ball's centre, [m].
        cop: p, the CoP, [m].

    Returns:
        (theta_1, theta_2, theta_4), shape (3,), [rad].

    Source:
        Section III-A, to first order.
    """
    r0, r1 = params.ball_radius, params.wheel_radius
    theta_1, contact = ball / r0, (cop - ball) / r0
    theta_2 = contact - theta_1
    lean = (com - ball - (r0 + r1) * contact) / length
    return np.array([theta_1, theta_2, lean - theta_1 - params.wheel_ratio * theta_2])


class PaperController(WheeledLipController):
    """The paper's sagittal plane within the pipeline of ``wheeled-lip``.

    Args:
        setup: Robot, ball and control period.
        settings: Settings of what is shared.
        paper: Settings of the paper's part.
    """

    def __init__(
        self, setup: ControllerSetup, settings: WheeledLipSettings, paper: PaperSettings
    ) -> None:
        """Build the pipeline and place the paper's poles."""
        super().__init__(setup, settings)
        self._paper = paper
        params = paper.pendulum.make_parameters(setup.ball, self.robot_model.gravity)
        self._length = self._com_height - params.wheel_radius
        self.law = paper.feedback.make_controller(params)
        footsteps = paper.footsteps.make_parameters(setup.ball.radius)
        self._footsteps = PaperFootstepPlanner(footsteps)
        self._decisions: PaperDecisions = PaperDecisions(settings, footsteps, self._dt)
        #: Target angle theta_1*, [rad].
        self.target_angle = 0.0
        #: Estimated (theta_1, theta_2, theta_4, rates), shape (6,), or None.
        self.angles: Array | None = None
        self._ideal_cop = 0.0
        self._feet = [0.0, 0.0]  # theta_c; measured but for a swinging foot
        self._swing_time = 0.0
        self._is_hanging = False

    @property
    def settings_table(self) -> Mapping[str, Any]:
        """Return every setting with its value, as the configuration has them."""
        return {**super().settings_table, **asdict(self._paper)}

    # -- balance --------------------------------------------------------------

    def _advance_reference(self, command: Command) -> None:
        """Follow a new target at once: the ideal CoP will make the feet move."""
        self._motion.advance(command)
        self._decisions.is_stepping = command.is_stepping

    def _advance_angles(self, estimate: StateEstimate) -> None:
        """Advance observer and feedback, (4)-(7), with the target of (9)."""
        radius, ball = self._ball.radius, float(estimate.position_ball_in_world[0])
        com, cop = estimate.position_com_in_world[0], estimate.cop_in_world[0]
        y = measure_angles(self.law.params, self._length, float(com), ball, float(cop))
        sample = self._motion.present
        self.target_angle = constant_velocity_target(sample, self.law.lead_time)
        at_rest = np.concatenate((y, np.zeros(3)))
        angles = at_rest if self.angles is None else self.angles
        angles = self.law.update(angles, y, self.target_angle, self._dt)
        self.angles = angles if np.abs(angles).max() < OVERFLOW else at_rest
        contact = float(self.angles[0] + self.angles[1])
        self._ideal_cop = ball + radius * min(max(contact, -1.0), 1.0)  # on the ball
        for foot, place in enumerate(self._soles()[:, 0].tolist()):
            if foot != self._clock.swing_foot:
                self._feet[foot] = (place - ball) / radius - float(y[0])

    def _replacing_cop(self) -> Array:
        """Return the ideal CoP within the soles; across the heading the preview's."""
        left, right = self._soles()[:, 0].tolist()
        half_length = self._settings.forces.cop_half_length_m
        swing = self._clock.swing_foot
        cop = limit_actual_cop(self._ideal_cop, (left, right), swing, half_length)
        return np.array([cop, np.nan])

    # -- footsteps ------------------------------------------------------------

    def _advance_gait(
        self,
        estimate: StateEstimate,
        states: Array,
        loads: tuple[float, float],
    ) -> bool:
        """Advance balance, gait clock and swing foot."""
        self._advance_angles(estimate)
        has_changed = super()._advance_gait(estimate, states, loads)
        self._is_hanging = False
        if has_changed:
            self._swing_time = 0.0
        elif self._clock.swing_foot is not None:
            self._advance_foot(self._clock.swing_foot)
        return has_changed

    def _advance_foot(self, foot: int) -> None:
        """Move the swing foot by (14), (15); it waits for the landing condition.

        The foot comes down in the second half of its path. It stays at the top,
        and the clock stands still, while the condition will not hold by the time
        it is down; but no longer than the gait allows a touchdown to be late.
        """
        clock = self._clock
        self._swing_time += self._dt
        self._feet[foot] = self._foresee(foot, self._dt)[1][0]
        is_at_top = clock.remaining <= 0.5 * clock.duration
        patience = self._settings.gait.latest_touchdown_s
        if not is_at_top or self._swing_time > clock.time_in_phase + patience:
            return
        angles, (swinging, standing) = self._foresee(foot, clock.remaining)
        feet = (swinging, standing) if foot == LEFT else (standing, swinging)
        time = self._swing_time + clock.remaining
        if not self._footsteps.is_landing(FootstepState(feet, foot, time), angles):
            self._is_hanging = True
            clock.time_in_phase -= self._dt

    def _foresee(
        self, foot: int, time: float
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return (theta_1, theta_2) and theta_c of swing and support foot after a time.

        Args:
            foot: Foot that swings.
            time: Time ahead, over which the present rates are kept, [s].
        """
        assert self.angles is not None
        params = self._footsteps.params
        first, second, _, first_rate, second_rate, _ = self.angles.tolist()
        rate = swing_velocity(
            first_rate, second_rate, params.k1, params.k2, params.max_swing_rate
        )
        angles = (first + time * first_rate, second + time * second_rate)
        return angles, (self._feet[foot] + time * rate, self._feet[1 - foot])

    def _reschedule(
        self, plan: Plan, timeline: Timeline, states: Array
    ) -> tuple[Plan, Timeline]:
        """Keep the schedule: it is the paper's condition that chooses the foot."""
        return plan, timeline

    def _update_plan(self, states: Array, has_changed: bool) -> Plan:
        """Put the paper's ideal CoP and landing place into the pipeline's plan."""
        plan = super()._update_plan(states, has_changed)
        foot = self._clock.swing_foot
        if foot is not None:
            angles, feet = self._foresee(foot, self._clock.remaining)
            reach = self._planner.limits.sagittal_reach
            place = min(max(self._ball.radius * (angles[0] + feet[0]), -reach), reach)
            self._landing = np.array([place, self._landing[1]])
            self._swing.aim(self._landing, self._clock.time_in_phase)
            self._report_landings(foot, plan)
        ideal = np.array([self._ideal_cop, plan.ideal_cop[1]])
        self._plan = plan = replace(plan, ideal_cop=ideal)
        return plan
