"""Laws of repetitive control: what comes again goes away, what does not is left."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballsim_controllers.balance.axis_balance import AXIS
from ballsim_controllers.balance.stride_memory import make_stride_memory, repeat_cop
from ballsim_controllers.body_pendulum import BALL
from ballsim_controllers.messages import Array, Record

PERIOD, LEAD, STIFFNESS = 0.005, 0.02, 40.0
SWING, STEP = 44, 60  # control periods of a swing, of a step
LAG = round(LEAD / PERIOD)
#: Disturbance by foot, place of the step and time, [m].
Disturb = Callable[[int, int, int], float]


def walk(
    disturb: Disturb,
    axis: int,
    steps: int,
    rate: float = 0.05,
    drift: float = 0.0,
) -> tuple[Array, Array, Record]:
    """Return error and correction of each tick, and the memory at the end.

    The CoP is what is asked for `LEAD` before, plus the disturbance. On the axis
    along the heading it moves a ball, of which the memory sees the speed alone.

    Args:
        disturb: The disturbance.
        axis: 0 along the heading, 1 across it.
        steps: How many.
        rate: Learning rate.
        drift: Acceleration that the ball has besides, [m/s^2].
    """
    memory = make_stride_memory(PERIOD, rate, LEAD, STIFFNESS)
    axes: Record = np.zeros(2, AXIS)
    asked, errors = [0.0] * LAG, []
    for tick in range(steps * STEP):
        step, place = divmod(tick, STEP)
        foot = step % 2
        error = disturb(foot, place, tick) + asked[-LAG]
        errors.append(error)
        if axis == 0:
            gained = (STIFFNESS * error + drift) * PERIOD
            axes["estimate"][0, BALL + 1] += gained
        else:
            axes["cop_error"][1] = -error
        cop = np.zeros(2)
        repeat_cop(cop, memory, axes, foot if place < SWING else -1)
        assert cop[1 - axis] == 0.0
        asked.append(float(cop[axis]))
    return np.array(errors), np.array(asked[LAG:]), memory


def rms(values: Array) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def ripple(foot: int, place: int, tick: int) -> float:
    """Return a disturbance that is another one for each foot, of no mean."""
    phase = 2.0 * np.pi * place / STEP
    return float(
        0.008 * np.sin(phase) + (0.004 if foot else -0.003) * np.sin(2 * phase)
    )


@pytest.mark.parametrize("axis", [0, 1])
def test_what_comes_again_is_spared(axis: int) -> None:
    """After some strides a tenth of the error is left, and the rest is corrected."""
    errors, _, _ = walk(ripple, axis, steps=300)
    stride = 2 * STEP
    first, last = rms(errors[:stride]), rms(errors[-stride:])
    assert last < 0.1 * first


def test_error_decays_by_the_rate() -> None:
    """Early on each stride spares the next one a share of the error, the rate's."""
    errors, _, _ = walk(ripple, 1, steps=20, rate=0.1)
    sizes = [rms(part) for part in np.split(errors, 10)]
    np.testing.assert_allclose(np.array(sizes[3:]) / sizes[2:-1], 0.9, atol=0.01)


def test_without_learning_nothing_is_added() -> None:
    """A rate of 0 leaves what is asked for, to the last bit."""
    _, added, _ = walk(ripple, 1, steps=10, rate=0.0)
    assert not added.any()


def test_even_acceleration_is_not_learned() -> None:
    """A ball that speeds up evenly is to do so: only its ripple is taken away."""
    drift = 0.04
    errors, added, _ = walk(ripple, 0, steps=300, drift=drift)
    late = slice(-2 * STEP, None)
    assert rms(errors[late]) < 0.1 * rms(errors[: 2 * STEP])
    assert abs(added[late].mean()) < 0.1 * drift / STIFFNESS


def test_push_is_not_remembered() -> None:
    """An error of more than two centimetres teaches nothing."""
    _, added, memory = walk(lambda foot, place, tick: 0.03, 1, steps=20)
    assert not added.any()
    assert not memory["corrections"].any()


def test_mirrored_strides_teach_mirrored_corrections() -> None:
    """Errors across the heading that change sign with the foot do so in the memory."""
    size = 0.006

    def sway(foot: int, place: int, tick: int) -> float:
        return size if foot == 0 else -size

    _, _, memory = walk(sway, 1, steps=40)
    left, right = memory["corrections"][0, :, 1]
    # The first steps have no step before them.
    np.testing.assert_allclose(left[:STEP], -right[:STEP], atol=0.06 * size)
    assert left[: STEP - LAG - 1].max() < -0.5 * size
    # What is asked for at the end of a step comes in the next one.
    assert left[STEP - LAG : STEP].min() > 0.5 * size


def test_standing_robot_is_left_alone() -> None:
    """Soon after the last step nothing is added, and a correction is never large."""
    _, _, memory = walk(ripple, 1, steps=60)
    memory["corrections"] = 1.0
    axes: Record = np.zeros(2, AXIS)
    cops = np.zeros((200, 2))
    for cop in cops:
        repeat_cop(cop, memory, axes, -1)
    assert cops.max() == 0.02
    assert not cops[140:].any()


def test_another_period_learns_the_same() -> None:
    """Places are of the time: half the period, the same corrections per stride."""
    found = []
    for ratio in (1, 2):
        memory = make_stride_memory(PERIOD / ratio, 0.05, LEAD, STIFFNESS)
        axes: Record = np.zeros(2, AXIS)
        for tick in range(20 * STEP * ratio):
            step, place = divmod(tick, STEP * ratio)
            axes["cop_error"][1] = 0.005
            foot = step % 2 if place < SWING * ratio else -1
            repeat_cop(np.zeros(2), memory, axes, foot)
        found.append(memory["corrections"][0, :, 1, 10:50].copy())
    np.testing.assert_allclose(found[0], found[1], rtol=0.01)
