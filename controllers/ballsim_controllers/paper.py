r"""The controller ``paper``: the paper's equations as printed, errata mended.

    ball, CoM, CoP -> y -> observer and feedback -> ideal CoP -> footsteps

The paper treats the sagittal plane of a wheeled pendulum. Its angles are read
off the robot's state estimate,

.. math::
    \theta_1 &= b / r_0, \qquad \theta_1 + \theta_2 = (p - b) / r_0 \\
    \varphi &= \theta_1 + k \theta_2 + \theta_4
    = [x - b - (r_0 + r_1)(\theta_1 + \theta_2)] / L_0 ,

and its answer is the ideal CoP :math:`b + r_0 (\hat\theta_1 + \hat\theta_2)` and
the place :math:`\theta_c` of the swing foot. All else is that of `pipeline`:
state estimate, frontal plane, gait clock, path of the swing foot, whole body.

In full physics it falls within seconds. Its contact force passes through the
wheel's centre, r1 above the contact, which no sole can transmit, and its
observer, which sees each move of the CoP at once, stands 1 to 3 ms of delay.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from ballsim_controllers.balance.observer import decoupled_gain
from ballsim_controllers.balance.paper_controller import PaperBalanceController
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.footsteps.conditions import (
    FootstepParameters,
    FootstepState,
    PaperFootstepPlanner,
    choose_swing_foot,
    limit_actual_cop,
    swing_velocity,
)
from ballsim_controllers.footsteps.gait import LEFT, RIGHT
from ballsim_controllers.footsteps.planner import Plan
from ballsim_controllers.footsteps.swing import SwingReference
from ballsim_controllers.messages import (
    Array,
    BallParameters,
    Command,
    ControllerSetup,
    StateEstimate,
)
from ballsim_controllers.pipeline import WheeledLipController
from ballsim_controllers.reference import constant_velocity_target
from ballsim_controllers.settings import WheeledLipSettings, load_settings
from ballsim_controllers.wheeled_lip import WheeledLipParameters, wheeled_lip_matrices

__all__ = ["PaperController", "PaperSettings", "create_paper", "measure_angles"]

LEVEL = 0.005
"""Feet nearer to each other than this along the ball are level, [m]."""


@dataclasses.dataclass(frozen=True, slots=True)
class PendulumSettings:
    """The paper's wheeled pendulum."""

    robot_mass_kg: float
    robot_inertia_kg_m2: float
    wheel_radius_m: float
    pendulum_length_m: float

    def parameters(self, ball: BallParameters, gravity: float) -> WheeledLipParameters:
        """Return the parameters of the model on a ball."""
        return WheeledLipParameters(
            *(ball.radius, ball.mass, ball.inertia),
            *dataclasses.astuple(self),
            gravity=gravity,
        )


@dataclasses.dataclass(frozen=True, slots=True)
class FeedbackSettings:
    """Poles; those of the observer in pairs for theta_1, theta_2, theta_4."""

    feedback_poles_rad_s: tuple[float, ...]
    observer_poles_rad_s: tuple[float, ...]
    is_commanded_cop_in_output: bool

    def controller(self, params: WheeledLipParameters) -> PaperBalanceController:
        """Return the balance controller with these poles."""
        poles = self.observer_poles_rad_s
        if len(poles) != 6:
            key = "feedback.observer_poles_rad_s"
            raise InvalidSettingError(key, list(poles), "six poles")
        pairs = list(zip(poles[::2], poles[1::2], strict=True))
        return PaperBalanceController(
            params,
            self.feedback_poles_rad_s,
            decoupled_gain(wheeled_lip_matrices(params).A, pairs),
            self.is_commanded_cop_in_output,
        )


@dataclasses.dataclass(frozen=True, slots=True)
class FootstepSettings:
    """The paper's footstep planner, see `FootstepParameters`."""

    half_length_m: float
    shrink: float
    min_swing_time_s: float
    k1: float
    k2: float
    k3: float
    max_foot_angle_rad: float
    swing_bound_radii_m: tuple[float, ...]
    swing_bounds: tuple[float, ...]

    def parameters(self, ball_radius: float) -> FootstepParameters:
        """Return the parameters for a ball; between balls the bound is linear."""
        radii, bounds = self.swing_bound_radii_m, self.swing_bounds
        if not 0 < len(radii) == len(bounds) or min(np.diff(radii), default=1) <= 0:
            key = "footsteps.swing_bound_radii_m"
            raise InvalidSettingError(key, list(radii), "rising, one for each bound")
        bound = float(np.interp(ball_radius, radii, bounds))
        return FootstepParameters(
            ball_radius,
            bound * self.half_length_m / (ball_radius * self.min_swing_time_s),
            *(self.half_length_m, self.shrink, self.k1, self.k2, self.k3),
            *(self.max_foot_angle_rad, self.min_swing_time_s),
        )


@dataclasses.dataclass(frozen=True, slots=True)
class PaperSettings:
    """What the controller ``paper`` has beside `WheeledLipSettings`."""

    pendulum: PendulumSettings
    feedback: FeedbackSettings
    footsteps: FootstepSettings


def create_paper(setup: ControllerSetup) -> PaperController:
    """Build the controller ``paper`` (entry point)."""
    return PaperController(setup, *_load(setup.settings))


def _load(table: Mapping[str, Any]) -> tuple[WheeledLipSettings, PaperSettings]:
    """Return both kinds of settings from one table; t_s is the single support."""
    own, shared = (
        [field.name for field in dataclasses.fields(kind)]
        for kind in (PaperSettings, WheeledLipSettings)
    )
    for key in table:
        if key not in own + shared:
            valid = "the keys are " + ", ".join(own + shared)
            raise InvalidSettingError(f"controller.{key}", table[key], valid)
    paper = load_settings(
        PaperSettings, "paper", {k: table[k] for k in own if k in table}
    )
    rest = {k: table[k] for k in shared if k in table}
    gait = rest.get("gait", {})
    if isinstance(gait, Mapping):
        single_support = paper.footsteps.min_swing_time_s
        rest["gait"] = {"single_support_s": single_support, **gait}
    return load_settings(WheeledLipSettings, "wheeled-lip", rest), paper


def measure_angles(
    params: WheeledLipParameters, length: float, com: float, ball: float, cop: float
) -> Array:
    """Return the measured output y of the wheeled pendulum.

    Args:
        params: Radii of ball and wheel.
        length: L0 of the robot, from the wheel's centre to its CoM, [m].
        com: CoM along the heading, [m].
        ball: Ball's centre, [m].
        cop: CoP, [m].

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
        """Build the pipeline, place the paper's poles."""
        super().__init__(setup, settings)
        self._paper = paper
        params = paper.pendulum.parameters(setup.ball, self.robot_model.gravity)
        self.balance = paper.feedback.controller(params)
        self.footsteps = PaperFootstepPlanner(
            paper.footsteps.parameters(setup.ball.radius)
        )
        self._length = self._com_height - params.wheel_radius
        #: Estimated (theta_1, theta_2, theta_4 and rates), [rad], [rad/s].
        self.angles: Array | None = None
        self.target_angle = 0.0
        self._ideal_cop = 0.0
        self._feet = (0.0, 0.0)
        self._swing_angle = 0.0
        self._swing_time = 0.0
        self._is_waiting = False

    @property
    def settings_table(self) -> Mapping[str, Any]:
        """Return every setting as it would stand in the ``[controller]`` table."""
        return dataclasses.asdict(self._settings) | dataclasses.asdict(self._paper)

    # -- balance --------------------------------------------------------------

    def _advance_reference(self, command: Command) -> None:
        """Follow a new target at once: the ideal CoP makes the feet move."""
        self._reference.target = command.target_ball_angle
        super()._advance_reference(command)

    def _balance(self, estimate: StateEstimate) -> None:
        """Advance observer and feedback; equations (4)-(7) and (9)."""
        ball = float(estimate.position_ball_in_world[0])
        y = measure_angles(
            self.balance.params,
            self._length,
            float(estimate.position_com_in_world[0]),
            ball,
            float(estimate.cop_in_world[0]),
        )
        sample = self._window[self._cursor]
        self.target_angle = constant_velocity_target(sample, self.balance.lead_time)
        at_rest = np.concatenate((y, np.zeros(3)))
        angles = at_rest if self.angles is None else self.angles
        with np.errstate(over="ignore", invalid="ignore"):
            angles = self.balance.update(angles, y, self.target_angle, self._dt)
        # Long after a fall the unstable observer may have run out of numbers.
        self.angles = angles if np.isfinite(angles).all() else at_rest
        radius = self._ball.radius
        self._ideal_cop = ball + radius * float(self.angles[0] + self.angles[1])
        left, right = (self._robot_soles()[:, 0] - ball) / radius - y[0]
        self._feet = (float(left), float(right))

    def _advance_internal_cop(self, cop: Array) -> None:
        """Command the ideal CoP, as far as the soles allow, without any lag."""
        super()._advance_internal_cop(cop)
        assert self._internal_cop is not None
        assert self._plan is not None
        left, right = self._robot_soles()[:, 0].tolist()
        self._internal_cop[0] = limit_actual_cop(
            self._ideal_cop,
            (left, right),
            self._clock.swing_foot,
            self._settings.forces.cop_half_length_m,
        )
        ideal = np.array([self._ideal_cop, self._plan.ideal_cop[1]])
        self._plan = dataclasses.replace(self._plan, ideal_cop=ideal)

    # -- footsteps ------------------------------------------------------------

    def _swing_condition(self, estimate: StateEstimate, command: Command) -> int | None:
        """Return the foot that has to swing: the paper's condition, both planes."""
        if self._plan is None or self.angles is None:
            return None
        feet, params = self._feet, self.footsteps.params
        if abs(feet[0] - feet[1]) * self._ball.radius < LEVEL:
            feet = (0.5 * (feet[0] + feet[1]),) * 2
        lateral = self._robot_soles()[:, 1]
        ideal = float(self._plan.ideal_cop[1])
        outer = RIGHT if ideal >= lateral.mean() else LEFT
        foot = choose_swing_foot(
            float(self.angles[1]), feet, params.half_angle, params.shrink, outer
        )
        if foot is None:
            width = self._settings.forces.cop_half_width_m
            share = self._settings.gait.trigger_share
            places = (float(lateral[0]), float(lateral[1]))
            foot = choose_swing_foot(ideal, places, width, share)
        if foot is None and command.is_stepping:
            return super()._swing_condition(estimate, command)
        return foot

    def _may_stop(self, estimate: StateEstimate, command: Command) -> bool:
        """Return whether the foot that is next in turn does not have to swing."""
        if command.is_stepping:
            return False
        return self._swing_condition(estimate, command) != self._clock.next_swing

    def _advance_gait(self, estimate: StateEstimate, command: Command) -> bool:
        self._balance(estimate)
        changed = super()._advance_gait(estimate, command)
        foot = self._clock.swing_foot
        if foot is None:
            self._is_waiting = False
        else:
            self._advance_swing_angle(foot)
        return changed

    def _lift_off(self, estimate: StateEstimate, foot: int) -> None:
        super()._lift_off(estimate, foot)
        self._swing_angle, self._swing_time = self._feet[foot], 0.0
