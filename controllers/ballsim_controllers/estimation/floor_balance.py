r"""Where the robot is over the ball, from the balance about the ball's foot.

Contacts and soles place the robot over the ball, and encoders that are off place it
millimetres aside, on a large ball the more: the sole's tilt times the radius. The floor
touches the ball in one point. About that point, which moves with the ball, nothing but
the robot's weight has a moment, so with the CoM c, the ball's centre b and its velocity
u, its mass and moment of inertia M and I, and L of the robot about its CoM

.. math::
    m g \, (c_x - b_x) + m u_x \dot c_z = \frac{d}{dt} \left[ m (c_z \dot c_x -
    (c_x - b_x) \dot c_z) + L_y + (I / r + M r) u_x \right],

and likewise along y. Encoders and ankles tell the velocities of the right side, but not
where zero is: a robot that stays on the ball has its CoM over the ball's foot in the
mean. What is seen of the left side, added up, is compared with the momentum, and an
observer with two equal poles finds by how much it is off.
"""

from __future__ import annotations

from ballsim_controllers.compilation import compiled
from ballsim_controllers.geometry import clip
from ballsim_controllers.messages import Array, BallParameters, Record
from ballsim_controllers.sensor_figures import SensorFigures

__all__ = ["find_offset", "prepare_offset"]

# Poles of the observer, [rad/s]. Faster ones follow what the momentum gets wrong in a
# stride; slower ones leave a start in error for longer.
_RATE = 0.7
_MOST = 0.05  # that a robot is found to be aside, [m]


def prepare_offset(
    levels: Record, figures: SensorFigures, ball: BallParameters, mass: float
) -> None:
    """Write the gains and what the ball adds to the momentum (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`, with its `dt`.
        figures: What the sensors are said to be; perfect ones leave nothing to find.
        ball: Parameters of the ball.
        mass: Of the robot, [kg].
    """
    levels["ball_lever"] = (ball.inertia / ball.radius + ball.mass * ball.radius) / mass
    if not figures.are_perfect:
        levels["momentum_gain"] = 2.0 * _RATE * levels["dt"]
        levels["offset_gain"] = _RATE**2 * levels["dt"]


@compiled
def find_offset(
    levels: Record,
    estimates: Record,
    turning: Array,
    is_balance: bool,
    robots: Record,
) -> None:
    """Follow how far the robot is from where contacts and soles place it (in place).

    Args:
        levels: Shape (1,), dtype `LEVEL`.
        estimates: The tick's estimate, shape (1,), dtype `ESTIMATE`.
        turning: Angular momentum L about the CoM, in the world, shape (3,), [N m s].
        is_balance: False while others than floor and gravity act, or the feet hang.
        robots: The robot, shape (1,), dtype of `robot_dtype`.
    """
    mass, gravity = robots[0]["mass"], robots[0]["gravity"]
    state, estimate = levels[0], estimates[0]
    com, ball = estimate["position_com_in_world"], estimate["position_ball_in_world"]
    velocity = estimate["linear_velocity_com_in_world"]
    rolling = estimate["linear_velocity_ball_in_world"]
    momentum, offset = state["floor_momentum"], state["offset"]
    for j in range(2):
        aside = com[j] - ball[j]
        about = turning[1] if j == 0 else -turning[0]
        seen = com[2] * velocity[j] - aside * velocity[2] + about / mass
        seen = (seen + state["ball_lever"] * rolling[j]) / gravity
        if not is_balance:
            momentum[j] = seen
            continue
        momentum[j] += state["dt"] * (aside + rolling[j] * velocity[2] / gravity)
        ahead = seen - momentum[j]
        momentum[j] += state["momentum_gain"] * ahead
        offset[j] = clip(offset[j] + state["offset_gain"] * ahead, -_MOST, _MOST)
