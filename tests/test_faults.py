"""Sensors that fail: what is read then, that it is noticed, and ridden through."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.errors import ConfigError
from ballsim.faults import FAULT_KINDS, FaultConfig, FaultInjector
from ballsim.preparation import prepare
from ballsim.simulation import KeptRun, run_prepared
from ballsim_controllers.messages import Array, reading_dtype
from ballsim_controllers.sensor_names import SENSOR_NAMES

_JOINTS = ("hip", "knee", "ankle")
_PERIOD = 0.005
_SIZES = {
    "encoder": 0.5,
    "gyro": 5.0,
    "accelerometer": 60.0,
    "left_ankle": 3000.0,
    "right_ankle": 3000.0,
    "ball_gyro": 5.0,
}


def _spoil(fault: FaultConfig, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Return readings before and after a fault, shape (n,)."""
    injector = FaultInjector([fault], _JOINTS, _PERIOD)
    dtype = reading_dtype(len(_JOINTS))
    numbers = np.random.default_rng(1).normal(size=(n, dtype.itemsize // 8))
    spoilt = numbers.copy()
    for tick, row in enumerate(spoilt):
        injector.apply(tick, row)
    return numbers.view(dtype)[:, 0], spoilt.view(dtype)[:, 0]


@pytest.mark.parametrize("kind", FAULT_KINDS)
def test_fault_acts_where_and_when_it_says(kind: str) -> None:
    """The right ankle from 0.1 s on for 50 ms, and nothing else ever."""
    size = 9.0 if kind == "spike" else 0.0
    fault = FaultConfig("right_ankle", kind, 0.1, 0.05, size=size)
    before, after = _spoil(fault)
    rows = slice(20, 30)
    for name in before.dtype.names or ():
        if name in ("foot_forces", "foot_torques"):
            continue
        np.testing.assert_array_equal(before[name], after[name])
    for name, share in (("foot_forces", 1.0), ("foot_torques", 0.01)):
        expected = before[name].copy()
        if kind == "freeze":
            expected[rows, 1] = before[name][19, 1]
        elif kind == "spike":
            expected[rows, 1] += share * size
        else:
            expected[rows, 1] = math.nan if kind == "not-a-number" else 0.0
        np.testing.assert_array_equal(after[name], expected)


def test_fault_comes_again_with_its_period() -> None:
    """One encoder of three, each 0.1 s."""
    fault = FaultConfig("encoder", "dropout", 0.05, 0.0, 0.1, "knee")
    _, after = _spoil(fault)
    zero = np.flatnonzero(after["joint_positions"][:, 1] == 0.0)
    np.testing.assert_array_equal(zero, [10, 30, 50])
    np.testing.assert_array_equal(after["joint_velocities"][zero, 1], 0.0)
    assert (after["joint_positions"][:, [0, 2]] != 0.0).all()


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ('sensor = "nose"', "fault.0.sensor"),
        ('kind = "gone"', "fault.0.kind"),
        ('kind = "spike"', "fault.0.size"),
        ("period_s = 0.05", "fault.0.duration_s"),
        ('joint = "left_knee"', "fault.0.joint"),
        ('sensor = "encoder"\njoint = "nose"', "fault.0.joint"),
    ],
)
def test_bad_faults_are_named(tmp_path: Path, text: str, key: str) -> None:
    """The message names the key of the fault."""
    file = tmp_path / "bad.toml"
    file.write_text(f"[[fault]]\n{text}\n")
    with pytest.raises(ConfigError) as caught:
        prepare(load_config(file).config)
    assert caught.value.key == key


def _run(
    tmp_path: Path, *faults: str, stepping: bool = True, preset: str = "ideal"
) -> KeptRun:
    file = tmp_path / "faulty.toml"
    command = "[[command.timeline]]\ntime_s = 0.5\nstepping = true\n"
    tables = "".join(f"[[fault]]\n{fault}\n" for fault in faults)
    file.write_text(f"duration_s = 6.0\n{command if stepping else ''}{tables}")
    config = load_config(file, [f"sensors.preset={preset}"]).config
    return run_prepared(prepare(config))


def _outages(result: KeptRun, sensor: str) -> Array:
    """Return the times at which a sensor was not used, [s]."""
    series = result.series
    bits = series.telemetry.ill_sensors >> SENSOR_NAMES.index(sensor) & 1
    times: Array = series.time[:-1][bits.astype(bool)]
    return times


def test_no_sensor_is_ill_where_none_fails(tmp_path: Path) -> None:
    """Steps of the real thing are no spikes: not a single tick is flagged."""
    result = _run(tmp_path)
    assert result.is_upright
    assert not result.series.telemetry.ill_sensors.any()


@pytest.mark.parametrize("kind", FAULT_KINDS)
@pytest.mark.parametrize("sensor", SENSOR_NAMES)
def test_fault_is_noticed_and_ridden_through(
    tmp_path: Path, sensor: str, kind: str
) -> None:
    """Within 20 ms, no longer than it lasts, no other sensor; and the robot stands."""
    size = f"size = {_SIZES[sensor]}" if kind == "spike" else ""
    fault = f'sensor = "{sensor}"\nkind = "{kind}"\ntime_s = 4.0\n{size}'
    result = _run(tmp_path, fault, stepping=False)
    assert result.is_upright
    times = _outages(result, sensor)
    assert 4.0 - 1e-9 <= times[0] <= 4.0 + 0.020
    assert times[-1] <= 4.05 + 0.010
    for other in set(SENSOR_NAMES) - {sensor}:
        assert len(_outages(result, other)) == 0


@pytest.mark.parametrize("preset", ["ideal", "mid"])
@pytest.mark.parametrize("joint", ["left_knee", "right_ankle_pitch"])
def test_frozen_joint_is_noticed_and_ridden_through(
    tmp_path: Path, joint: str, preset: str
) -> None:
    """One encoder stops for 50 ms while the robot steps: within 20 ms; it steps on."""
    fault = f'sensor = "encoder"\nkind = "freeze"\ntime_s = 4.0\njoint = "{joint}"\n'
    result = _run(tmp_path, fault, preset=preset)
    assert result.is_upright
    times = _outages(result, "encoder")
    assert 4.0 - 1e-9 <= times[0] <= 4.0 + 0.020
    assert times[-1] <= 4.05 + 0.010


@pytest.mark.parametrize("time", [4.0, 4.15])
@pytest.mark.parametrize("joint", [None, "left_hip_roll"])
def test_lost_encoders_are_ridden_through_while_it_steps(
    tmp_path: Path, joint: str | None, time: float
) -> None:
    """All of them, or the one that moves the feet most, zero for 50 ms with `mid`."""
    fault = f'sensor = "encoder"\nkind = "dropout"\ntime_s = {time}\n'
    if joint:
        fault += f'joint = "{joint}"\n'
    result = _run(tmp_path, fault, preset="mid")
    assert result.is_upright
    times = _outages(result, "encoder")
    assert time - 1e-9 <= times[0] <= time + 0.020
    assert times[-1] <= time + 0.05 + 0.010


@pytest.mark.parametrize("joint", ["left_hip_roll", "right_hip_roll"])
def test_joint_that_drops_to_a_zero_nearby_is_not_believed(
    tmp_path: Path, joint: str
) -> None:
    """A centimetre of the foot away is enough for its first zero to be noticed."""
    fault = f'sensor = "encoder"\nkind = "dropout"\ntime_s = 4.0\njoint = "{joint}"\n'
    result = _run(tmp_path, fault, preset="mid")
    times = _outages(result, "encoder")
    assert times[0] == pytest.approx(4.0, abs=1e-9)
    assert len(times) == 10
    assert times[-1] == pytest.approx(4.045, abs=1e-9)


def test_outage_stands_in_the_summary(tmp_path: Path) -> None:
    """By sensor, in seconds."""
    from ballsim.run_files import run_with_files

    file = tmp_path / "faulty.toml"
    file.write_text(
        'duration_s = 1.0\n[[fault]]\nsensor = "gyro"\nkind = "not-a-number"\n'
        "time_s = 0.5\nduration_s = 0.1\n"
    )
    run_with_files(prepare(load_config(file).config), tmp_path / "run")
    summary = json.loads((tmp_path / "run/summary.json").read_text())
    expected = dict.fromkeys(SENSOR_NAMES, 0.0) | {"gyro": 0.1}
    assert summary["sensor_outage"] == pytest.approx(expected)


@pytest.mark.slow
@pytest.mark.parametrize("time", [4.0, 4.08, 4.16, 4.24])
@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize(
    "joint", ["hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll"]
)
def test_any_encoder_of_a_leg_may_drop_out(
    tmp_path: Path, joint: str, radius: float, time: float
) -> None:
    """For 50 ms, at four times of a stride, stepping with `mid`."""
    file = tmp_path / "faulty.toml"
    file.write_text(
        "duration_s = 7.0\n[[command.timeline]]\ntime_s = 1.0\nstepping = true\n"
        f'[[fault]]\nsensor = "encoder"\nkind = "dropout"\njoint = "left_{joint}"\n'
        f"time_s = {time}\nduration_s = 0.05\n"
    )
    overrides = ["sensors.preset=mid", f"ball.radius_m={radius}"]
    assert run_prepared(prepare(load_config(file, overrides).config)).is_upright


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize(
    "sensor", ["encoder", "gyro", "accelerometer", "left_ankle", "ball_gyro"]
)
def test_lost_sensor_once_a_second_holds_with_mid(
    tmp_path: Path, sensor: str, radius: float, seed: int
) -> None:
    """50 ms without a sensor once a second for 20 s of steps."""
    file = tmp_path / "faulty.toml"
    file.write_text(
        "duration_s = 20.0\n[[command.timeline]]\ntime_s = 1.0\nstepping = true\n"
        f'[[fault]]\nsensor = "{sensor}"\nkind = "dropout"\n'
        "time_s = 2.0\nduration_s = 0.05\nperiod_s = 1.0\n"
    )
    overrides = ["sensors.preset=mid", f"ball.radius_m={radius}", f"seed={seed}"]
    assert run_prepared(prepare(load_config(file, overrides).config)).is_upright


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("radius", [0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize("kind", ["dropout", "freeze"])
@pytest.mark.parametrize("stepping", [False, True])
def test_lost_ankle_once_a_second_holds(
    tmp_path: Path, kind: str, radius: float, seed: int, stepping: bool
) -> None:
    """50 ms without an ankle's wrench once a second for 20 s."""
    file = tmp_path / "faulty.toml"
    command = "[[command.timeline]]\ntime_s = 1.0\nstepping = true\n"
    file.write_text(
        f"duration_s = 20.0\n{command if stepping else ''}"
        f'[[fault]]\nsensor = "left_ankle"\nkind = "{kind}"\n'
        "time_s = 1.0\nduration_s = 0.05\nperiod_s = 1.0\n"
    )
    overrides = [f"ball.radius_m={radius}", f"seed={seed}"]
    assert run_prepared(prepare(load_config(file, overrides).config)).is_upright
