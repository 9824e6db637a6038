"""What the paper leaves open or misprints, as named choices with their reasons.

The paper does not state g, alpha, k3, the time step, nor which of the many F
with its poles it used; and with its printed k1 = k2 = 0.2 no robot keeps up with
the ball. `ParameterSet` names each choice. The sets here reproduce its claims,
one each; no set is claimed to be the authors'.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from ballsim_controllers.footsteps.conditions import FootstepParameters
from ballsim_controllers.wheeled_lip import WheeledLipParameters

__all__ = [
    "PARAMETER_SETS",
    "RADII",
    "ObserverKind",
    "OpenPoint",
    "ParameterSet",
    "StageReading",
    "open_points",
]

RADII = (0.25, 0.5, 0.75, 1.0)
"""Radii r0 of the four balls, Section VI-B, [m]."""

SWING_BOUNDS = {0.25: 0.5, 0.5: 2.0, 0.75: 4.0, 1.0: 8.0}
"""Bound of theta_c' in l / (r0 t_s) for each ball, Section VI-B."""


class ObserverKind(enum.StrEnum):
    """How F is chosen among all that have the poles of Section VI-B."""

    DECOUPLED = "decoupled"
    KNV = "knv"
    PLACE = "place"


class StageReading(enum.StrEnum):
    """What theta_1^r is when the reference velocity changes (Section VI-D)."""

    RESTART = "restart"
    INTEGRAL = "integral"
    PRODUCT = "product"


def _open(paper: str, reason: str) -> dict[str, str]:
    """Return what the paper prints for a choice, and why it is not that."""
    return {"paper": paper, "reason": reason}


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """All choices of one simulation.

    Attributes:
        name: Short name.
        purpose: What the set is for.
        observer: Choice of F.
        k: k1 = k2 of (14).
        k3: Of landing condition (b).
        max_foot_angle: alpha of landing condition (a), [rad]; None for none.
        dt: Time step of controller and plant, [s].
        stage_reading: theta_1^r where the reference velocity changes.
        is_checked_at_lift_off: Whether theta_1' is compared with the stage only
            when a foot lifts off; else at every step.
        gravity: g, [m/s^2].
    """

    name: str
    purpose: str
    observer: ObserverKind = field(
        default=ObserverKind.DECOUPLED,
        metadata=_open(
            "poles only",
            "F is not unique. theta_2 is the observer's own, so that the four zeros "
            "of (A - F C, B, row theta_2) must be stable, too: with `place` they "
            "are not, and the loop falls within 0.4 s",
        ),
    )
    k: float = field(
        default=2.0,
        metadata=_open(
            "0.2",
            "at speed v each foot must average -v while it swings for less than half "
            "of the time: k1 + k2 > 2",
        ),
    )
    k3: float = field(
        default=0.5,
        metadata=_open("not stated", "0 to 0.75 act alike; 1.5 and more fall early"),
    )
    max_foot_angle: float | None = field(
        default=0.05,
        metadata=_open(
            "not stated",
            "small: widest envelope, but feet land before t_s; 0.3 and more: t_s holds",
        ),
    )
    dt: float = field(
        default=1e-3,
        metadata=_open(
            "not stated",
            "Euler steps of 0.1 to 5 ms work; the coarse ones make a swing last one "
            "step too long, which shows on the unit ball",
        ),
    )
    stage_reading: StageReading = field(
        default=StageReading.RESTART,
        metadata=_open(
            "theta_1^r = v t, for a constant v",
            "where v changes, only a restart of the ramp at the present angle avoids "
            "the overshoot that the stages are there to avoid",
        ),
    )
    is_checked_at_lift_off: bool = field(
        default=False,
        metadata=_open(
            "not stated",
            "the paper's speeds lie above v - epsilon: they were looked at only now "
            "and then",
        ),
    )
    gravity: float = field(
        default=9.81, metadata=_open("not stated", "standard value, to three digits")
    )

    def model(self, ball_radius: float) -> WheeledLipParameters:
        """Return the paper's wheeled pendulum on a ball of a radius, [m]."""
        return WheeledLipParameters(ball_radius, gravity=self.gravity)

    def footsteps(self, ball_radius: float) -> FootstepParameters:
        """Return the planner's parameters for one of the paper's four balls.

        Args:
            ball_radius: r0, [m].
        """
        plain = FootstepParameters(
            ball_radius=ball_radius,
            max_swing_rate=1.0,
            k1=self.k,
            k2=self.k,
            k3=self.k3,
            max_foot_angle=(
                float("inf") if self.max_foot_angle is None else self.max_foot_angle
            ),
        )
        unit = plain.half_length / (ball_radius * plain.min_swing_time)
        bound = SWING_BOUNDS[ball_radius] * unit
        return dataclasses.replace(plain, max_swing_rate=bound)


class OpenPoint(NamedTuple):
    """A point that the paper leaves open or misprints.

    Attributes:
        name: Field of `ParameterSet`.
        paper: What the paper prints.
        reason: Why the choice is what it is.
    """

    name: str
    paper: str
    reason: str


def open_points() -> Iterator[OpenPoint]:
    """Yield the open points, one for each choice of a `ParameterSet`.

    Examples:
        >>> next(open_points()).paper
        'poles only'
    """
    for item in dataclasses.fields(ParameterSet):
        if item.metadata:
            yield OpenPoint(item.name, item.metadata["paper"], item.metadata["reason"])


_COARSE = ParameterSet(
    name="KNV20",
    purpose="cyclic deviation of the CoP on the unit ball (Figs. 12, 13)",
    observer=ObserverKind.KNV,
    k=20.0,
    k3=1.0,
    max_foot_angle=None,
    dt=5e-3,
)

PARAMETER_SETS = {
    chosen.name: chosen
    for chosen in (
        ParameterSet("S1", "widest envelope: all four balls"),
        ParameterSet("S2", "t_s respected", k=5.0, max_foot_angle=0.3),
        _COARSE,
        dataclasses.replace(
            _COARSE,
            name="KNV5",
            purpose="as KNV20 with a slower swing foot: larger, irregular deviation",
            k=5.0,
        ),
        ParameterSet(
            name="KNV2",
            purpose="speeds at which the stages were switched (Figs. 10, 11)",
            observer=ObserverKind.KNV,
            dt=5e-3,
            is_checked_at_lift_off=True,
        ),
    )
}
"""The sets of simplified-model.md sections 3 and 4, by name."""
