"""The paper's footstep planner for the sagittal plane, and its conditions.

Feet are told apart by 0 and 1. Angles of feet and contacts are relative to the
ball. The pure functions know nothing of angles: any coordinate along the ball
does, as long as all arguments share it, so that a planner in metres may use
them too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ballsim_controllers.errors import InvalidSettingError

__all__ = [
    "FootstepParameters",
    "FootstepState",
    "PaperFootstepPlanner",
    "choose_swing_foot",
    "cop_speed_limit",
    "double_support_domain",
    "foot_rotation",
    "has_passed_cop",
    "limit_actual_cop",
    "swing_speed_limit",
    "swing_velocity",
]

TIME_ROUNDING = 1e-9
"""What summing up steps may add to a time, [s]: t_s has to be exceeded truly."""


def _clip(value: float, lower: float, upper: float) -> float:
    """Return the value, limited to an interval."""
    return min(max(value, lower), upper)


def foot_rotation(ideal_cop: float, foot: float, half_length: float) -> float:
    """Return theta_d, how far a standing foot has rolled from its centre.

    Args:
        ideal_cop: Ideal CoP.
        foot: Centre of the foot.
        half_length: Half of the foot's length.

    Returns:
        Place of the contact from the foot's centre.

    Source:
        Equation (13).

    Examples:
        >>> foot_rotation(0.3, 0.0, half_length=0.2)
        0.2
    """
    return _clip(ideal_cop - foot, -half_length, half_length)


def double_support_domain(
    feet: tuple[float, float], half_length: float, shrink: float = 1.0
) -> tuple[float, float]:
    """Return the interval of the CoP that two standing feet allow.

    Args:
        feet: Centres of the feet.
        half_length: Half of the foot's length.
        shrink: lambda, the part of the half length that is used.

    Returns:
        Lower and upper bound.

    Source:
        Section V-A, "double support domain".

    Examples:
        >>> double_support_domain((0.5, 0.0), half_length=0.2, shrink=0.5)
        (-0.1, 0.6)
    """
    margin = shrink * half_length
    return min(feet) - margin, max(feet) + margin


def choose_swing_foot(
    ideal_cop: float,
    feet: tuple[float, float],
    half_length: float,
    shrink: float,
    first_if_level: int = 0,
) -> int | None:
    """Return the foot that has to swing, if any.

    The CoP leaves the reduced double support domain on one side; the foot on
    the other side goes.

    Args:
        ideal_cop: Ideal CoP.
        feet: Centres of the feet.
        half_length: Half of the foot's length.
        shrink: lambda, the part of the half length that is used.
        first_if_level: Foot that goes when both are at the same place.

    Returns:
        0, 1 or None.

    Source:
        Section V-A, "Swing condition".

    Examples:
        >>> choose_swing_foot(0.3, (0.2, 0.0), half_length=0.2, shrink=0.2)
        1
    """
    lower, upper = double_support_domain(feet, half_length, shrink)
    if lower <= ideal_cop <= upper:
        return None
    if feet[0] == feet[1]:
        return first_if_level
    rear = 0 if feet[0] < feet[1] else 1
    return rear if ideal_cop > upper else 1 - rear


def limit_actual_cop(
    ideal_cop: float,
    feet: tuple[float, float],
    swing_foot: int | None,
    half_length: float,
) -> float:
    """Return the actual CoP: the ideal one as far as the contacts allow.

    Args:
        ideal_cop: Ideal CoP.
        feet: Centres of the feet.
        swing_foot: Foot in the air, or None.
        half_length: Half of the foot's length.

    Returns:
        Actual CoP.

    Source:
        Section VI-A, from equation (13).
    """
    if swing_foot is not None:
        support = feet[1 - swing_foot]
        return support + foot_rotation(ideal_cop, support, half_length)
    return _clip(ideal_cop, *double_support_domain(feet, half_length))


def swing_velocity(
    ball_rate: float, cop_rate: float, k1: float, k2: float, max_rate: float
) -> float:
    """Return the velocity of the swing foot relative to the ball.

    Args:
        ball_rate: Estimated theta_1', [rad/s].
        cop_rate: Estimated theta_2', [rad/s].
        k1: Weight of the way back to the ball's top.
        k2: Weight of the way along with the ideal CoP.
        max_rate: theta_c^U', [rad/s].

    Returns:
        theta_c', [rad/s].

    Source:
        Equation (14), errata 7.
    """
    return _clip(-k1 * ball_rate + k2 * cop_rate, -max_rate, max_rate)


def has_passed_cop(
    ideal_cop: float, swing_foot: float, support_foot: float, k3: float
) -> bool:
    """Return whether the swing foot reaches beyond the ideal CoP.

    Args:
        ideal_cop: Ideal CoP.
        swing_foot: Centre of the swing foot.
        support_foot: Centre of the support foot.
        k3: How far it has to reach, per way from support foot to ideal CoP.

    Returns:
        Truth of landing condition (b).

    Source:
        Section V-B, "Landing condition" (b), errata 11.
    """
    way = ideal_cop - support_foot
    return way * (swing_foot - support_foot) > k3 * way**2


def cop_speed_limit(
    half_length: float, shrink: float, ball_radius: float, swing_time: float
) -> float:
    """Return the rolling speed that a support foot can follow for a swing.

    Args:
        half_length: l, [m].
        shrink: lambda.
        ball_radius: r0, [m].
        swing_time: t_s, [s].

    Returns:
        (1 - lambda) l / (r0 t_s), [rad/s].

    Source:
        simplified-model.md section 3.

    Examples:
        >>> round(cop_speed_limit(0.1, 0.2, 0.5, 0.2), 3)
        0.8
    """
    return (1.0 - shrink) * half_length / (ball_radius * swing_time)


def swing_speed_limit(max_swing_rate: float) -> float:
    """Return the rolling speed that feet can follow in turns.

    Args:
        max_swing_rate: theta_c^U', [rad/s].

    Returns:
        Half of it: each foot swings for less than half of the time, [rad/s].

    Source:
        simplified-model.md section 3.
    """
    return 0.5 * max_swing_rate


@dataclass(frozen=True, slots=True)
class FootstepParameters:
    """Parameters of the paper's planner; the defaults are set S2.

    Attributes:
        ball_radius: r0, [m].
        max_swing_rate: Bound of theta_c', [rad/s].
        half_length: l, half of a foot's length, [m].
        shrink: lambda, in [0, 1).
        k1: Weight of the way back to the top, see `swing_velocity`.
        k2: Weight of the way along with the CoP.
        k3: Reach beyond the ideal CoP, see `has_passed_cop`.
        max_foot_angle: alpha, from the ball's top, where a swing ends before
            its time, [rad].
        min_swing_time: t_s, [s].

    Source:
        Sections V and VI-B; k1, k2, k3 and alpha from simplified-model.md
        section 3, as the paper's cannot have been used or are not stated.
    """

    ball_radius: float
    max_swing_rate: float
    half_length: float = 0.1
    shrink: float = 0.2
    k1: float = 5.0
    k2: float = 5.0
    k3: float = 0.5
    max_foot_angle: float = 0.3
    min_swing_time: float = 0.2

    def __post_init__(self) -> None:
        """Refuse values outside their domain."""
        for key in ("ball_radius", "max_swing_rate", "half_length"):
            if not getattr(self, key) > 0.0:
                raise InvalidSettingError(key, getattr(self, key), "positive")
        for key in ("k1", "k2", "k3", "max_foot_angle", "min_swing_time"):
            if not getattr(self, key) >= 0.0:
                raise InvalidSettingError(key, getattr(self, key), "0 or more")
        if not 0.0 <= self.shrink < 1.0:
            raise InvalidSettingError("shrink", self.shrink, "in [0, 1)")

    @property
    def half_angle(self) -> float:
        """Return l / r0, half of the foot's length on the ball, [rad]."""
        return self.half_length / self.ball_radius


@dataclass(frozen=True, slots=True)
class FootstepState:
    """Where the feet are and which one swings.

    Attributes:
        feet: theta_c of both feet, relative to the ball, [rad].
        swing_foot: Foot in the air, or None in double support.
        swing_time: Time since that foot left the ball, [s].
        next_foot: Foot that goes next if both are at the same place.
        step_count: Touchdowns so far.
    """

    feet: tuple[float, float] = (0.0, 0.0)
    swing_foot: int | None = None
    swing_time: float = 0.0
    next_foot: int = 0
    step_count: int = 0


@dataclass(frozen=True, slots=True)
class PaperFootstepPlanner:
    """Footsteps that follow the ideal CoP; holds no state of its own.

    Attributes:
        params: Parameters of the planner.

    Source:
        Section V.
    """

    params: FootstepParameters

    def advance(
        self,
        state: FootstepState,
        angles: tuple[float, float],
        rates: tuple[float, float],
        dt: float,
    ) -> FootstepState:
        """Return the feet one step later.

        Args:
            state: Feet at the start of the step.
            angles: Estimated (theta_1, theta_2), [rad].
            rates: Their rates, [rad/s].
            dt: Step, [s].

        Returns:
            Feet at the end of the step.
        """
        params, foot = self.params, state.swing_foot
        swing_time = 0.0 if foot is None else state.swing_time + dt
        if foot is None:
            foot = choose_swing_foot(
                angles[1], state.feet, params.half_angle, params.shrink, state.next_foot
            )
        if foot is None:
            return state
        moved = state.feet[foot] + dt * swing_velocity(
            *rates, params.k1, params.k2, params.max_swing_rate
        )
        feet = (moved, state.feet[1]) if foot == 0 else (state.feet[0], moved)
        swinging = replace(state, feet=feet, swing_foot=foot, swing_time=swing_time)
        if not self.is_landing(swinging, angles):
            return swinging
        return replace(
            swinging,
            swing_foot=None,
            next_foot=1 - foot,
            step_count=state.step_count + 1,
        )

    def is_landing(self, state: FootstepState, angles: tuple[float, float]) -> bool:
        """Return whether the swing foot touches down now.

        Args:
            state: Feet, one of them swinging.
            angles: Estimated (theta_1, theta_2), [rad].

        Returns:
            Truth of the landing condition, (a) and (b).

        Source:
            Section V-B, "Landing condition".
        """
        params, foot = self.params, state.swing_foot
        if foot is None:
            return False
        is_late = state.swing_time > params.min_swing_time + TIME_ROUNDING
        is_far = any(
            abs(angles[0] + centre) > params.max_foot_angle for centre in state.feet
        )
        return (is_late or is_far) and has_passed_cop(
            angles[1], state.feet[foot], state.feet[1 - foot], params.k3
        )

    def actual_cop(self, state: FootstepState, ideal_cop: float) -> float:
        """Return the actual theta_2 that the feet give.

        Args:
            state: Feet.
            ideal_cop: Estimated theta_2, [rad].

        Returns:
            Actual theta_2, [rad].
        """
        half_angle = self.params.half_angle
        return limit_actual_cop(ideal_cop, state.feet, state.swing_foot, half_angle)
