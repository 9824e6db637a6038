"""Random numbers of the sensors' effects, and the parts behind their figures."""

from __future__ import annotations

import dataclasses
import tomllib
from importlib import resources
from typing import Any

import numpy as np
import pytest
from tests.sensor_readings import (
    PERIOD,
    make_noise,
    make_zeros,
    prepare_sensors,
    read_all,
)

from ballsim.config_io import load_config
from ballsim.errors import ConfigError
from ballsim.preparation import PreparedRun
from ballsim.sensor_config import SENSORS, EncoderConfig, GyroConfig, SensorsConfig
from ballsim.sensor_presets import list_sensor_parts
from ballsim.sensors import SensorSuite
from ballsim_controllers.messages import Array


@pytest.fixture(scope="module")
def prepared() -> PreparedRun:
    """Return a run of the shipped robot; only its sensors are of interest."""
    return prepare_sensors()


_ON: dict[str, tuple[str, dict[str, float]]] = {
    "walk": ("gyro", {"random_walk": 0.1}),
    "scale": ("foot_force", {"scale_std": 0.1}),
    "axes": ("accelerometer", {"misalignment_std": 0.1}),
    "coupling": ("foot_torque", {"coupling_std": 0.1}),
    "drops": ("ball_gyro", {"drop_probability": 0.3}),
    "rounding": ("encoder", {"resolution": 0.01}),
    "delay": ("gyro", {"delay": 0.003}),
    "louder": ("encoder", {"noise_multiplier": 3.0}),
}


@pytest.mark.parametrize("effect", sorted(_ON))
def test_an_effect_leaves_all_other_draws(prepared: PreparedRun, effect: str) -> None:
    """Common random numbers: what one sensor gets is never another one's draw."""
    base = load_config("stand", ["sensors.preset=mid"]).config.sensors
    sensor, figures = _ON[effect]
    table = dataclasses.replace(getattr(base, sensor), **figures)
    truth = make_noise(prepared, 400)
    changes: dict[str, Any] = {sensor: table}
    before = read_all(prepared, base, truth)
    after = read_all(prepared, dataclasses.replace(base, **changes), truth)
    for name in SENSORS:
        if name == sensor:
            assert (before[name] != after[name]).any()
        else:
            np.testing.assert_array_equal(before[name], after[name])


def test_an_effect_leaves_the_other_draws_of_its_sensor(prepared: PreparedRun) -> None:
    """White noise, bias and walk are those of each alone; levels scale all draws."""
    truth = make_zeros(prepared, 400)

    def read(level: float = 1.0, **figures: float) -> Array:
        gyro = GyroConfig(noise_multiplier=level, **figures)
        return read_all(prepared, SensorsConfig(gyro=gyro), truth, 7)["gyro"]

    parts = ({"noise_std": 0.1}, {"bias_std": 0.2}, {"random_walk": 0.3})
    together = read(noise_std=0.1, bias_std=0.2, random_walk=0.3)
    apart = sum(read(**part) for part in parts)
    np.testing.assert_allclose(together, apart, rtol=0.0, atol=1e-12)
    louder = read(4.0, noise_std=0.1, bias_std=0.2, random_walk=0.3)
    np.testing.assert_allclose(louder, 4.0 * together, rtol=1e-12)


def test_same_seed_gives_the_same_bits(prepared: PreparedRun) -> None:
    """With every effect on, the seed decides every bit."""
    loaded = load_config(
        "stand",
        [
            "sensors.preset=low",
            *(f"sensors.{sensor}.drop_probability=0.1" for sensor in SENSORS),
            *(f"sensors.{sensor}.delay_s=0.003" for sensor in SENSORS),
            *(f"sensors.{sensor}.rate_hz=300" for sensor in SENSORS),
        ],
    )
    truth = make_noise(prepared, 600)

    def sample(seed: int) -> bytes:
        readings = read_all(prepared, loaded.config.sensors, truth, seed)
        return b"".join(values.tobytes() for values in readings.values())

    assert sample(3) == sample(3)
    assert sample(3) != sample(4)


def test_nothing_is_shaped_where_nothing_is_asked_for(prepared: PreparedRun) -> None:
    """The preset `ideal`, and noise alone, take the short way."""
    noisy = SensorsConfig(gyro=GyroConfig(noise_std=0.1, bias_std=0.1, rate=1e4))
    for config in (SensorsConfig(), noisy):
        assert SensorSuite(prepared.ids, config, PERIOD, 0)._signal is None
    late = SensorsConfig(gyro=GyroConfig(delay=0.001))
    assert SensorSuite(prepared.ids, late, PERIOD, 0)._signal is not None


def test_long_way_gives_the_bits_of_the_short_one(prepared: PreparedRun) -> None:
    """What is not shaped reads the same where another sensor is shaped."""
    base = load_config("stand", ["sensors.preset=ideal"]).config.sensors
    noisy = dataclasses.replace(base, encoder=EncoderConfig(noise_std=0.1))
    truth = make_noise(prepared, 300)
    short = read_all(prepared, noisy, truth)
    late = dataclasses.replace(noisy, ball_gyro=GyroConfig(delay=0.01))
    long = read_all(prepared, late, truth)
    for name in (*SENSORS[:-1], "velocity"):
        np.testing.assert_array_equal(short[name], long[name])


def test_parts_stand_below_what_is_given() -> None:
    """A part replaces the preset's figures of its sensor, not the user's own."""
    loaded = load_config(
        "stand",
        [
            "sensors.preset=low",
            "sensors.gyro.part=bmi088",
            "sensors.gyro.bias_std_rad_s=0.5",
            "sensors.ball_gyro.part=adis16448",
        ],
    )
    sensors = loaded.config.sensors
    assert sensors.gyro.noise_density == 2.44e-4
    assert sensors.gyro.bias_std == 0.5
    assert sensors.ball_gyro.noise_density == 3.39e-4
    assert sensors.accelerometer.noise_density == 1e-2
    assert sensors.accelerometer.part == "none"


@pytest.mark.parametrize("name", sorted(list_sensor_parts()))
def test_every_part_can_beread_all(name: str) -> None:
    """Every key of a part is one of its sensor's, and says something."""
    text = resources.files("ballsim").joinpath(f"parts/{name}.toml").read_text("utf-8")
    kinds = set(tomllib.loads(text)) - {"description"}
    assert kinds
    for kind in kinds:
        table = getattr(
            load_config("stand", [f"sensors.{kind}.part={name}"]).config.sensors, kind
        )
        assert table.part == name
        assert table != type(table)(part=name)
    for kind in set(SENSORS[:-1]) - kinds:
        with pytest.raises(ConfigError, match="one of none"):
            load_config("stand", [f"sensors.{kind}.part={name}"])


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("sensors.gyro.part=bmi999", "sensors.gyro.part"),
        ("sensors.encoder.part=bmi088", "sensors.encoder.part"),
        ("sensors.gyro.rate_hz=-1", "sensors.gyro.rate_hz"),
        ("sensors.gyro.drop_probability=1.5", "sensors.gyro.drop_probability"),
        ("sensors.gyro.delay_s=2", "sensors.gyro.delay_s"),
        ("sensors.gyro.scale_std=-0.1", "sensors.gyro.scale_std"),
        ("sensors.gyro.dropout_duration_s=1", "sensors.gyro.dropout_duration_s"),
        ("sensors.encoder.limit_rad_s=1", "sensors.encoder.limit_rad_s"),
        ("sensors.foot_force.coupling_std_m=1", "sensors.foot_force.coupling_std_m"),
    ],
)
def test_bad_figures_are_named(override: str, key: str) -> None:
    """The message is one line and names the key."""
    with pytest.raises(ConfigError) as caught:
        load_config("stand", [override])
    assert caught.value.key == key
    assert "\n" not in str(caught.value)
