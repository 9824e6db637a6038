"""Gains from pole assignment, their cache, and the ideal CoP built on them."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from ballsim_controllers.balance.mirrored_poles import compute_mirrored_poles
from ballsim_controllers.balance.paper_controller import (
    FEEDBACK_POLES,
    PaperBalanceController,
)
from ballsim_controllers.balance.pole_assignment import (
    cache_directory,
    place_poles,
    pole_error,
)
from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import BallParameters
from ballsim_controllers.reference import compute_lead_time
from ballsim_controllers.wheeled_lip import (
    BallPendulumParameters,
    WheeledLipParameters,
    equilibrium_direction,
    held_cop_matrix,
    velocity_direction,
    wheeled_lip_matrices,
)

RADII = (0.25, 0.5, 0.75, 1.0)
PAPER_GAINS = {
    0.25: "-158.253586 -1178.522074 -408.669000 -48.304237 -133.450935 -35.448394",
    0.5: "-406.843578 -4398.764691 -800.069036 -149.811017 -550.292061 -84.265353",
    0.75: "-749.356238 -9876.499043 -1220.437887 -330.743619 -1370.666468 -147.281435",
    1.0: "-1183.968780 -17678.562750 -1655.416415 -611.116154 -2684.733333 -222.102621",
}
KT = {0.25: -1.404011, 0.5: -8.424066, 0.75: -26.141348, 1.0: -59.570181}
DOUBLE_INTEGRATOR = (np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]))


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """Give every test an empty cache of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "ballsim" / "gains"


@pytest.fixture
def without_control(monkeypatch):
    """Return a call that makes any later import of python-control fail."""
    return lambda: monkeypatch.setitem(sys.modules, "control", None)


@pytest.mark.parametrize("radius", RADII)
def test_paper_gain(radius):
    """K is the paper's, K T and K T'/K T = sum(-1/pole) follow from it."""
    params = WheeledLipParameters(radius)
    model = wheeled_lip_matrices(params)
    K = place_poles(*model, FEEDBACK_POLES)
    expected = np.array(PAPER_GAINS[radius].split(), dtype=float)
    np.testing.assert_allclose(K[0], expected, rtol=1e-6)
    assert pole_error(*model, K, FEEDBACK_POLES) < 1e-6
    at_rest = (K @ equilibrium_direction(params)).item()
    rolling = (K @ velocity_direction(params)).item()
    assert at_rest == pytest.approx(KT[radius], rel=1e-6)
    assert rolling / at_rest == pytest.approx(2.474544, rel=1e-6)
    assert rolling / at_rest == pytest.approx(compute_lead_time(FEEDBACK_POLES))
    assert PaperBalanceController(params).lead_time == pytest.approx(2.474544, rel=1e-6)


def test_complex_and_repeated_poles():
    """A conjugate pair and a double pole are placed, s^2 + k2 s + k1."""
    K = place_poles(*DOUBLE_INTEGRATOR, [-1 + 2j, -1 - 2j])
    np.testing.assert_allclose(K, [[5.0, 2.0]], rtol=1e-9)
    K = place_poles(*DOUBLE_INTEGRATOR, [-3.0, -3.0])
    np.testing.assert_allclose(K, [[9.0, 6.0]], rtol=1e-9)


@pytest.mark.parametrize(
    ("poles", "words"),
    [
        ([-1.0], "2 finite"),
        ([-1.0, np.nan], "2 finite"),
        ([-1.0, -1 + 1j], "conjugation"),
    ],
)
def test_impossible_poles_are_refused(poles, words):
    """Poles of the wrong number or without their conjugates are no poles."""
    with pytest.raises(InvalidSettingError, match=words):
        place_poles(*DOUBLE_INTEGRATOR, poles)


def test_uncontrollable_model_is_refused(cache):
    """A mode that the input does not reach cannot be moved, nor cached."""
    with pytest.raises(InvalidSettingError, match="poles"):
        place_poles(np.diag([1.0, 2.0]), np.array([[1.0], [0.0]]), [-1.0, -2.0])
    assert not list(cache.glob("*"))


def test_second_call_reads_the_cache(cache, without_control):
    """A known gain is read: bit by bit the same, without python-control."""
    first = place_poles(*DOUBLE_INTEGRATOR, [-1.0, -2.0])
    without_control()
    second = place_poles(*DOUBLE_INTEGRATOR, [-2.0, -1.0])
    np.testing.assert_array_equal(first, second)
    assert [file.suffix for file in cache.iterdir()] == [".npy"]
    with pytest.raises(ImportError):
        place_poles(*DOUBLE_INTEGRATOR, [-1.0, -3.0])
    with pytest.raises(ImportError):
        place_poles(*DOUBLE_INTEGRATOR, [-1.0, -2.0], use_cache=False)


@pytest.mark.parametrize("rubbish", [b"", b"\x93NUMPY\x01\x00v", b"no gain"])
def test_unreadable_file_is_ignored_and_replaced(cache, rubbish):
    """A broken file costs a new computation, nothing else."""
    first = place_poles(*DOUBLE_INTEGRATOR, [-1.0, -2.0])
    (file,) = cache.iterdir()
    good = file.read_bytes()
    file.write_bytes(rubbish)
    np.testing.assert_array_equal(place_poles(*DOUBLE_INTEGRATOR, [-1.0, -2.0]), first)
    assert file.read_bytes() == good


@pytest.mark.parametrize(
    "wrong", [np.ones((1, 2)), np.ones(2), np.full((1, 2), np.nan)]
)
def test_wrong_gain_in_the_cache_is_found_out(cache, wrong):
    """A readable gain with other eigenvalues or shape is not used."""
    first = place_poles(*DOUBLE_INTEGRATOR, [-1.0, -2.0])
    (file,) = cache.iterdir()
    np.save(file, wrong)
    np.testing.assert_array_equal(place_poles(*DOUBLE_INTEGRATOR, [-1.0, -2.0]), first)


def test_unusable_cache_directory_is_no_error(tmp_path, monkeypatch):
    """Where no directory can be made, gains are computed each time."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    K = place_poles(*DOUBLE_INTEGRATOR, [-1.0, -2.0])
    np.testing.assert_allclose(K, [[2.0, 3.0]])


def test_cache_is_under_the_home_by_default(tmp_path, monkeypatch):
    """Without an absolute XDG_CACHE_HOME it is ~/.cache/ballsim/gains."""
    monkeypatch.setenv("HOME", str(tmp_path))
    for value in ("", "relative"):
        monkeypatch.setenv("XDG_CACHE_HOME", value)
        assert cache_directory() == tmp_path / ".cache" / "ballsim" / "gains"


def test_importing_the_layer_leaves_slow_packages_alone():
    """Neither python-control nor scipy.signal is imported with the modules."""
    code = (
        "import sys; import ballsim_controllers.balance.paper_controller,"
        "ballsim_controllers.balance.mirrored_poles, ballsim_controllers.reference;"
        "sys.exit(bool({'control', 'scipy.signal'} & sys.modules.keys()))"
    )
    path = ":".join(sys.path)
    assert (
        subprocess.run(
            [sys.executable, "-c", code], env={"PYTHONPATH": path}, check=False
        ).returncode
        == 0
    )


def ball_pendulum(radius: float) -> BallPendulumParameters:
    """Return the contact-consistent model of the paper's robot."""
    ball = BallParameters(radius=radius, mass=40.0, inertia=0.5)
    return BallPendulumParameters(ball, robot_mass=65.0, com_height=0.9)


@pytest.mark.parametrize("radius", RADII)
def test_mirrored_poles(radius):
    """Each unstable mode of the held CoP has its mirror image among them."""
    params = ball_pendulum(radius)
    poles = compute_mirrored_poles(params)
    modes = np.linalg.eigvals(held_cop_matrix(params)).real
    assert len(set(poles)) == 4
    for mode in modes[modes > 0.0]:
        assert np.min(np.abs(np.array(poles) + mode)) < 1e-9
