"""The paper's loop of Section VI: controller, planner and plant, in the plane.

Order in a step: output y, estimate, footsteps, actual theta_2, plant.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ballsim.paper.planar_plant import PlanarPlant
from ballsim.paper.targets import Moment, Target
from ballsim_controllers.balance.paper_controller import PaperBalanceController
from ballsim_controllers.footsteps.conditions import (
    FootstepParameters,
    FootstepState,
    PaperFootstepPlanner,
)
from ballsim_controllers.messages import Array
from ballsim_controllers.wheeled_lip import WheeledLipParameters

__all__ = ["FALL_ANGLE", "NO_FOOT", "Footstep", "PlanarRun", "simulate"]

FALL_ANGLE = 1.0
"""Angle of pendulum or contact against the vertical that is a fall, [rad]."""

NO_FOOT = -1
"""Mark of double support in `PlanarRun.swing_feet`."""


class Footstep(NamedTuple):
    """One step.

    Attributes:
        foot: 0 or 1.
        lift_time: When the foot left the ball, [s].
        landing_time: When it touched down, [s]; None if it never did.
        length: Change of theta_c, [rad].
    """

    foot: int
    lift_time: float
    landing_time: float | None
    length: float


@dataclass(frozen=True, slots=True)
class PlanarRun:
    """What happened, one row for each step that was simulated.

    Attributes:
        params: Parameters of the wheeled pendulum.
        footsteps: Parameters of the planner.
        dt: Step, [s].
        outputs: Measured (theta_1, theta_2, theta_4), shape (n, 3), [rad].
        estimates: Estimated state, shape (n, 6), [rad] and [rad/s].
        contacts: Actual theta_2 that the feet give, shape (n,), [rad].
        targets: theta_1*, shape (n,), [rad].
        feet: theta_c of both feet, shape (n, 2), [rad].
        swing_feet: Foot in the air or `NO_FOOT`, shape (n,).
        step_count: Touchdowns.
        fall_time: When the robot fell, [s], or None.
    """

    params: WheeledLipParameters
    footsteps: FootstepParameters
    dt: float
    outputs: Array
    estimates: Array
    contacts: Array
    targets: Array
    feet: Array
    swing_feet: npt.NDArray[np.int8]
    step_count: int
    fall_time: float | None

    @property
    def time(self) -> Array:
        """Return the time of each row, [s]."""
        return np.arange(float(len(self.outputs))) * self.dt

    @property
    def ball_rates(self) -> Array:
        """Return theta_1' of the plant, shape (n,), [rad/s]."""
        angles = self.outputs[:, 0]
        rates: Array = np.diff(angles, prepend=angles[0]) / self.dt
        return rates

    @property
    def deviations(self) -> Array:
        """Return actual minus ideal theta_2, shape (n,), [rad]."""
        deviations: Array = self.contacts - self.estimates[:, 1]
        return deviations

    @property
    def steps(self) -> tuple[Footstep, ...]:
        """Return the footsteps in order."""
        if not len(self.swing_feet):
            return ()
        changes = np.flatnonzero(np.diff(self.swing_feet)) + 1
        edges = [0, *changes.tolist(), len(self.swing_feet)]
        steps = []
        for start, end in pairwise(edges):
            foot = int(self.swing_feet[start])
            if foot == NO_FOOT:
                continue
            has_landed = end < len(self.swing_feet)
            last = end if has_landed else end - 1
            # A foot moves from the very step in which it lifts off.
            before = self.feet[start - 1, foot] if start else 0.0
            length = float(self.feet[last, foot] - before)
            landing = end * self.dt if has_landed else None
            steps.append(Footstep(foot, start * self.dt, landing, length))
        return tuple(steps)


def simulate(
    balance: PaperBalanceController,
    footsteps: FootstepParameters,
    target: Target,
    duration: float,
    dt: float = 1e-3,
    *,
    delay_ticks: int = 0,
    start: Array | None = None,
) -> PlanarRun:
    """Simulate the paper's loop until the end or a fall.

    Args:
        balance: Balance controller.
        footsteps: Parameters of the footstep planner.
        target: theta_1* over time; used up by the run.
        duration: Time to simulate, [s].
        dt: Step of controller and plant, [s].
        delay_ticks: Steps from the feet's theta_2 to the plant's.
        start: (theta_1, theta_2, theta_4) at the start, at rest, shape (3,),
            [rad], of plant and estimate; zeros if None.

    Returns:
        The run.

    Source:
        Section VI-A; order and start as in simplified-model.md section 3.
    """
    params = balance.params
    planner, plant = PaperFootstepPlanner(footsteps), PlanarPlant(params)
    first = np.zeros(3) if start is None else start
    state, feet = plant.start(first), FootstepState()
    estimate, is_lifting, fall_time = np.concatenate((first, np.zeros(3))), False, None
    pending = deque([float(first[1])] * delay_ticks)
    outputs, estimates, rows = [], [], []
    for tick in range(round(duration / dt)):
        output = plant.angles(state)
        if _has_fallen(params, output):
            fall_time = tick * dt
            break
        moment = Moment(tick * dt, float(estimate[0]), float(estimate[3]), is_lifting)
        angle = target.advance(moment)
        estimate = balance.update(estimate, output, angle, dt)
        th1, ideal, _, rate1, rate2, _ = estimate.tolist()
        was_standing = feet.swing_foot is None
        feet = planner.advance(feet, (th1, ideal), (rate1, rate2), dt)
        swing_foot = NO_FOOT if feet.swing_foot is None else feet.swing_foot
        is_lifting = was_standing and swing_foot != NO_FOOT
        contact = planner.actual_cop(feet, ideal)
        outputs.append(output)
        estimates.append(estimate)
        rows.append((contact, angle, *feet.feet, swing_foot))
        pending.append(contact)
        state = plant.step(state, pending.popleft(), dt)
    table = np.array(rows).reshape(-1, 5)
    return PlanarRun(
        params=params,
        footsteps=footsteps,
        dt=dt,
        outputs=np.array(outputs).reshape(-1, 3),
        estimates=np.array(estimates).reshape(-1, 6),
        contacts=table[:, 0],
        targets=table[:, 1],
        feet=table[:, 2:4],
        swing_feet=table[:, 4].astype(np.int8),
        step_count=feet.step_count,
        fall_time=fall_time,
    )


def _has_fallen(params: WheeledLipParameters, output: Array) -> bool:
    th1, th2, th4 = output.tolist()
    pendulum: float = th1 + params.wheel_ratio * th2 + th4
    contact: float = th1 + th2
    return max(abs(pendulum), abs(contact)) > FALL_ANGLE
