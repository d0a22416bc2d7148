# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Covariance of a Schmidt-Kalman filter: measurements correct a state, parameters are considered.

Considered parameters are uncertain but not corrected, so their covariance C is constant. The error
of the state is e + S c, where e is an error with the covariance P, and S is the sensitivity to the
errors c of the parameters.
"""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array
import numpy as np


def condition(covariance: Array, rates: Array, noise: Array) -> tuple[Array, Array, Array]:
    """
    Return the Kalman gain K (n, m), the matrix I - K H (n, n), and the new covariance.

    :param covariance: (n, n) covariance of the state before the measurement.
    :param rates: (m, n) derivatives of the measurement with respect to the state.
    :param noise: (m, m) covariance of the measurement noise.
    """
    gain = np.linalg.solve(rates @ covariance @ rates.T + noise, rates @ covariance).T
    left = np.eye(len(covariance)) - gain @ rates
    found = left @ covariance @ left.T + gain @ noise @ gain.T
    return gain, left, 0.5 * (found + found.T)


class SchmidtFilter:
    """
    Covariances of a state (n,) and of considered parameters (c,).

    :ivar covariance: (n, n) covariance P of the state's own error.
    :ivar considered: (c, c) covariance C of the parameters.
    :ivar sensitivity: (n, c) derivatives S of the state's error with respect to the parameters.
    :param variances: (n,) prior variances of the state.
    :param considered: (c, c) covariance of the parameters.
    """

    def __init__(self, variances: Array, considered: Array) -> None:
        self.considered = considered
        self.reset(np.diag(variances))

    def reset(self, covariance: Array) -> None:
        """
        Set the covariance of the state, and set the sensitivity to the parameters to zero.

        :param covariance: (n, n) covariance of the state.
        """
        self.covariance = covariance
        self.sensitivity = np.zeros((len(covariance), len(self.considered)))

    def resize(self, size: int, first: int, variance: float) -> None:
        """Replace the last components of the state by components with a prior variance."""
        before, sensitivity = self.covariance, self.sensitivity
        self.reset(variance * np.eye(size))
        self.covariance[:first, :first] = before[:first, :first]
        self.sensitivity[:first] = sensitivity[:first]

    def spread(self, rates: Array, by_considered: Array) -> Array:
        """
        Return the covariance (m, m) of m linear functions of state and parameters.

        :param rates: (m, n) derivatives of the functions with respect to the state.
        :param by_considered: (m, c) derivatives of the functions with respect to the parameters.
        """
        whole = by_considered + rates @ self.sensitivity
        return rates @ self.covariance @ rates.T + whole @ self.considered @ whole.T

    def predict(self, decay: Array, noise: Array) -> None:
        """
        Propagate the covariance of the state over time.

        :param decay: (n,) factors by which the components of the state decay.
        :param noise: (n,) variances of the process noise.
        """
        self.covariance = self.covariance * np.outer(decay, decay) + np.diag(noise)
        self.sensitivity = decay[:, None] * self.sensitivity

    def condition(self, rates: Array, by_considered: Array, noise: Array) -> Array:
        """
        Update the covariance by a measurement (m,), and return the Kalman gain (n, m).

        The gain is computed as if the parameters had no errors.

        :param rates: (m, n) derivatives of the measurement with respect to the state.
        :param by_considered: (m, c) derivatives of the measurement with respect to the parameters.
        :param noise: (m, m) covariance of the measurement noise.
        """
        gain, left, self.covariance = condition(self.covariance, rates, noise)
        self.sensitivity = left @ self.sensitivity - gain @ by_considered
        return gain
