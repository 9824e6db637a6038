"""What a control tick does between two decisions, compiled as one.

`sense` is all from the reading to the observed states, `act` all from the planned
CoP to the contact forces. What they are made of stands in the blocks themselves.
"""

from __future__ import annotations

import math

import numpy as np

from ballsim_controllers.balance.axis_balance import follow_cop
from ballsim_controllers.balance.measures import (
    observe_axes,
    predict_ball_acceleration,
)
from ballsim_controllers.balance.stride_memory import repeat_cop
from ballsim_controllers.compilation import compiled
from ballsim_controllers.estimation.health import check_readings, trust_legs
from ballsim_controllers.estimation.state_estimator import update_estimate
from ballsim_controllers.footsteps.swing import advance_swing
from ballsim_controllers.heading_frame import enter_frame, leave_frame
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.whole_body.force_control import find_forces
from ballsim_controllers.whole_body.set_points import write_set_points
from ballsim_controllers.whole_body.standing_soles import follow_soles

__all__ = ["CONSTANTS", "act", "finish", "sense"]

#: What `act` needs beside its records: control period, [s]; c and 2 r_0 / h of
#: `predict_ball_acceleration`; wanted height of the CoM over the ball's top, [m], and
#: direction of the trunk in its frame, [rad].
CONSTANTS = np.dtype(
    [
        (name, np.float64)
        for name in ("dt", "ball_stiffness", "ball_tilt", "com_height", "heading")
    ]
)


@compiled
def sense(
    states: Array,
    reports: Record,
    estimates: Record,
    readings: Record,
    headings: Record,
    axes: Record,
    is_single: bool,
    healthies: Record,
    healths: Record,
    raws: Record,
    joints: Array,
    accelerations: Array,
    fusions: Record,
    balls: Record,
    tilts: Record,
    levels: Record,
    covariances: Record,
    contacts: Record,
    foot_parameters: Record,
    robots: Record,
) -> tuple[float, float]:
    """Check the sensors, estimate the state and observe both axes.

    Args:
        states: Gets the state of each axis, shape (2, 7).
        reports: The tick's report, whose estimate is written, shape (1,).
        estimates: Gets the estimate in the robot's frame, shape (1,), dtype `ESTIMATE`.
        readings: The reading, shape (1,), dtype of `reading_dtype`.
        headings: The frame, shape (1,), dtype `HEADING`.
        axes: Observers of both axes, shape (2,), dtype `AXIS`.
        is_single: True in single support.
        healthies: See `check_readings`, as what follows.
        healths: State of the sensors' monitor.
        raws: The reading before.
        joints: What the monitor counts for each joint.
        accelerations: Generalised acceleration asked for, shape (6 + n,).
        fusions: See `update_estimate`, as what follows.
        balls: State of the ball's estimator.
        tilts: State of the tilt filter.
        levels: State of levelling and rolling.
        covariances: Of the errors.
        contacts: Contact of each foot.
        foot_parameters: Parameters of the feet.
        robots: The robot.

    Returns:
        Normal force on each foot (left, right), [N].
    """
    in_world = reports["estimate"]
    check_readings(
        healthies,
        healths,
        raws,
        joints,
        accelerations,
        readings,
        fusions[0]["rotation_imu_to_trunk"],
        tilts[0]["rotation"],
        robots[0]["gravity"],
    )
    reports[0]["ill_sensors"] = healths[0]["ill"]
    trust_legs(fusions[0]["leg_trust"], joints, robots[0]["legs"])
    update_estimate(
        in_world,
        healthies,
        fusions,
        balls,
        tilts,
        levels,
        covariances,
        contacts,
        foot_parameters,
        robots,
    )
    enter_frame(estimates, in_world, headings, robots)
    observe_axes(states, axes, estimates, is_single)
    loads = estimates[0]["normal_forces"]
    return loads[0], loads[1]


@compiled
def act(
    bodies: Record,
    estimates: Record,
    command: Array,
    replacement: Array,
    stands_left: bool,
    stands_right: bool,
    transfer_left: float,
    transfer_right: float,
    swing_time: float,
    is_hanging: bool,
    axes: Record,
    memories: Record,
    swings: Record,
    paths: Record,
    standing: Record,
    constants: Record,
    robots: Record,
    gains: Record,
    limits: Record,
    radius: float,
) -> None:
    """Move CoP and swing foot on and find the contact forces.

    Args:
        bodies: The result, shape (1,), dtype of `body_dtype`.
        estimates: The estimate in the robot's frame, shape (1,), dtype `ESTIMATE`.
        command: CoP of the plan, shape (2,), [m].
        replacement: CoP that takes its place at once, NaN where none does, (2,), [m].
        stands_left: Whether the left foot shall stand.
        stands_right: Whether the right foot shall stand.
        transfer_left: How far the left contact goes from its sole's centre to the CoP.
        transfer_right: The same for the right one.
        swing_time: Time since lift-off, [s]; negative where no foot swings.
        is_hanging: True where the swinging foot stays where it is.
        axes: Observers of both axes, shape (2,), dtype `AXIS`.
        memories: What strides taught, shape (1,), dtype `STRIDE_MEMORY`.
        swings: Gets the reference of the swinging sole, shape (1,), dtype `SWING`.
        paths: Path of the swinging foot, shape (1,).
        standing: What is kept while both feet stand, dtype `STANDING_SOLES`.
        constants: What does not change, shape (1,), dtype `CONSTANTS`.
        robots: See `find_forces`, as what follows.
        gains: Settings of the whole-body layer.
        limits: Limits of the forces.
        radius: Radius of the ball, [m].
    """
    estimate, constant = estimates[0], constants[0]
    cop = follow_cop(axes, command, swing_time == 0.0)
    swing_foot = 0 if not stands_left else (-1 if stands_right else 1)
    repeat_cop(cop, memories, axes, swing_foot)
    for i in range(2):
        if not math.isnan(replacement[i]):
            cop[i] = replacement[i]
    pull = predict_ball_acceleration(
        estimates, cop, constant["ball_stiffness"], constant["ball_tilt"]
    )
    if swing_time >= 0.0:
        advance_swing(
            swings,
            paths,
            swing_time,
            constant["dt"],
            estimate["position_ball_in_world"],
            estimate["linear_velocity_ball_in_world"],
        )
        if is_hanging:
            swings[0]["linear_acceleration"][:] = 0.0
            swings[0]["angular_acceleration"][:] = 0.0
    turn, splay, parted = follow_soles(
        standing, robots[0]["feet"], stands_left and stands_right, constant["dt"]
    )
    bodies[0]["twist"] = gains[0]["splay_stiffness_n_m_per_rad"] * splay
    bodies[0]["squeeze"] = gains[0]["parting_stiffness_n_per_m"] * parted
    find_forces(
        bodies,
        estimates,
        swings,
        robots,
        gains,
        limits,
        radius,
        cop,
        stands_left,
        stands_right,
        transfer_left,
        transfer_right,
        constant["com_height"],
        constant["heading"] + turn,
        pull,
    )


@compiled
def finish(
    positions: Array,
    reports: Record,
    bodies: Record,
    phase: int,
    step_count: int,
    reference: float,
    ideal_cop: Array,
    target_com: Array,
    target_soles: Array,
    ik_positions: Array,
    ik_velocity: Array,
    dt: float,
    robots: Record,
    headings: Record,
) -> None:
    """Write the set-points, and all fields of the tick's report but its estimate.

    Args:
        positions: The set-points, shape (n,), [rad].
        reports: The report, shape (1,), dtype of `telemetry_dtype`.
        bodies: Forces of the tick, shape (1,), dtype of `body_dtype`.
        phase: Gait phase.
        step_count: Touchdowns so far.
        reference: Shaped reference of the ball's angle, [rad].
        ideal_cop: CoP that the balance controller wants, shape (2,), [m].
        target_com: CoM target of the whole-body layer, shape (3,), [m].
        target_soles: Sole targets, shape (2, 3), [m].
        ik_positions: See `write_set_points`, as what follows.
        ik_velocity: Velocity of the posture.
        dt: Control period, [s].
        robots: The robot.
        headings: The frame that all of this is in, shape (1,), dtype `HEADING`.
    """
    write_set_points(positions, ik_positions, ik_velocity, dt, bodies, robots)
    report, body = reports[0], bodies[0]
    report["phase"] = phase
    report["step_count"] = step_count
    report["reference_ball_angle"] = reference
    report["ideal_cop"][:] = ideal_cop
    report["commanded_cop"][:] = body["cop"]
    report["target_com"][:] = target_com
    report["target_soles"][:] = target_soles
    report["joint_torques"][:] = body["joint_torques"]
    leave_frame(report, headings)
