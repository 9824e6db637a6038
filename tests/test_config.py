"""Configurations: strict reading, overrides, presets, round trip."""

from __future__ import annotations

import math
import pickle
import tomllib
from pathlib import Path

import pytest

from ballsim.config import BallConfig, CommandConfig, CommandPoint, Config
from ballsim.config_io import (
    format_config,
    list_scenarios,
    load_config,
)
from ballsim.errors import (
    BallsimError,
    ConfigError,
    MissingDependencyError,
    PhysicsError,
    ReplayMismatchError,
)
from ballsim.sensor_config import EncoderConfig
from ballsim.sensor_presets import list_sensor_presets
from ballsim.settings import read_table
from ballsim_controllers.commands import WayPoints


def _write(folder: Path, text: str) -> Path:
    file = folder / "mine.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_config_error_is_one_line_that_names_everything() -> None:
    """A message names file, key, value and what is valid, on one line."""
    error = ConfigError("ball.radius_m", -1.0, "a number\nabove 0", "a.toml")
    text = "a.toml: ball.radius_m = -1.0 is not valid: a number above 0"
    assert str(error) == text
    assert isinstance(error, BallsimError)
    assert isinstance(error, ValueError)
    assert str(ConfigError("k", 1, "2")) == "k = 1 is not valid: 2"


def test_other_errors_say_what_happened() -> None:
    """Physics and replay errors carry their details in the message."""
    assert "t = 1.500 s" in str(PhysicsError("NaN", 1.5))
    assert "a; b" in str(ReplayMismatchError(["a", "b"]))


@pytest.mark.parametrize(
    "error",
    [
        ConfigError("k", 1, "2", "a.toml"),
        PhysicsError("NaN", 1.5, {"time": [1.0]}),
        ReplayMismatchError(["a", "b"]),
        MissingDependencyError("--video", "ffmpeg"),
    ],
)
def test_errors_cross_processes(error: BallsimError) -> None:
    """An error comes back whole from a worker's process."""
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert vars(copy) == vars(error)
    assert str(copy) == str(error)


@pytest.mark.parametrize("scenario", sorted(list_scenarios()))
def test_written_config_reads_back_equal(scenario: str, tmp_path: Path) -> None:
    """The written configuration gives the same configuration again."""
    overrides = [
        "seed=7",
        "controller.gait.lift_m=0.04",
        "sensors.gyro.bias_std_rad_s=1",
    ]
    config = load_config(scenario, overrides).config
    file = tmp_path / "config.toml"
    file.write_text(format_config(config), encoding="utf-8")
    assert load_config(file).config == config


def test_written_config_holds_every_default() -> None:
    """No default is left out, so that later defaults cannot change a repeat."""
    text = format_config(load_config("stand").config)
    for key in (
        "radius_m",
        "timestep_s",
        "noise_std_n_m",
        "fall_tilt_rad",
        "max_yaw_rad",
    ):
        assert f"\n{key} = " in text


def test_every_shipped_file_has_a_description() -> None:
    """Each scenario and preset says in a line what it is."""
    shipped = {"stand", "step", "roll-to", "change-target", "constant-velocity"}
    shipped |= {"floor-target", "heading", "path", "walk", "push"}
    assert set(list_scenarios()) >= shipped
    assert set(list_sensor_presets()) == {"ideal", "high", "mid", "low"}
    for text in [*list_scenarios().values(), *list_sensor_presets().values()]:
        assert text != "no description"
        assert "\n" not in text


def test_short_name_sets_the_scenarios_parameter() -> None:
    """``target_angle`` moves the target, and the time allowed grows with it."""
    near, far = (
        load_config("roll-to").config,
        load_config("roll-to", ["target_angle=4"]),
    )
    assert near.command.timeline[0].target_ball_angle == 1.0
    assert far.config.command.timeline[0].target_ball_angle == 4.0
    assert far.config.duration - near.duration == pytest.approx(3.0 / 0.2)
    assert load_config("roll-to", ["duration_s=5"]).config.duration == 5.0


def test_speed_and_target_exclude_each_other() -> None:
    """One instant asks for a speed or for an angle, not for both."""
    assert load_config("constant-velocity", ["speed=0.2"]).config
    key = "command.timeline.0.target_angle_rad"
    with pytest.raises(ConfigError, match="one of them counts") as caught:
        load_config("constant-velocity", [f"{key}=1"])
    assert caught.value.key == key


@pytest.mark.parametrize(
    ("direction", "place"),
    [
        ("0", (2.0, 0.0)),
        ("1.5707963267948966", (0.0, 2.0)),
        ("3.141592653589793", (-2.0, 0.0)),
        ("-0.7853981633974483", (2.0**0.5, -(2.0**0.5))),
    ],
)
def test_direction_leads_from_the_heading_to_the_left(
    direction: str, place: tuple[float, float]
) -> None:
    """Distance and direction name a place on the floor; straight ahead is exact."""
    config = load_config("floor-target", [f"direction={direction}"]).config
    found = config.command.timeline[0].find_place(config.ball.radius)
    assert found == pytest.approx(place, abs=1e-12)
    assert (found[1] == 0.0) == (place[1] == 0.0)


def test_distance_and_other_aims_exclude_each_other() -> None:
    """A distance on the floor stands alone; more time is given for a longer one."""
    with pytest.raises(ConfigError, match="beside a target_angle_rad") as caught:
        load_config("floor-target", ["command.timeline.0.target_angle_rad=1"])
    assert caught.value.key == "command.timeline.0.distance_m"
    near, far = (load_config("floor-target", [f"distance={d}"]).config for d in (1, 2))
    assert far.duration - near.duration == pytest.approx(1.0 / 0.035)


@pytest.mark.parametrize(
    ("override", "key", "valid"),
    [
        ("curve=spiral", "curve", "one of none, circle, figure-eight, way-points"),
        ("radius=0.01", "radius_m", "bends with a radius of 0.05 m or more"),
        ("speed=-1", "speed_m_s", "at least 0 m/s"),
        ("waypoints=[[0, 0], [1, 1]]", "curve", "way-points, beside waypoints_m"),
        ("waypoints=[[0, 0], [1]]", "waypoints_m.1", "a place [x, y]"),
        ("waypoints=[[0, 0], [1, true]]", "waypoints_m.1", "a finite number"),
        ("waypoints=3", "waypoints_m", "a list of places [x, y]"),
        ("curve=way-points", "waypoints_m", "at least two way-points"),
    ],
)
def test_path_that_cannot_be_followed_is_named(
    override: str, key: str, valid: str
) -> None:
    """Each value that no ball can follow has a line of its own."""
    with pytest.raises(ConfigError) as caught:
        load_config("path", [override])
    assert caught.value.key == f"command.timeline.0.path.{key}"
    assert valid in caught.value.valid


def test_path_stands_alone_and_gets_the_time_that_it_takes() -> None:
    """No other aim beside it; a longer one, a slower or a smaller ball: more time."""
    with pytest.raises(ConfigError, match="none, beside a target_angle_rad") as caught:
        load_config("path", ["command.timeline.0.target_angle_rad=1"])
    assert caught.value.key == "command.timeline.0.path.curve"

    def find_time(*overrides: str) -> float:
        return load_config("path", overrides).config.duration

    circle = find_time()
    assert circle - 12.0 == pytest.approx(2.0 * math.pi / (0.14 * 0.5))
    assert find_time("radius=2") - 12.0 == pytest.approx(2.0 * (circle - 12.0))
    assert find_time("ball.radius_m=0.25") - 12.0 == pytest.approx(
        2.0 * (circle - 12.0)
    )
    assert find_time("speed=0.01") - 12.0 == pytest.approx(200.0 * math.pi)
    assert find_time("speed=9") == circle


def test_way_points_survive_being_written() -> None:
    """What the file says is what the robot is told."""
    overrides = ["curve=way-points", "waypoints=[[0, 0], [1, 0.5], [2.5, 0]]"]
    config = load_config("path", overrides).config
    again = read_table(Config, tomllib.loads(format_config(config)))
    assert again.command == config.command
    points = ((0.0, 0.0), (1.0, 0.5), (2.5, 0.0))
    assert again.command.timeline[0].path.make_path() == WayPoints(points)
    assert again.command.timeline[0].find_place(0.5) == pytest.approx((2.5, 0.0))


def test_bare_words_are_texts() -> None:
    """``--set ball.inertia=solid`` needs no quotes."""
    config = load_config("stand", ["ball.inertia=solid", "ball.radius_m=1"]).config
    assert config.ball.moment_of_inertia == pytest.approx(0.4 * 40.0)
    hollow = BallConfig(inertia="hollow").moment_of_inertia
    assert hollow == pytest.approx(2.0 / 3.0 * 40.0 * 0.25)


@pytest.mark.parametrize(
    ("text", "radius"), [(".25", 0.25), ("1.", 1.0), ("+.5", 0.5), ("2.5e-1", 0.25)]
)
def test_numbers_need_no_leading_zero(text: str, radius: float) -> None:
    """A number may be typed as shells and pocket calculators take it."""
    assert load_config("stand", [f"ball.radius_m={text}"]).config.ball.radius == radius


@pytest.mark.parametrize(
    ("override", "key", "valid"),
    [
        ("ball.radius_m=-1", "ball.radius_m", "at least 0.1 m, at most 5 m"),
        ("ball.radius_m=nan", "ball.radius_m", "finite"),
        ("ball.radius_m=inf", "ball.radius_m", "finite"),
        ("ball.radius_m=true", "ball.radius_m", "finite"),
        ("ball.radius_m=big", "ball.radius_m", "finite"),
        ("ball.radius=1", "ball.radius", "radius_m, mass_kg, inertia"),
        ("ball.inertia=1e3", "ball.inertia", "at most 6.67 kg m2"),
        ("ball.radius_m=0.12", "ball.radius_m", "at least 0.137 m (a thin shell)"),
        ("ball=3", "ball", "a table"),
        ("seed=-1", "seed", "whole number"),
        ("seed=1.5", "seed", "whole number"),
        ("scene.integrator=RK5", "scene.integrator", "RK4"),
        ("sensors.preset=perfect", "sensors.preset", "ideal"),
        ("sensors.sonar.x=1", "sensors.sonar", "encoder, gyro"),
        ("controller.gain=nan", "controller.gain", "finite"),
        (
            "simulation.control_period_s=0.0015",
            "simulation.control_period_s",
            "multiple",
        ),
        ("sensors.delay_s=0.002", "sensors.delay_s", "multiple of simulation"),
        ("drives.delay_s=0.0005", "drives.delay_s", "multiple of scene"),
        ("drives.delay_s=-1", "drives.delay_s", "at least 0 s"),
        ("sensors.noise_multiplier=-1", "sensors.noise_multiplier", "at least 0"),
        ("robot.mass_scale=0", "robot.mass_scale", "at least 0.1"),
        ("push.0.force_n=1", "push", "a list of tables"),
        ("scene.timestep_s=0.01", "scene.contact_time_constant_s", "two time steps"),
        ("target_angl=4", "target_angl", "target_angle, scenario"),
        ("target_angle=far", "command.timeline.0.target_angle_rad", "finite"),
        ("command.timeline.1.time_s=2", "command.timeline.1.time_s", "1 items"),
        (
            "command.timeline.0.stepping=1",
            "command.timeline.0.stepping",
            "true or false",
        ),
        ("seed.x=1", "seed.x", "without keys"),
        ("seed", "--set", "key=value"),
        ("=1", "--set", "key=value"),
    ],
)
def test_bad_override_is_refused(override: str, key: str, valid: str) -> None:
    """A bad override names the command line, its key, and what would be valid."""
    with pytest.raises(ConfigError) as caught:
        load_config("roll-to", ["seed=1", override])
    assert caught.value.key == key
    assert valid in caught.value.valid
    is_default = key == "scene.contact_time_constant_s"  # in no file
    place = "default value" if is_default else "command line"
    assert str(caught.value).startswith(f"{place}: ")


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("[[push]]\ntime_s = 0.0013", "push.0.time_s"),
        ("[[push]]\nduration_s = 0.0013", "push.0.duration_s"),
        ("[[push]]\nfroce_n = 1", "push.0.froce_n"),
        ("push = 1", "push"),
        ("[ball]\nradus_m = 1.0", "ball.radus_m"),
        ("sed = 1", "sed"),
        ("seed = '1'", "seed"),
        ("ball = 1", "ball"),
        ("sensors = 1", "sensors"),
        ("[sensors]\ngyro = 1", "sensors.gyro"),
        ("[command]\ntimeline = 3", "command.timeline"),
        (
            "[[command.timeline]]\ntime_s = 1\n[[command.timeline]]\ntime_s = 1",
            "command.timeline.1.time_s",
        ),
        ("[parameters]\nx = 1", "parameters.x"),
        ("seed = ", "TOML"),
    ],
)
def test_bad_file_is_refused(text: str, key: str, tmp_path: Path) -> None:
    """A bad file is named together with the key."""
    file = _write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    assert caught.value.key == key
    assert str(caught.value).startswith(f"{file}: {key} = ")


def test_unknown_scenario_lists_the_shipped_ones() -> None:
    """A wrong name is answered with the right ones."""
    with pytest.raises(ConfigError, match=r"staged-velocity, stand, step, walk"):
        load_config("stnad")


def test_users_file_is_a_scenario(tmp_path: Path) -> None:
    """A user's file has the format of the shipped ones; its stem names it."""
    file = _write(tmp_path, "duration_s = 3\n[sensors.gyro]\nnoise_std_rad_s = 0.1\n")
    config = load_config(file).config
    assert config.scenario == "mine"
    assert config.duration == 3.0
    assert config.sensors.gyro.noise_std == 0.1
    assert config.sensors.gyro.bias_std == 0.0


def test_preset_on_the_command_line_replaces_the_files_figures(tmp_path: Path) -> None:
    """A preset asked for by name is not mixed with figures of the file."""
    file = _write(tmp_path, "[sensors.gyro]\nnoise_std_rad_s = 0.1\n")
    overrides = ["sensors.gyro.bias_std_rad_s=0.2", "sensors.preset=ideal"]
    gyro = load_config(file, overrides).config.sensors.gyro
    assert gyro.noise_std == 0.0
    assert gyro.bias_std == 0.2


def test_other_controller_drops_the_files_settings(tmp_path: Path) -> None:
    """Settings are kept for the controller that they were written for."""
    file = _write(tmp_path, "[controller]\nname = 'a'\ngain = 2\n")
    same = load_config(file, ["controller.name=a"]).config.controller
    other = load_config(file, ["controller.name=b"]).config.controller
    assert dict(same.settings) == {"gain": 2}
    assert dict(other.settings) == {}


def test_values_are_checked_without_a_file_too() -> None:
    """A configuration made in Python is as strict as one that is read."""
    with pytest.raises(ConfigError):
        BallConfig(radius=math.nan)
    with pytest.raises(ConfigError):
        EncoderConfig(noise_std=-1.0)
    with pytest.raises(ConfigError):
        CommandConfig((CommandPoint(time=2.0), CommandPoint(time=1.0)))
    with pytest.raises(ConfigError):
        Config(duration=0.001)
