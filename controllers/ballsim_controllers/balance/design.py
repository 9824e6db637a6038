"""Balance controllers of both axes, from the controller's settings."""

from __future__ import annotations

import cmath

from ballsim_controllers.balance.axis_balance import AxisBalance, AxisDesign
from ballsim_controllers.body_pendulum import TrunkResponse, compute_coupling
from ballsim_controllers.messages import Array
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.settings import WheeledLipSettings
from ballsim_controllers.wheeled_lip import BallPendulumParameters

__all__ = ["design_balance"]


def design_balance(
    settings: WheeledLipSettings,
    robot: RobotModel,
    params: BallPendulumParameters,
    posture: Array,
    dt: float,
) -> tuple[AxisBalance, AxisBalance]:
    """Return the balance controllers along and across the heading.

    What rolls off a ball does so in a time that goes with the square root of the
    radius. Poles that are too slow for a small ball let the robot sway: across the
    heading, where the feet leave the CoP little room, with every step; along it, as
    the tilt wanders that gyros tell.

    Args:
        settings: Settings of the controller.
        robot: The robot.
        params: Parameters of robot and ball.
        posture: qpos of the standing robot, at which the legs are weighed.
        dt: Control period, [s].
    """
    s = settings
    frequency = s.balance.lateral_trunk_frequency_rad_s
    damping_ratio = s.balance.lateral_trunk_damping_ratio
    trunk = _pole_pair(frequency, damping_ratio) if frequency > 0.0 else None
    speed = max(1.0, (s.balance.poles_radius_m / params.ball.radius) ** 0.5)
    sagittal, lateral = (
        AxisBalance(
            AxisDesign(
                params=params,
                coupling=coupling,
                trunk=TrunkResponse(
                    s.forces.trunk_stiffness, s.forces.trunk_damping, compliance
                ),
                cop_lag=s.balance.cop_lag_s,
                cop_lead=s.balance.cop_lead_s,
                cop_feedback=s.balance.cop_feedback,
                feedback_poles=tuple(speed * pole for pole in poles),
                trunk_poles=trunk_poles,
                observer_pole=-s.balance.observer_pole_rad_s,
                are_feet_apart=apart,
                cell=s.rates.preview_period_s,
                period=dt,
            )
        )
        for coupling, compliance, poles, trunk_poles, apart in zip(
            compute_coupling(robot, posture, params.com_height),
            (s.forces.pitch_compliance, s.forces.roll_compliance),
            (s.balance.sagittal_poles_rad_s, s.balance.lateral_poles_rad_s),
            (None, trunk),
            (False, True),
            strict=True,
        )
    )
    return sagittal, lateral


def _pole_pair(frequency: float, damping_ratio: float) -> tuple[complex, complex]:
    """Return the pair of a natural frequency, [rad/s], and damping ratio, at most 1."""
    pole = frequency * (-damping_ratio + cmath.sqrt(damping_ratio**2 - 1.0))
    return pole, pole.conjugate()
