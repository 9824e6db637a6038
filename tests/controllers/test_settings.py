"""Laws of the settings: a preset that is complete, overrides that are checked."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from importlib import resources
from typing import Any

import pytest

from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import BallParameters, ControllerSetup
from ballsim_controllers.pipeline import create_wheeled_lip
from ballsim_controllers.robot import RobotDescription
from ballsim_controllers.settings import WheeledLipSettings, load_settings

PRESET = "wheeled-lip"


def shipped_preset() -> dict[str, Any]:
    """Return the shipped preset as it stands in its file."""
    folder = resources.files("ballsim_controllers") / "presets"
    return tomllib.loads((folder / f"{PRESET}.toml").read_text(encoding="utf-8"))


KEYS = [(table, key) for table, values in shipped_preset().items() for key in values]
NUMBERS = [
    (table, key)
    for table, key in KEYS
    if isinstance(shipped_preset()[table][key], float)
]
LISTS = [
    (table, key)
    for table, key in KEYS
    if isinstance(shipped_preset()[table][key], list)
]


def load(overrides: dict[str, Any]) -> WheeledLipSettings:
    """Return the settings with some overridden."""
    return load_settings(WheeledLipSettings, PRESET, overrides)


def build(description: RobotDescription, overrides: dict[str, Any]) -> None:
    """Build the whole controller with some settings overridden."""
    ball = BallParameters(0.5, 40.0, 0.5)
    create_wheeled_lip(ControllerSetup(description, ball, 0.002, overrides))


def test_preset_holds_every_setting_and_no_other() -> None:
    """Keys of the preset and fields of the dataclasses are the same sets."""
    preset = shipped_preset()
    fields = dataclasses.fields(WheeledLipSettings)
    assert set(preset) == {field.name for field in fields}
    settings = load({})
    for field in fields:
        table = getattr(settings, field.name)
        assert set(preset[field.name]) == {f.name for f in dataclasses.fields(table)}


def test_settings_are_those_of_the_preset() -> None:
    """Without overrides each setting has the value of the file."""
    settings = load({})
    for table, key in KEYS:
        value = shipped_preset()[table][key]
        found = getattr(getattr(settings, table), key)
        assert found == (tuple(value) if isinstance(value, list) else value)


def test_override_replaces_one_value_only() -> None:
    """An override changes its own setting and leaves all others."""
    plain, preset = load({}), shipped_preset()
    assert len(NUMBERS) > 30
    for table, key in NUMBERS:
        value = 0.999 * preset[table][key]
        changed = load({table: {key: value}})
        assert getattr(getattr(changed, table), key) == value
        restored = dataclasses.replace(
            getattr(changed, table), **{key: getattr(getattr(plain, table), key)}
        )
        assert dataclasses.replace(changed, **{table: restored}) == plain


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, "1.0", True, None, [1.0]])
def test_what_is_no_number_is_refused_by_name(value: object) -> None:
    """NaN, infinity, negative numbers, texts and flags are refused, key named."""
    for table, key in NUMBERS:
        with pytest.raises(InvalidSettingError) as caught:
            load({table: {key: value}})
        assert caught.value.key == f"controller.{table}.{key}"
        assert f"{table}.{key} = {value!r} is not valid" in str(caught.value)


@pytest.mark.parametrize("value", [[-1.0, math.nan], ["a"], -1.0, "-1", [True]])
def test_what_is_no_list_of_numbers_is_refused(value: object) -> None:
    """Each element of a list is checked, and the list's key is named."""
    assert LISTS
    for table, key in LISTS:
        with pytest.raises(InvalidSettingError, match=f"controller.{table}.{key}"):
            load({table: {key: value}})


@pytest.mark.parametrize("value", [0, -3, 2.0, True, "40"])
def test_counts_are_positive_integers(value: object) -> None:
    """A number of cells is a positive integer and nothing that looks like one."""
    with pytest.raises(InvalidSettingError, match=r"controller\.planner\.cells"):
        load({"planner": {"cells": value}})
    assert load({"planner": {"cells": 41}}).planner.cells == 41


def test_integers_are_numbers() -> None:
    """`1` in a TOML file means `1.0`."""
    value = load({"gait": {"lift_m": 1}}).gait.lift_m
    assert value == 1.0
    assert isinstance(value, float)


@pytest.mark.parametrize(
    ("overrides", "key", "choices"),
    [
        ({"gate": {}}, "controller.gate", "rates, estimation, reference, balance"),
        ({"gait": {"lift": 0.1}}, "controller.gait.lift", "lift_m"),
    ],
)
def test_unknown_key_is_answered_with_the_known_ones(
    overrides: dict[str, Any], key: str, choices: str
) -> None:
    """A misspelt key is refused by name, the message lists what there is."""
    with pytest.raises(InvalidSettingError) as caught:
        load(overrides)
    assert caught.value.key == key
    assert choices in caught.value.valid


def test_table_must_be_a_table() -> None:
    """A number in the place of a table is refused by the table's name."""
    with pytest.raises(InvalidSettingError, match=r"controller\.gait = 3 .* a table"):
        load({"gait": 3})


def test_settings_cannot_be_changed() -> None:
    """Settings are frozen, and not shared with what they were made from."""
    poles = [-6.0, -6.1, -2.0, -2.1]
    settings = load({"balance": {"sagittal_poles_rad_s": poles}})
    poles[0] = 1.0
    assert settings.balance.sagittal_poles_rad_s[0] == -6.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        settings.gait.lift_m = 0.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("gait", "lift_m", math.nan),
        ("gait", "lift", 0.03),
        ("forces", "slip_gain", -1.0),
        ("planner", "cells", 0),
    ],
)
def test_controller_refuses_bad_settings(
    description: RobotDescription, table: str, key: str, value: object
) -> None:
    """What the settings refuse, the controller refuses in the same words."""
    with pytest.raises(InvalidSettingError) as caught:
        build(description, {table: {key: value}})
    assert caught.value.key == f"controller.{table}.{key}"


def test_mirrored_poles_are_the_empty_list(description: RobotDescription) -> None:
    """An empty list of poles builds a controller, as the preset's comment says."""
    build(description, {"balance": {"sagittal_poles_rad_s": []}})


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("rates", "preview_period_s", 0.0),
        ("rates", "preview_period_s", 0.0005),
        ("rates", "preview_period_s", 0.005),
        ("rates", "ik_period_s", 0.0),
        ("balance", "cop_lag_s", 0.0),
        ("balance", "cop_feedback", -0.1),
        ("balance", "cop_learning_rate", -0.1),
        ("balance", "cop_learning_rate", 1.1),
        ("balance", "cop_learning_lead_s", -0.01),
        ("gait", "stop_reach_share", 0.0),
        ("gait", "stop_reach_share", 0.5),
        ("gait", "stand_reach_share", 0.0),
        ("gait", "reschedule_swing_s", 0.11),
        ("gait", "reschedule_swing_s", -0.01),
        ("balance", "lateral_trunk_damping_ratio", 0.0),
        ("balance", "lateral_trunk_damping_ratio", 1.1),
        ("balance", "observer_pole_rad_s", 0.0),
        ("balance", "sagittal_poles_rad_s", [-1.0, -2.0]),
        ("balance", "lateral_poles_rad_s", [6.0, -6.1, -2.0, -2.1]),
        ("reference", "max_speed_rad_s", 0.0),
        ("reference", "max_acceleration_m_s2", 0.0),
        ("gait", "single_support_s", 0.0),
        ("gait", "double_support_s", 0.0),
        ("gait", "single_support_s", 0.001),
        ("gait", "first_double_support_s", 0.0),
        ("gait", "earliest_touchdown", 1.5),
        ("forces", "cop_half_length_m", 0.0),
        ("forces", "cop_half_length_m", 0.2),
        ("forces", "minimal_share", 0.7),
    ],
)
def test_settings_that_cannot_work_are_refused_by_name(
    description: RobotDescription, table: str, key: str, value: object
) -> None:
    """A number that no controller can be built from is refused by its key."""
    with pytest.raises(InvalidSettingError) as caught:
        build(description, {table: {key: value}})
    assert caught.value.key.removeprefix("controller.") == f"{table}.{key}"
