"""What the joints and their drives are limited to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim.recording.recorder import RunContext
from ballsim_controllers.messages import Array

__all__ = ["Limits", "find_limits"]


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one quantity of all joints.

    Attributes:
        path: Entity path.
        unit: Unit.
        description: What is limited.
        columns: ``<joint>_low`` of all joints, then ``<joint>_high``.
        values: Shape (n_columns,); NaN where there is no limit.
    """

    path: str
    unit: str
    description: str
    columns: tuple[str, ...]
    values: Array


def find_limits(context: RunContext) -> tuple[Limits, ...]:
    """Return the limits of a robot's joint angles and torques.

    Args:
        context: What does not change during a run.
    """
    model, ids = context.model, context.ids
    names = ids.joint_names
    columns = tuple(f"{name}_{end}" for end in ("low", "high") for name in names)
    angles = np.array(model.jnt_range[ids.joints], dtype=np.float64)
    angles[model.jnt_limited[ids.joints] == 0] = np.nan
    torques = np.array(model.actuator_forcerange, dtype=np.float64)
    torques[model.actuator_forcelimited == 0] = np.nan
    return (
        Limits(
            "/limits/joints/position",
            "rad",
            "range of each joint",
            columns,
            angles.T.ravel(),
        ),
        Limits(
            "/limits/joints/torque",
            "N m",
            "limits of the torque of each joint's drive",
            columns,
            torques.T.ravel(),
        ),
    )
