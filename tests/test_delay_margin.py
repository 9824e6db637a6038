"""The linear prediction of the delay that the loops bear: by other routes."""

from __future__ import annotations

import numpy as np
import pytest

from ballsim.config_io import load_config
from ballsim.delay_margin import find_margins, main, pd_margin, spectral_radius


def test_radius_without_delay_is_that_of_the_placed_poles() -> None:
    """A plant of which all is seen at once, an observer that only measures."""
    random = np.random.default_rng(3)
    A, B = np.eye(7) + 0.05 * random.normal(size=(7, 7)), random.normal(size=(7, 1))
    K = 0.05 * random.normal(size=7)
    observer = np.zeros((4, 4)), np.zeros((4, 3)), np.eye(4)
    found = spectral_radius((A, B), observer, K, 1, 0)
    direct = np.abs(np.linalg.eigvals(A - B @ K[None, :])).max()
    assert found == pytest.approx(direct, rel=1e-9)


@pytest.mark.parametrize(("delay", "is_stable"), [(3, True), (4, False)])
def test_delayed_loop_agrees_with_a_simulation(delay: int, is_stable: bool) -> None:
    """Delay, observer and hold, tick after tick: it grows where the radius says so."""
    A, B = np.eye(7), np.zeros((7, 1))
    A[0, 1] = 0.1
    A[2, 2] = A[3, 3] = 0.5
    A[4:, 4:] = 0.0
    B[1, 0] = 0.1
    K = np.array([3.0, 2.4, 0.0, 0.0, 0.0, 0.0, 0.0])
    Ao, Bo, L = A[:4, :4], np.zeros((4, 3)), 0.9 * np.eye(4)
    radius = spectral_radius((A, B), (Ao, Bo, L), K, 2, delay)
    past, seen, u = [np.eye(7)[0]] * (delay + 1), np.zeros(4), 0.0
    sizes = []
    for tick in range(600):
        predicted = Ao @ seen
        seen = predicted + L @ (past[delay][:4] - predicted)
        if tick % 2 == 0:
            u = -float(K[:4] @ seen)
        past = [A @ past[0] + B[:, 0] * u, *past[:delay]]
        sizes.append(np.linalg.norm(past[0]))
    growth = (sizes[-1] / sizes[-201]) ** (1.0 / 100.0)
    assert growth == pytest.approx(radius, rel=0.02)
    assert (radius < 1.0) == is_stable


def test_margin_of_a_double_integrator() -> None:
    """At the margin the delayed loop has a root on the imaginary axis."""
    k, d = 400.0, 40.0
    T = pd_margin(k, d)
    grid = np.linspace(1.0, 200.0, 200_000)
    omega = grid[np.argmin(np.abs(np.hypot(k, d * grid) / grid**2 - 1.0))]
    s = 1j * omega
    assert abs(1.0 + (k + d * s) / s**2 * np.exp(-s * T)) < 1e-3


def test_balance_bears_more_than_a_step_of_control() -> None:
    """On paper the balance is no hurry: about a tenth of a second on every ball."""
    config = load_config("stand", []).config
    margins = find_margins(config)
    assert len(margins) == 4
    assert all(5 < margin < 40 for margin in margins.values())


def test_bad_input_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2."""
    assert main(["--radii", "-1"]) == 2
    assert "ballsim.delay_margin" in capsys.readouterr().err
