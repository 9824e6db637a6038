"""Gait clock: which feet stand, for how long, which foot swings next."""

from __future__ import annotations

from dataclasses import dataclass

from ballsim_controllers.messages import GaitPhase
from ballsim_controllers.settings import GaitSettings

__all__ = ["LEFT", "RIGHT", "GaitClock", "GaitTiming", "time_gait"]

LEFT, RIGHT = 0, 1


@dataclass(frozen=True, slots=True)
class GaitTiming:
    """Durations of the gait.

    Attributes:
        single_support: Swing time t_s, [s].
        double_support: Time between a touchdown and the next lift-off, [s].
        earliest_touchdown: Share of the swing before which contact is ignored.
        touchdown_force: Normal force that counts as contact, [N].
        latest_touchdown: Time after the swing's end at which the foot is taken
            as landed whether its sensor says so or not, [s].
    """

    single_support: float
    double_support: float
    earliest_touchdown: float
    touchdown_force: float
    latest_touchdown: float

    @property
    def stance_delay(self) -> float:
        """Return the time from a landing to the middle of the foot's support, [s]."""
        return self.double_support + 0.5 * self.single_support


def time_gait(settings: GaitSettings, ball_radius: float, cell: float) -> GaitTiming:
    """Return the durations of the gait on a ball.

    A ball that turns as fast carries a foot the farther off the larger it is, and the
    foot swings back at what speed the joints allow. On a small ball the robot falls
    sideways faster, and steps faster.

    Args:
        settings: Settings of the gait.
        ball_radius: Radius of the ball, [m].
        cell: Length of a cell of the preview, of which the supports are multiples, [s].
    """
    swing = settings.single_support_s + settings.single_support_growth_s_m * ball_radius
    return GaitTiming(
        single_support=max(round(swing / cell), 1) * cell,
        double_support=max(round(settings.double_support_s / cell), 1) * cell,
        earliest_touchdown=settings.earliest_touchdown,
        touchdown_force=settings.touchdown_force_n,
        latest_touchdown=settings.latest_touchdown_s,
    )


class GaitClock:
    """Finite-state machine of stance and swing.

    Args:
        timing: Durations.

    Attributes:
        phase: Present phase.
        stance: Which feet stand (left, right).
        swing_foot: The foot in the air: 0 = left, 1 = right, None = neither.
        time_in_phase: Time since the phase began, [s].
        duration: Planned length of the phase, [s].
        transfer: How far each foot is on its way to carrying alone (left, right): 1
            in single support; during double support it passes from the foot that has
            carried alone to the one that will.
        next_swing: Foot that swings next.
        swing_duration: Planned length of that swing, [s].
        step_count: Touchdowns so far.
        steps_since_start: Touchdowns since stepping began.
        lateness: Time from the planned end of the last swing to its touchdown, [s].
    """

    def __init__(self, timing: GaitTiming) -> None:
        """Start standing on both feet."""
        self.timing = timing
        self.transfer = (0.0, 0.0)
        self._enter(GaitPhase.STAND, 0.0)
        self.next_swing = RIGHT
        self.swing_duration = timing.single_support
        self.step_count = 0
        self.steps_since_start = 0
        self.lateness = 0.0

    @property
    def remaining(self) -> float:
        """Return the time to the planned end of the phase, [s]."""
        return max(self.duration - self.time_in_phase, 0.0)

    def start(self, first_swing: int, duration: float) -> None:
        """Leave standing: double support, then swing the given foot."""
        self.transfer = (0.0, 0.0)
        self._enter(GaitPhase.DOUBLE, duration)
        self.next_swing = first_swing
        self.steps_since_start = 0

    def reschedule(
        self, next_swing: int, remaining: float, swing_duration: float
    ) -> None:
        """Change which foot swings next, when and for how long; in double support.

        Args:
            next_swing: The foot.
            remaining: Time until it leaves the ball, [s].
            swing_duration: Time from then until it lands, [s].
        """
        self.next_swing = next_swing
        self.duration = self.time_in_phase + remaining
        self.swing_duration = swing_duration

    def stop(self) -> None:
        """Stand on both feet."""
        self._enter(GaitPhase.STAND, 0.0)

    def advance(
        self, dt: float, normal_forces: tuple[float, float], hold: bool
    ) -> bool:
        """Advance the clock by one control tick.

        Args:
            dt: Control period, [s].
            normal_forces: Normal force on each foot (left, right), [N].
            hold: True to remain in double support after its time is up.

        Returns:
            True where the phase has changed.
        """
        if self.phase == GaitPhase.DOUBLE:
            self._pass_on(dt)
        self.time_in_phase += dt
        swing = self.swing_foot
        if swing is not None:
            timing = self.timing
            late = self.time_in_phase > self.duration + timing.latest_touchdown
            early = self.time_in_phase < timing.earliest_touchdown * self.duration
            touches = normal_forces[swing] > timing.touchdown_force
            if late or (touches and not early):
                self.step_count += 1
                self.steps_since_start += 1
                self.next_swing = 1 - swing
                self.lateness = self.time_in_phase - self.duration
                self._enter(GaitPhase.DOUBLE, timing.double_support)
                self.transfer = (0.0, 1.0) if swing == LEFT else (1.0, 0.0)
                return True
        elif self.phase == GaitPhase.DOUBLE and not hold and self.remaining < 0.5 * dt:
            is_left = self.next_swing == RIGHT
            support = GaitPhase.LEFT_SUPPORT if is_left else GaitPhase.RIGHT_SUPPORT
            self._enter(support, self.swing_duration)
            self.swing_duration = self.timing.single_support
            return True
        return False

    def _pass_on(self, dt: float) -> None:
        """Bring the foot that will carry alone nearer to it, the other one away."""
        share, support = dt / max(self.remaining, dt), 1 - self.next_swing
        new = self.transfer[support]
        new += share * (1.0 - new)
        old = self.transfer[1 - support] - dt / self.timing.double_support
        old = max(old, 0.0)
        self.transfer = (new, old) if support == LEFT else (old, new)

    def _enter(self, phase: GaitPhase, duration: float) -> None:
        self.phase = phase
        self.stance = (
            phase != GaitPhase.RIGHT_SUPPORT,
            phase != GaitPhase.LEFT_SUPPORT,
        )
        self.swing_foot: int | None = None
        if phase == GaitPhase.LEFT_SUPPORT:
            self.swing_foot = RIGHT
        elif phase == GaitPhase.RIGHT_SUPPORT:
            self.swing_foot = LEFT
        if self.swing_foot is not None:
            self.transfer = (1.0, 1.0)
        elif phase == GaitPhase.STAND:
            self.transfer = (0.0, 0.0)
        self.time_in_phase = 0.0
        self.duration = duration
