"""Laws of soles that stand: what has moved since, and that they hold on the ball."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.preparation import prepare
from ballsim.simulation import run
from ballsim_controllers.geometry import rotation_from_vector
from ballsim_controllers.messages import Array, Record
from ballsim_controllers.robot_kinematics import FEET
from ballsim_controllers.whole_body.standing_soles import (
    follow_soles,
    make_standing_soles,
)

DT = 0.005
SETTLES = 60  # ticks
_RADII = (0.25, 0.5, 0.75, 1.0)
_CREEP = (
    "soles creep steadily: by 21 mrad on 0.25 m, 19 on 0.5 m, 16 and 14 on the larger"
)
_PERFECT_GYRO = [
    f"sensors.gyro.{name}=0"
    for name in (
        "noise_density_rad_s_rthz",
        "bias_std_rad_s",
        "random_walk_rad_s2_rthz",
        "scale_std",
        "misalignment_std_rad",
    )
]


def place_feet(left: float, right: float, distance: float) -> Record:
    """Return feet with these directions, [rad], and distance, [m]."""
    feet: Record = np.zeros(1, FEET)
    for foot, turn in enumerate((left, right)):
        feet["rotation"][0, foot] = rotation_from_vector(np.array([0.1, 0.0, 0.0]))
        turned = rotation_from_vector(np.array([0.0, 0.0, turn]))
        feet["rotation"][0, foot] = turned @ feet["rotation"][0, foot]
    feet["position"][0, 0] = [0.0, 0.6 * distance, 0.8 * distance]
    return feet


def stand(standing: Record, *pose: float, ticks: int = 1) -> tuple[float, float, float]:
    """Return what has moved after some ticks with both feet there."""
    for _ in range(ticks):
        moved = follow_soles(standing, place_feet(*pose)[0], True, DT)
    return moved


def test_soles_move_from_where_they_settled() -> None:
    """Mean turn, turn against each other, and distance, each by itself."""
    standing = make_standing_soles(True)
    assert stand(standing, 0.3, 0.1, 0.2, ticks=SETTLES) == (0.0, 0.0, 0.0)
    np.testing.assert_allclose(
        stand(standing, 0.34, 0.14, 0.2), (0.04, 0.0, 0.0), atol=1e-14
    )
    np.testing.assert_allclose(
        stand(standing, 0.33, 0.07, 0.2), (0.0, 0.06, 0.0), atol=1e-14
    )
    np.testing.assert_allclose(
        stand(standing, 0.3, 0.1, 0.21), (0.0, 0.0, 0.01), atol=1e-14
    )


def test_what_counts_is_where_they_settled_last() -> None:
    """While they settle, and after a step, nothing has moved."""
    standing = make_standing_soles(True)
    for turn in np.linspace(0.0, 0.1, 20):
        assert stand(standing, turn, 0.0, 0.2) == (0.0, 0.0, 0.0)
    stand(standing, 0.1, 0.0, 0.2, ticks=SETTLES)
    assert stand(standing, 0.2, 0.0, 0.2) != (0.0, 0.0, 0.0)
    swinging = place_feet(0.2, 0.0, 0.3)[0]
    assert follow_soles(standing, swinging, False, DT) == (0.0, 0.0, 0.0)
    assert stand(standing, 0.2, 0.0, 0.3, ticks=SETTLES) == (0.0, 0.0, 0.0)


def test_perfect_sensors_follow_no_soles() -> None:
    """Their heading is known; the soles are held all the same."""
    standing = make_standing_soles(False)
    stand(standing, 0.0, 0.0, 0.2, ticks=SETTLES)
    turn, splay, parted = stand(standing, 0.2, 0.0, 0.3)
    assert turn == 0.0
    np.testing.assert_allclose((splay, parted), (0.2, 0.1), atol=1e-14)


def read_truth(seed: int, *overrides: str, tick: int = 400) -> Array:
    """Return the truth of a robot that stands at a tick and at the end.

    Returns:
        Directions of left sole, right sole and trunk, [rad], and the distance of the
        soles, [m], shape (2, 4).
    """
    given = ["sensors.preset=mid", f"seed={seed}", "duration_s=14", *overrides]
    config = load_config("stand", given).config
    series, model = run(config).series, prepare(config).plant.model
    data = mujoco.MjData(model)
    feet = [model.body(f"{side}_foot").id for side in ("left", "right")]
    rows = []
    for instant in (tick, series.n_ticks - 1):
        data.qpos[:] = series.qpos[instant]
        mujoco.mj_kinematics(model, data)
        turns = [data.xmat[body] for body in (*feet, model.body("trunk").id)]
        distance = np.linalg.norm(data.xpos[feet[0]] - data.xpos[feet[1]])
        rows.append([*(np.arctan2(turn[3], turn[0]) for turn in turns), distance])
    return np.array(rows)


def test_standing_soles_stay_where_they_are() -> None:
    """Joint zeros that are off neither splay nor part them, which they do else."""
    left, right, _, parted = np.diff(read_truth(0), axis=0)[0]
    assert abs(left - right) < 2e-3
    assert abs(parted) < 0.5e-3
    loose = read_truth(
        0,
        "controller.forces.splay_stiffness_n_m_per_rad=0",
        "controller.forces.parting_stiffness_n_per_m=0",
    )
    left, right, _, parted = np.diff(loose, axis=0)[0]
    assert abs(left - right) > 15e-3
    assert parted > 0.5e-3


def test_soles_stay_with_perfect_sensors_too() -> None:
    """By themselves they would part by half a millimetre in 12 s, and so on."""
    perfect = "sensors.preset=ideal"
    assert abs(np.diff(read_truth(1, perfect), axis=0)[0, 3]) < 0.2e-3
    loose = "controller.forces.parting_stiffness_n_per_m=0"
    assert np.diff(read_truth(1, perfect, loose), axis=0)[0, 3] > 0.5e-3


@pytest.mark.slow
@pytest.mark.parametrize("radius", _RADII)
@pytest.mark.parametrize("seed", [0, 5, 12])
def test_bias_of_a_gyro_turns_no_robot_that_stands(radius: float, seed: int) -> None:
    """One sigma makes 30 mrad a minute; with a perfect gyro soles creep as far."""
    given = f"ball.radius_m={radius}", "duration_s=60"
    start, end = read_truth(seed, *given)
    perfect_start, perfect_end = read_truth(seed, *given, *_PERFECT_GYRO)
    turned, creep = end[2] - start[2], perfect_end[2] - perfect_start[2]
    assert abs(turned - creep) < (8e-3 if radius < 0.3 else 4e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radius", "seed"),
    [
        *((radius, seed) for radius in _RADII for seed in (1, 5)),
        *(
            pytest.param(
                radius, 12, marks=pytest.mark.xfail(strict=True, reason=_CREEP)
            )
            for radius in _RADII
        ),
    ],
)
def test_standing_robot_does_not_turn(radius: float, seed: int) -> None:
    """Soles creep by milliradians a minute, but where legs that are off strain them."""
    given = f"ball.radius_m={radius}", "duration_s=60"
    start, end = read_truth(seed, *given)
    assert abs(end[2] - start[2]) < 10e-3
