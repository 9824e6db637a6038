"""The simulated world: the only caller of ``mj_step``.

What is fed to plain MuJoCo (the scene's text, ``qpos0``, ``qvel0``, ``ctrl``
and, where present, ``xfrc_applied``) gives the same trajectory bit for bit.
Therefore nothing but ``mj_step`` ever runs on the live data: anything else, even
an ``mj_forward``, could leave another warm start of the contact solver behind.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import mujoco
import numpy as np

from ballsim.errors import PhysicsError
from ballsim_controllers.messages import Array

__all__ = ["Plant"]


class Plant:
    """A compiled scene and its state.

    Args:
        model: Compiled from the text of a scene and from nothing else.
        qpos: State at the start, shape (nq,).
        qvel: Velocity at the start, shape (nv,).
        n_substeps: Physics steps in one control period.
        n_late: Physics steps after which an input acts; the first one acts at once.
        encoder_zeros: What each drive reads too much of its joint's angle, shape (nu,),
            [rad]; nothing if None. It closes its loop on the encoder that the
            controller reads, so it turns the joint that much less far.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        qpos: Array,
        qvel: Array,
        n_substeps: int,
        n_late: int = 0,
        encoder_zeros: Array | None = None,
    ) -> None:
        """Set the state."""
        self._model = model
        self._data = mujoco.MjData(model)
        self._data.qpos[:] = qpos
        self._data.qvel[:] = qvel
        self._n_substeps, self._n_late = n_substeps, n_late
        # All that may act within a control period: the last inputs that were given.
        self._given: deque[Array] = deque(maxlen=2 + n_late // n_substeps)
        self._ctrl = self._data.ctrl
        self._zeros = np.zeros(self._model.nu)
        none = encoder_zeros is None or not encoder_zeros.any()
        self._encoder_zeros = None if none else encoder_zeros
        self._warnings = self._data.warning.number
        self._no_warnings = self._warnings.tobytes()
        # Else MuJoCo writes MUJOCO_LOG.TXT; the counters tell us all we need.
        mujoco.set_mju_user_warning(_ignore)

    @property
    def model(self) -> mujoco.MjModel:
        """Return the model."""
        return self._model

    @property
    def data(self) -> mujoco.MjData:
        """Return the live data, to be read only.

        After a step, ``qpos`` and ``qvel`` are those of the present, everything
        that is computed from them (contacts, sensors, ``xpos``) is one physics
        step old.
        """
        return self._data

    @property
    def time(self) -> float:
        """Return the simulated time, [s]."""
        return float(self._data.time)

    def compute_first_sensordata(self) -> Array:
        """Return the sensor values at the start, from data that are thrown away.

        The drives are taken to hold the posture, as if the robot had stood
        there before.
        """
        scratch = mujoco.MjData(self._model)
        scratch.qpos[:] = self._data.qpos
        scratch.qvel[:] = self._data.qvel
        scratch.ctrl[:] = self._compute_holding_ctrl(scratch)
        mujoco.mj_forward(self._model, scratch)
        values: Array = scratch.sensordata.copy()
        return values

    def step(self, ctrl: Array, wrenches: Array | None = None) -> None:
        """Advance by one control period.

        Args:
            ctrl: Set-points of the drives, shape (nu,), held until the next ones act.
            wrenches: Force and torque on each body in the world at its centre
                of mass, shape (nbody, 6), [N], [N m]; none if None.

        Raises:
            PhysicsError: MuJoCo warned, or an input is no number.
        """
        data = self._data
        if self._zeros.dot(ctrl) != 0.0:  # 0 times infinity or NaN is NaN
            raise PhysicsError("the controller's targets are not finite", self.time)
        if wrenches is not None:
            data.xfrc_applied[:] = wrenches
        if self._encoder_zeros is not None:
            ctrl = ctrl - self._encoder_zeros
        time = data.time
        if self._n_late:
            self._step_late(ctrl)
        else:
            self._ctrl[:] = ctrl
            mujoco.mj_step(self._model, data, self._n_substeps)
        if self._warnings.tobytes() != self._no_warnings:
            raise PhysicsError(self._describe_warnings(), time)

    def _step_late(self, ctrl: Array) -> None:
        """Advance by one control period with inputs that were given before it.

        Args:
            ctrl: Actuator inputs that are given now, shape (nu,).
        """
        given, n = self._given, self._n_substeps
        ctrl = ctrl.copy()
        if not given:
            given.extend([ctrl] * (1 + self._n_late // n))
        given.append(ctrl)
        n_before = self._n_late % n
        if n_before > 0:
            self._ctrl[:] = given[0]
            mujoco.mj_step(self._model, self._data, n_before)
        self._ctrl[:] = given[1]
        mujoco.mj_step(self._model, self._data, n - n_before)

    def _compute_holding_ctrl(self, scratch: Any) -> Array:
        """Return inputs whose torques leave the joints without acceleration.

        Assumes one servo on each joint with gear 1, as in all our robots:
        torque = gain ctrl + bias0 + bias1 q + bias2 q'.
        """
        model = self._model
        scratch.qacc[:] = 0.0
        mujoco.mj_inverse(model, scratch)
        joints = model.actuator_trnid[:, 0]
        dofs = model.jnt_dofadr[joints]
        bias = model.actuator_biasprm
        passive = bias[:, 0] + bias[:, 1] * scratch.qpos[model.jnt_qposadr[joints]]
        passive += bias[:, 2] * scratch.qvel[dofs]
        gains = model.actuator_gainprm[:, 0]
        ctrl: Array = (scratch.qfrc_inverse[dofs] - passive) / gains
        return ctrl

    def _describe_warnings(self) -> str:
        names = {
            int(kind): kind.name for kind in mujoco.mjtWarning.__members__.values()
        }
        raised = np.flatnonzero(self._data.warning.number)
        return "MuJoCo warned of " + ", ".join(names[int(i)] for i in raised)


def _ignore(_message: str) -> None:
    """Drop a warning; it is counted in ``data.warning`` all the same."""
