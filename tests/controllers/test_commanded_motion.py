"""Laws of the commanded motion: what moves the reference, and what shifts it."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim_controllers.body_pendulum import BALL, COM, COP, SettledMotion
from ballsim_controllers.commanded_motion import CommandedMotion
from ballsim_controllers.commands import Circle, Command, WayPoints
from ballsim_controllers.messages import Array, BallParameters
from ballsim_controllers.settings import WheeledLipSettings, load_settings
from ballsim_controllers.wheeled_lip import BallPendulumParameters

DT, STRIDE, COUNT, LAG, STEP_TIME = 0.005, 4, 40, 0.02, 0.34
PARAMS = BallPendulumParameters(BallParameters(0.5, 40.0, 0.5), 65.0, 0.9)
SETTINGS = load_settings(WheeledLipSettings, "wheeled-lip", {}).reference


def make_motion(params: BallPendulumParameters) -> CommandedMotion:
    """Return a motion at rest."""
    return CommandedMotion(SETTINGS, params, LAG, DT, STRIDE, COUNT, STEP_TIME)


@pytest.fixture
def motion() -> CommandedMotion:
    """Return a motion at rest on the ball of half a metre."""
    return make_motion(PARAMS)


def test_none_goes_on_with_what_is_under_way(motion: CommandedMotion) -> None:
    """Without a command the reference stays at rest, or moves on to its target."""
    for _ in range(300):
        motion.advance(None)
    assert motion.angle == 0.0
    motion.advance(Command(0.5))
    for _ in range(3000):
        motion.advance(None)
    assert motion.angle == 0.5
    assert motion.has_arrived(Command(0.5))
    assert not motion.has_arrived(Command(0.4))


@pytest.mark.parametrize("offset", [-0.03, 0.0, 0.05])
def test_lasting_error_dies_out_at_the_integral_rate(
    motion: CommandedMotion, offset: float
) -> None:
    """A ball that keeps its place plus an offset comes to the place itself."""
    error, elapsed = offset, STRIDE * DT
    for _ in range(250):
        shift = motion.foresee()[0][0, BALL]
        error = shift + offset
        motion.correct(error, elapsed, is_needed=True)
    time = 249 * elapsed
    decay = np.exp(-SETTINGS.integral_rate_1_s * time)
    assert error == pytest.approx(offset * decay, rel=0.02)


def test_shift_moves_all_places_alike(motion: CommandedMotion) -> None:
    """A shift is a move on the floor: CoM, ball and CoP keep their distances."""
    for _ in range(2000):
        motion.advance(Command(3.0))
    states, inputs = motion.foresee()
    angle = motion.angle * PARAMS.ball.radius
    motion.correct(angle - 0.1, 1.0, is_needed=True)
    shifted, shifted_inputs = motion.foresee()
    shift = 0.1 * SETTINGS.integral_rate_1_s
    moved = np.zeros(len(states[0]))
    moved[[COM, BALL, COP]] = shift
    np.testing.assert_allclose(shifted - states, np.tile(moved, (COUNT, 1)), atol=1e-12)
    np.testing.assert_allclose(shifted_inputs - inputs, shift, atol=1e-12)


def test_shift_is_limited_and_let_go(motion: CommandedMotion) -> None:
    """A large error shifts by 8 cm at most; not needed, it goes back to none."""
    for _ in range(1000):
        motion.correct(-1.0, 0.02, is_needed=True)
    assert motion.foresee()[0][0, BALL] == pytest.approx(0.08)
    assert motion.find_place()[0] == pytest.approx(0.08)
    for _ in range(1000):
        motion.correct(-1.0, 0.02, is_needed=False)
    left = 0.08 * np.exp(-SETTINGS.integral_rate_1_s * 20.0)
    assert motion.foresee()[0][0, BALL] == pytest.approx(left, rel=0.1)


def test_robot_without_a_shift_has_the_plain_reference(motion: CommandedMotion) -> None:
    """An error alone never shifts: the states are those of the settled motion."""
    motion.correct(0.02, 0.02, is_needed=False)
    states, inputs = motion.foresee()
    plain = SettledMotion(PARAMS, LAG).follow(np.zeros((COUNT, 4)), 0.5)
    np.testing.assert_array_equal(states, plain[0])
    np.testing.assert_array_equal(inputs, plain[1])


def test_speed_is_kept_within_its_limits() -> None:
    """A commanded speed replaces the target; no ball is asked for more than it may."""
    for radius in (0.25, 1.0):
        ball = BallParameters(radius, 40.0, 0.5)
        params = BallPendulumParameters(ball, 65.0, 0.9)
        limit = min(SETTINGS.max_cruise_rad_s, SETTINGS.max_cruise_m_s / radius)
        for wanted in (0.2, 5.0, -5.0):
            motion = make_motion(params)
            command = Command(ball_speed=wanted)
            for _ in range(12000):
                motion.advance(command)
            expected = float(np.clip(wanted, -limit, limit))
            assert motion.present.velocity == pytest.approx(expected)
            assert motion.speed == pytest.approx(radius * abs(expected))
            assert not motion.has_arrived(command)


@pytest.mark.parametrize("direction", [0.3, 1.1, 1.5, 2.2, -0.7, -2.9])
@pytest.mark.parametrize("radius", [0.25, 1.0])
def test_way_to_a_place_is_straight(direction: float, radius: float) -> None:
    """Both axes start, cruise and arrive together, within their limits."""
    ball = BallParameters(radius, 40.0, 0.5)
    motion = make_motion(BallPendulumParameters(ball, 65.0, 0.9))
    target = 2.0 * np.array([np.cos(direction), np.sin(direction)])
    command = Command(target[0] / radius, lateral_target=target[1])
    places, speeds = [], []
    for _ in range(16000):
        motion.advance(command)
        lateral = motion.foresee_sideways()
        assert lateral is not None
        places.append([radius * motion.angle, lateral.states[0, BALL]])
        speeds.append([motion.present.velocity * radius, lateral.states[0, BALL + 1]])
        if motion.has_arrived(command):
            break
    track, rate = np.array(places), np.abs(speeds).max(axis=0)
    np.testing.assert_allclose(track[-1], target, atol=1e-9)
    across = track @ np.array([-np.sin(direction), np.cos(direction)])
    assert np.abs(across).max() < 1e-6
    forwards = min(SETTINGS.max_speed_m_s, SETTINGS.max_speed_rad_s * radius)
    sideways = min(SETTINGS.max_lateral_m_s, SETTINGS.max_lateral_rad_s * radius)
    assert np.hypot(*(rate / [forwards, sideways])) == pytest.approx(1.0, rel=1e-3)


def test_straight_ahead_knows_no_side(motion: CommandedMotion) -> None:
    """Without a lateral target nothing is planned across the heading."""
    for _ in range(1000):
        motion.advance(Command(1.0))
    assert motion.foresee_sideways() is None


def follow(motion: CommandedMotion, command: Command, ticks: int = 40000) -> Array:
    """Return places and velocities on the floor until the motion arrives, (n, 2, 2)."""
    track = []
    for _ in range(ticks):
        motion.advance(command)
        lateral = motion.foresee_sideways()
        assert lateral is not None
        along = motion.foresee()[0][0]
        track.append([along[[BALL, BALL + 1]], lateral.states[0, [BALL, BALL + 1]]])
        if motion.has_arrived(command):
            break
    return np.array(track).transpose(0, 2, 1)


@pytest.mark.parametrize("place", [(2.0, 0.5), (-0.3, 1.0), (0.4, -0.9)])
def test_two_way_points_are_the_way_to_a_place(place: tuple[float, float]) -> None:
    """A path of two points is what a target at its end asks for, all the way."""
    path = Command(path=WayPoints(((0.0, 0.0), place)))
    target = Command(place[0] / PARAMS.ball.radius, lateral_target=place[1])
    by_path, by_target = (follow(make_motion(PARAMS), c) for c in (path, target))
    n = min(len(by_path), len(by_target))
    assert abs(len(by_path) - len(by_target)) <= 2
    np.testing.assert_allclose(by_path[:n], by_target[:n], atol=2e-4)


def test_path_begins_at_its_first_point(motion: CommandedMotion) -> None:
    """The ball goes there straight, whatever it did before, and comes to rest."""
    cruise = Command(ball_speed=0.3)
    for _ in range(2000):
        motion.advance(cruise)
    command = Command(path=WayPoints(((0.5, 0.4), (1.0, 0.5), (1.2, 1.0))))
    assert not motion.has_arrived(command)
    track = follow(motion, command)
    assert motion.has_arrived(command)
    assert not motion.has_arrived(cruise)
    places, speeds = track[:, 0], np.hypot(*track[:, 1].T)
    start = int(np.argmin(np.hypot(*(places - [0.5, 0.4]).T)))
    assert places[start] == pytest.approx([0.5, 0.4], abs=1e-4)
    assert speeds[start] < 1e-3
    assert places[-1] == pytest.approx([1.2, 1.0], abs=1e-9)
    np.testing.assert_allclose(np.diff(places, axis=0) / DT, track[1:, 1], atol=2e-3)


def test_command_ends_a_path_without_a_jump(motion: CommandedMotion) -> None:
    """The reference comes to rest on the circle and goes on from there."""
    circle = Command(path=Circle(1.0))
    head = follow(motion, circle, ticks=3000)
    assert np.hypot(*(head[-1, 0] - [0.0, 1.0])) == pytest.approx(1.0, abs=1e-3)
    home = Command(0.0)
    assert not motion.has_arrived(home)
    back = follow(motion, home)
    assert back[-1, 0] == pytest.approx([0.0, 0.0], abs=1e-9)
    track = np.concatenate((head, back))
    np.testing.assert_allclose(
        np.diff(track[:, 0], axis=0) / DT, track[1:, 1], atol=2e-3
    )
    assert np.abs(np.diff(track[:, 1], axis=0)).max() < 2e-3


def test_arrived_path_is_not_another_one(motion: CommandedMotion) -> None:
    """Who has followed one path has not followed the next one, nor its mirror."""
    path = Command(path=WayPoints(((0.0, 0.0), (0.1, 0.1))))
    follow(motion, path)
    assert motion.has_arrived(path)
    assert not motion.has_arrived(Command(path=WayPoints(((0.0, 0.0), (0.1, -0.1)))))
    assert not motion.has_arrived(Command(0.1))


def turn_to(motion: CommandedMotion, command: Command) -> Array:
    """Return the frame's angle at each tick until the motion arrives."""
    angles = []
    for _ in range(6000):
        if motion.is_turning:
            motion.turn()
        motion.advance(command)
        angles.append(float(motion.frame["angle"][0]))
        if motion.has_arrived(command):
            break
    return np.array(angles)


@pytest.mark.parametrize("heading", [0.4, np.pi / 2.0, -np.pi / 2.0, -2.5])
def test_turn_is_smooth_and_within_its_limits(
    motion: CommandedMotion, heading: float
) -> None:
    """From rest to rest, no faster and no harder than the settings allow."""
    assert not motion.is_turning
    angles = turn_to(motion, Command(heading=heading))
    assert angles[-1] == heading
    assert not motion.is_turning
    assert motion.turn_rate == 0.0
    rates = np.diff(angles) / DT
    assert np.abs(rates).max() <= SETTINGS.max_turn_rad_s * (1.0 + 1e-6)
    hardness = np.abs(np.diff(rates)).max() / DT
    assert hardness <= SETTINGS.max_turn_rad_s2 * (1.0 + 1e-6)
    assert (np.sign(heading) * rates >= -1e-9).all()


def test_robot_turns_the_shorter_way(motion: CommandedMotion) -> None:
    """A heading is a direction: a full turn more or less is none."""
    angles = turn_to(motion, Command(heading=1.5 * np.pi))
    assert angles[-1] == pytest.approx(-0.5 * np.pi)
    assert motion.has_arrived(Command(heading=1.5 * np.pi))
    angles = turn_to(motion, Command(heading=-0.5 * np.pi))
    assert np.ptp(angles) < 1e-12


def test_frame_sees_the_reference_turned(motion: CommandedMotion) -> None:
    """A robot that faces left has what is ahead of its start to its right."""
    facing_left = Command(1.0, heading=np.pi / 2.0)
    turn_to(motion, facing_left)
    place = motion.find_place()
    np.testing.assert_allclose(place, [0.0, -PARAMS.ball.radius], atol=1e-9)
    lateral = motion.foresee_sideways()
    assert lateral is not None
    np.testing.assert_allclose(lateral.states[:, BALL], -PARAMS.ball.radius)
    np.testing.assert_allclose(motion.foresee()[0][:, BALL], 0.0, atol=1e-9)
    assert motion.angle == pytest.approx(1.0)  # in the world


def test_steady_heading_has_its_own_forwards() -> None:
    """A robot that faces left is faster to the left than ahead, as before it turned."""
    duration = {}
    for heading in (0.0, np.pi / 2.0):
        for place in ((2.0, 0.0), (0.0, 2.0)):
            motion = make_motion(PARAMS)
            turn_to(motion, Command(heading=heading))
            goal = Command(
                place[0] / PARAMS.ball.radius, lateral_target=place[1], heading=heading
            )
            duration[heading, place] = len(turn_to(motion, goal))
    assert duration[0.0, (2.0, 0.0)] < 0.7 * duration[0.0, (0.0, 2.0)]
    for (heading, place), ticks in duration.items():
        if heading:
            swapped = (place[1], place[0])
            assert ticks == pytest.approx(duration[0.0, swapped], abs=3)


@pytest.mark.parametrize("radius", [1.0, -1.0])
def test_facing_the_path_is_its_tangent(motion: CommandedMotion, radius: float) -> None:
    """All the way around, forwards at every instant; the reference stays smooth."""
    command = Command(path=Circle(radius), is_facing_path=True)
    angles, speeds = [], []
    for _ in range(20000):
        if motion.is_turning:
            motion.turn()
        motion.advance(command)
        angles.append(float(motion.frame["angle"][0]))
        lateral = motion.foresee_sideways()
        assert lateral is not None
        along = motion.foresee()[0][0, BALL + 1]
        speeds.append([along, lateral.states[0, BALL + 1]])
        if motion.has_arrived(command):
            break
    assert angles[-1] == pytest.approx(np.sign(radius) * 2.0 * np.pi)
    velocity = np.array(speeds)
    assert np.abs(velocity[:, 1]).max() < 2e-3
    assert velocity[:, 0].min() > -1e-9
    assert velocity[:, 0].max() > 1.5 * SETTINGS.max_lateral_m_s
    ahead = Command(heading=0.0)
    assert not motion.has_arrived(ahead)
    assert np.ptp(turn_to(motion, ahead)) < 1e-9  # it faces ahead already
