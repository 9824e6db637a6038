"""From commanded CoP, stance and swing to contact forces and joint torques."""

from __future__ import annotations

from ballsim_controllers.compilation import compiled
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.robot_kinematics import refresh_dynamics
from ballsim_controllers.whole_body.accelerations import (
    find_touching_points,
    wanted_accelerations,
)
from ballsim_controllers.whole_body.contact_placement import place_contacts
from ballsim_controllers.whole_body.forces import distribute_forces

__all__ = ["find_forces"]


@compiled
def find_forces(
    bodies: Record,
    estimates: Record,
    swings: Record,
    robots: Record,
    gains: Record,
    limits: Record,
    radius: float,
    cop: Array,
    stands_left: bool,
    stands_right: bool,
    transfer_left: float,
    transfer_right: float,
    com_height: float,
    heading: float,
    ball_acceleration: Array,
) -> None:
    """Write contacts, accelerations, forces and torques of one tick.

    Args:
        bodies: The result, shape (1,), dtype of `body_dtype`.
        estimates: State estimate, shape (1,), dtype `ESTIMATE`.
        swings: Reference of the swinging sole, shape (1,), dtype `SWING`.
        robots: The robot, shape (1,), dtype of `robot_dtype`.
        gains: The settings, shape (1,), from `make_gains`.
        limits: Limits of the forces, shape (1,), dtype `FORCE_LIMITS`.
        radius: Radius of the ball, [m].
        cop: Commanded CoP, shape (2,), [m].
        stands_left: Whether the left foot shall stand.
        stands_right: Whether the right foot shall stand.
        transfer_left: How far the left contact goes from its sole's centre to the CoP.
        transfer_right: The same for the right one.
        com_height: Height of the CoM over the ball's top, [m].
        heading: Direction of the trunk about the vertical, [rad].
        ball_acceleration: Of the ball's centre, predicted, shape (2,), [m/s^2].
    """
    body, estimate, robot, gain = bodies[0], estimates[0], robots[0], gains[0]
    feet = robot["feet"]
    refresh_dynamics(robots)
    stance = (stands_left, stands_right)
    contacts, shares = place_contacts(
        feet,
        cop,
        _loaded_feet(estimate["normal_forces"], stance, gain["contact_force_n"]),
        (transfer_left, transfer_right),
        (gain["cop_half_length_m"], gain["cop_half_width_m"]),
        gain["minimal_share"],
    )
    touching = find_touching_points(feet, estimate["position_ball_in_world"], shares)
    trunk, vertical, push, soles, upper = wanted_accelerations(
        gain,
        estimate,
        robot,
        radius,
        com_height,
        heading,
        ball_acceleration,
        stance,
        swings[0],
        touching,
        contacts,
        shares,
    )
    body["contacts"][:], body["shares"][:], body["soles"][:] = contacts, shares, soles
    distribute_forces(body, robot, limits[0], trunk, vertical, push, upper, touching)


@compiled
def _loaded_feet(
    normal_forces: Array, stance: tuple[bool, bool], threshold: float
) -> tuple[bool, bool]:
    """Return which of the standing feet touch the ball.

    A foot that has bounced off carries nothing, whatever is commanded; it
    is led back to the ball first.
    """
    left = stance[0] and normal_forces[0] > threshold
    right = stance[1] and normal_forces[1] > threshold
    return (left, right) if left or right else stance
