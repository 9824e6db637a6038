"""What the ball shall do: from the operator's command to the planner's reference."""

from __future__ import annotations

from ballsim_controllers.body_pendulum import BALL, COM, COP, SettledMotion
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, Command
from ballsim_controllers.reference import RampReference, ReferenceSample
from ballsim_controllers.reference_window import ReferenceWindow
from ballsim_controllers.settings import ReferenceSettings
from ballsim_controllers.wheeled_lip import BallPendulumParameters

__all__ = ["CommandedMotion"]

_LARGEST_SHIFT = 0.08
"""Of the reference against a lasting error, [m]; a greater one has another cause."""


class CommandedMotion:
    """Shaped reference of the ball along the heading, with states that belong to it.

    While the robot steps, the reference is shifted against the lasting error of the
    ball's place: the integral part, which state feedback lacks. Legs that swing and
    soles that roll make the measured CoM differ from the model's by millimetres,
    and the ball would rest where feedback makes up for them, centimetres off.

    Args:
        settings: Limits of the reference.
        params: Parameters of robot and ball.
        cop_lag: Time constant from the commanded CoP to the CoP, [s].
        dt: Control period, [s].
        stride: Control periods per cell of the preview.
        count: Cells of the preview.
    """

    def __init__(
        self,
        settings: ReferenceSettings,
        params: BallPendulumParameters,
        cop_lag: float,
        dt: float,
        stride: int,
        count: int,
    ) -> None:
        """Start at rest."""
        self._radius = radius = params.ball.radius
        self._largest_cruise = min(
            settings.max_cruise_rad_s, settings.max_cruise_m_s / radius
        )
        self._integral_rate = settings.integral_rate_1_s
        ramp = RampReference(
            min(settings.max_speed_rad_s, settings.max_speed_m_s / radius),
            min(
                settings.max_acceleration_rad_s2,
                settings.max_acceleration_m_s2 / radius,
            ),
            settings.smoothing_time_s,
        )
        self._window = ReferenceWindow(ramp, dt, stride, count)
        self._settled = SettledMotion(params, cop_lag)
        self._shift = 0.0

    @property
    def present(self) -> ReferenceSample:
        """Return the reference of the ball's angle at this instant."""
        return self._window.present

    @property
    def angle(self) -> float:
        """Return the reference of the ball's angle at this instant, [rad]."""
        return self._window.position

    def advance(self, command: Command | None) -> None:
        """Move the reference on by one control period.

        Args:
            command: What to do, or None to go on with what is under way.
        """
        if command is None:
            self._window.advance(None)
        else:
            limit = self._largest_cruise
            speed = clip(command.ball_speed, -limit, limit)
            self._window.advance(command.target_ball_angle, speed)

    def has_arrived(self, command: Command) -> bool:
        """Return whether the reference rests where a command wants the ball."""
        if command.ball_speed != 0.0:
            return False
        return self._window.has_arrived(command.target_ball_angle)

    def correct(self, ball: float, elapsed: float, is_stepping: bool) -> None:
        """Shift the reference against a lasting error of the ball's place.

        Args:
            ball: Where the ball is along the heading, [m].
            elapsed: Time since the last call, [s].
            is_stepping: False to let the shift go: standing needs none.
        """
        error = self._radius * self._window.position - ball
        if not is_stepping:
            error = -self._shift
        shift = self._shift + self._integral_rate * elapsed * error
        self._shift = clip(shift, -_LARGEST_SHIFT, _LARGEST_SHIFT)

    def foresee(self) -> tuple[Array, Array]:
        """Return reference states, (N, 7), and CoP, (N,), [m], of the cells to come."""
        states, inputs = self._settled.follow(self._window.future(), self._radius)
        if self._shift != 0.0:
            states[:, (COM, BALL, COP)] += self._shift
            inputs += self._shift
        return states, inputs
