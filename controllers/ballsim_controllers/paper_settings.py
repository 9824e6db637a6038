"""Settings of the controller ``paper``: pendulum, poles, footstep planner."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from ballsim_controllers.balance.observer import decoupled_gain
from ballsim_controllers.balance.paper_controller import PaperBalanceController
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.footsteps.conditions import FootstepParameters
from ballsim_controllers.messages import BallParameters
from ballsim_controllers.settings import WheeledLipSettings, load_settings
from ballsim_controllers.wheeled_lip import WheeledLipParameters, wheeled_lip_matrices

__all__ = [
    "FeedbackSettings",
    "FootstepSettings",
    "PaperSettings",
    "PendulumSettings",
    "load_paper_settings",
]


@dataclass(frozen=True, slots=True)
class PendulumSettings:
    """The robot as the paper's wheeled pendulum, see `WheeledLipParameters`."""

    robot_mass_kg: float
    robot_inertia_kg_m2: float
    wheel_radius_m: float
    pendulum_length_m: float

    def make_parameters(
        self, ball: BallParameters, gravity: float
    ) -> WheeledLipParameters:
        """Return the parameters of the model on a ball.

        Raises:
            InvalidSettingError: A value is not positive.
        """
        with _full_keys("pendulum", self):
            return WheeledLipParameters(
                ball_radius=ball.radius,
                ball_mass=ball.mass,
                ball_inertia=ball.inertia,
                robot_mass=self.robot_mass_kg,
                robot_inertia=self.robot_inertia_kg_m2,
                wheel_radius=self.wheel_radius_m,
                pendulum_length=self.pendulum_length_m,
                gravity=gravity,
            )


@dataclass(frozen=True, slots=True)
class FeedbackSettings:
    """Poles, those of the observer in pairs; see `PaperBalanceController`."""

    feedback_poles_rad_s: tuple[float, ...]
    observer_poles_rad_s: tuple[float, ...]
    is_commanded_cop_in_output: bool

    def make_controller(self, params: WheeledLipParameters) -> PaperBalanceController:
        """Return the balance controller with these poles.

        Raises:
            InvalidSettingError: The poles are not six, or cannot be placed.
        """
        poles = self.observer_poles_rad_s
        if len(poles) != 6 or max(poles) >= 0.0:
            key = "feedback.observer_poles_rad_s"
            raise InvalidSettingError(key, list(poles), "six stable poles")
        if max(self.feedback_poles_rad_s, default=0.0) >= 0.0:
            key, value = "feedback.feedback_poles_rad_s", self.feedback_poles_rad_s
            raise InvalidSettingError(key, list(value), "six stable poles")
        pairs = list(zip(poles[::2], poles[1::2], strict=True))
        with _full_keys("feedback", self):
            return PaperBalanceController(
                params,
                poles=self.feedback_poles_rad_s,
                observer_gain=decoupled_gain(wheeled_lip_matrices(params).A, pairs),
                is_commanded_cop_in_output=self.is_commanded_cop_in_output,
            )


@dataclass(frozen=True, slots=True)
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

    def make_parameters(self, ball_radius: float) -> FootstepParameters:
        """Return the parameters for a ball; between radii the bound is linear.

        Raises:
            InvalidSettingError: A value is outside its domain.
        """
        radii, bounds = self.swing_bound_radii_m, self.swing_bounds
        if not 0 < len(radii) == len(bounds) or np.any(np.diff(radii) <= 0.0):
            key = "footsteps.swing_bound_radii_m"
            raise InvalidSettingError(key, list(radii), "rising, one for each bound")
        for key in ("half_length_m", "min_swing_time_s"):
            if not getattr(self, key) > 0.0:
                raise InvalidSettingError(
                    f"footsteps.{key}", getattr(self, key), "positive"
                )
        if min(bounds) <= 0.0:
            key = "footsteps.swing_bounds"
            raise InvalidSettingError(key, list(bounds), "positive numbers")
        bound = float(np.interp(ball_radius, radii, bounds))
        unit = self.half_length_m / (ball_radius * self.min_swing_time_s)
        with _full_keys("footsteps", self):
            return FootstepParameters(
                ball_radius=ball_radius,
                max_swing_rate=bound * unit,
                half_length=self.half_length_m,
                shrink=self.shrink,
                k1=self.k1,
                k2=self.k2,
                k3=self.k3,
                max_foot_angle=self.max_foot_angle_rad,
                min_swing_time=self.min_swing_time_s,
            )


@dataclass(frozen=True, slots=True)
class PaperSettings:
    """What the controller ``paper`` has beside `WheeledLipSettings`."""

    pendulum: PendulumSettings
    feedback: FeedbackSettings
    footsteps: FootstepSettings


@contextmanager
def _full_keys(table: str, settings: Any) -> Iterator[None]:
    """Let errors about a parameter name the setting that it comes from."""
    try:
        yield
    except InvalidSettingError as error:
        names = [field.name for field in dataclasses.fields(settings)]
        key = next((name for name in names if error.key in name), error.key)
        raise InvalidSettingError(f"{table}.{key}", error.value, error.valid) from None


def load_paper_settings(
    table: Mapping[str, Any],
) -> tuple[WheeledLipSettings, PaperSettings]:
    """Return the settings that are shared and the paper's own, from one table.

    The shared ones are those of ``wheeled-lip``, but for the single support: it
    lasts the paper's t_s unless the table says otherwise.

    Args:
        table: Tables of values that replace those of the presets.

    Raises:
        InvalidSettingError: A key is unknown or a value of the wrong type.
    """
    shared, own = (
        [field.name for field in dataclasses.fields(kind)]
        for kind in (WheeledLipSettings, PaperSettings)
    )
    for key, value in table.items():
        if key not in shared and key not in own:
            valid = "the keys are " + ", ".join(shared + own)
            raise InvalidSettingError(f"controller.{key}", value, valid)
    paper = load_settings(
        PaperSettings, "paper", {key: table[key] for key in own if key in table}
    )
    rest = {key: table[key] for key in shared if key in table}
    gait = rest.get("gait", {})
    if isinstance(gait, Mapping):
        swing_time = paper.footsteps.min_swing_time_s
        timing = {"single_support_s": swing_time, "single_support_growth_s_m": 0.0}
        rest["gait"] = {**timing, **gait}
    return load_settings(WheeledLipSettings, "wheeled-lip", rest), paper
