r"""Errors of the estimate as a linear system driven by those of the sensors.

The state holds the errors of what the estimator keeps, those of the drives' velocity
trackers, and the biases of all channels, which walk:

.. math::
    s' = F s + G w, \quad e = H s + J w, \quad
    P' = F P F^T + G G^T, \quad S = H P H^T + J J^T

with unit white noise w. F holds the estimator's own corrections, I - K C for a filter
of gain K, and G its K: the recursion is Joseph's form of the covariance, which holds
for whatever gains a filter has, optimal or not [Bar-Shalom, Li, Kirubarajan:
Estimation with Applications to Tracking and Navigation, 2001, eq. 5.2.3-18].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballsim.config import Config
from ballsim.error_model.linear_estimator import LinearEstimator
from ballsim.error_model.sensor_errors import SensorErrors
from ballsim.error_model.snapshots import TRUNK_ATTITUDE
from ballsim.sensors import VelocityTracker
from ballsim_controllers.messages import Array

__all__ = ["ErrorSystem", "make_error_system", "make_start"]


@dataclass(frozen=True, slots=True)
class ErrorSystem:
    """One or more ticks of the error system; see the module.

    Attributes:
        F: Transition, shape (n, n).
        Q: Covariance of what the noise adds, G G', shape (n, n).
        H: To the errors of the estimate of the first tick, shape (q, n).
        R: Covariance of what the noise adds to them, J J', shape (q, q).
        N: Of what it adds to the state of the next tick with the same, G J', (n, q).
    """

    F: Array
    Q: Array
    H: Array
    R: Array
    N: Array

    def advance(self, P: Array) -> Array:
        """Return the covariance of the state after the ticks, shape (n, n)."""
        P = self.F @ P @ self.F.T + self.Q
        symmetric: Array = 0.5 * (P + P.T)
        return symmetric

    def observe(self, P: Array) -> Array:
        """Return the covariance of the estimate of the first tick, shape (q, q)."""
        covariance: Array = self.H @ P @ self.H.T + self.R
        return covariance

    def repeat(self, count: int) -> ErrorSystem:
        """Return so many ticks at once, by repeated squaring."""
        n = len(self.F)
        N = np.linalg.matrix_power(self.F, count - 1) @ self.N
        F, Q, power, noise = np.eye(n), np.zeros((n, n)), self.F, self.Q
        while count:
            if count & 1:
                F, Q = power @ F, power @ Q @ power.T + noise
            power, noise = power @ power, power @ noise @ power.T + noise
            count >>= 1
        return ErrorSystem(F, Q, self.H, self.R, N)

    def correlate(self, P: Array, outputs: slice, count: int) -> Array:
        """Return the covariances of outputs with themselves some steps before.

        Args:
            P: Covariance of the state, taken for stationary, shape (n, n).
            outputs: Which of the errors.
            count: Number of steps of this system.

        Returns:
            For lags of 0, 1, ... steps, shape (count, d, d).
        """
        H = self.H[outputs]
        result = [self.observe(P)[outputs, outputs]]
        crossed = self.F @ P @ H.T + self.N[:, outputs]
        for _ in range(count - 1):
            result.append(H @ crossed)
            crossed = self.F @ crossed
        return np.array(result)


def make_error_system(
    config: Config,
    estimator: LinearEstimator,
    sensors: SensorErrors,
    is_first: bool = False,
) -> ErrorSystem:
    """Return the error system of one tick.

    Args:
        config: The run.
        estimator: The estimator's update.
        sensors: Errors of the sensors.
        is_first: True for the first tick, at which the trackers take the first sample
            for the place and 0 for the velocity.
    """
    period = config.simulation.control_period
    n_reading, n_channels = estimator.B.shape[1], len(sensors.bias_std)
    n_joints = n_reading - n_channels
    bandwidth = config.sensors.encoder.velocity_bandwidth
    _, position_gain, velocity_gain = VelocityTracker(bandwidth, period, 1).gains
    one = np.eye(n_joints)
    # Place and velocity of the trackers, from themselves and from the encoders' noise.
    step = np.array([[1.0, period], [0.0, 1.0]])
    gain = np.array([[position_gain], [velocity_gain]])
    if is_first:
        step, gain = np.zeros((2, 2)), np.array([[1.0], [0.0]])
    tracker = np.kron(step - gain @ step[:1], one)
    noise = np.kron(gain, one)
    # The reading from tracker, biases and white noise.
    from_velocity = np.zeros((n_reading, 2 * n_joints))
    from_velocity[n_joints : 2 * n_joints, n_joints:] = one
    from_channel = np.delete(np.eye(n_reading), np.s_[n_joints : 2 * n_joints], axis=1)
    white = from_channel.copy()
    white[:, :n_joints] += from_velocity @ noise
    white *= sensors.white_std
    B, D = estimator.B, estimator.D
    n, m, k = len(estimator.A), n_channels, 2 * n_joints
    F, G = np.zeros((n + k + m, n + k + m)), np.zeros((n + k + m, 2 * m))
    F[:n] = np.hstack([estimator.A, B @ from_velocity @ tracker, B @ from_channel])
    F[n : n + k, n : n + k] = tracker
    F[n + k :, n + k :] = np.eye(m)
    G[:n, :m] = B @ white
    G[n : n + k, :n_joints] = noise * sensors.white_std[:n_joints]
    G[n + k :, m:] = np.diag(sensors.walk_std)
    H = np.hstack([estimator.C, D @ from_velocity @ tracker, D @ from_channel])
    J = D @ white
    return ErrorSystem(F, G @ G.T, H, J @ J.T, G[:, :m] @ J.T)


def make_start(config: Config, system: ErrorSystem, sensors: SensorErrors) -> Array:
    """Return the covariance of the state before the first reading.

    The estimator is right but for the robot's lean, whose direction and size are
    drawn uniformly.

    Args:
        config: The run.
        system: The error system.
        sensors: Errors of the sensors.
    """
    P = np.zeros_like(system.F)
    tilt = [TRUNK_ATTITUDE, TRUNK_ATTITUDE + 1]
    # Mean square of the size, max^2 / 3, shared by two directions.
    P[tilt, tilt] = config.initial.max_lean**2 / 6.0
    biases = np.arange(len(P) - len(sensors.bias_std), len(P))
    P[biases, biases] = sensors.bias_std**2
    return P
