"""Balance controllers of both axes, from the controller's settings."""

from __future__ import annotations

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

    Args:
        settings: Settings of the controller.
        robot: The robot.
        params: Parameters of robot and ball.
        posture: qpos of the standing robot, at which the legs are weighed.
        dt: Control period, [s].
    """
    s = settings
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
                feedback_poles=poles,
                observer_pole=-s.balance.observer_pole_rad_s,
                cell=s.rates.preview_period_s,
                period=dt,
            )
        )
        for coupling, compliance, poles in zip(
            compute_coupling(robot, posture, params.com_height),
            (s.forces.pitch_compliance, s.forces.roll_compliance),
            (s.balance.sagittal_poles_rad_s, s.balance.lateral_poles_rad_s),
            strict=True,
        )
    )
    return sagittal, lateral
