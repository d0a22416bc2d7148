# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Covariances of a Schmidt-Kalman filter, whose measurements are biased by constant parameters.

The parameters are not estimated. The state is estimated as if they were zero, so its error is
e + S c, where e is an error with the covariance P, and S is the sensitivity to the parameters c.
"""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array
import numpy as np


def condition(covariance: Array, rates: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Return the Kalman gain K (n, m), I - K H (n, n) for `rates` H, and the new covariance."""
    gain = np.linalg.solve(rates @ covariance @ rates.T + noise, rates @ covariance).T
    remaining = np.eye(len(covariance)) - gain @ rates
    updated = remaining @ covariance @ remaining.T + gain @ noise @ gain.T
    return gain, remaining, 0.5 * (updated + updated.T)


class SchmidtFilter:
    """
    Covariances of a state (n,) and of parameters (c,) that are not estimated.

    :ivar covariance: (n, n) covariance P of the state's own error.
    :ivar sensitivity: (n, c) derivatives S of the state's error with respect to the parameters.
    :ivar prior: (c, c) covariance of the parameters.
    """

    def __init__(self, variances: Array, prior: Array) -> None:
        self.prior = prior
        self.reset(np.diag(variances))

    def reset(self, covariance: Array) -> None:
        """Set the covariance (n, n) of the state, independent of the parameters."""
        self.covariance = covariance
        self.sensitivity = np.zeros((len(covariance), len(self.prior)))

    def resize(self, size: int, first: int, variance: float) -> None:
        """Set the size of the state; components from `first` on get a prior variance."""
        before, sensitivity = self.covariance, self.sensitivity
        self.reset(variance * np.eye(size))
        self.covariance[:first, :first] = before[:first, :first]
        self.sensitivity[:first] = sensitivity[:first]

    def spread(self, rates: Array, by_parameters: Array) -> Array:
        """Return the covariance (m, m) of functions linear in state (m, n), parameters (m, c)."""
        whole = by_parameters + rates @ self.sensitivity
        return rates @ self.covariance @ rates.T + whole @ self.prior @ whole.T

    def predict(self, decay: Array, noise: Array, drift: Array) -> None:
        """
        Propagate the covariances by variances of the state's noise and the parameters' drift.

        The state was biased by the parameters before their drift. Its sensitivity to the later
        ones is smaller (Hsieh and Chen 1999).
        """
        before, sensitivity = self.prior, decay[:, None] * self.sensitivity
        self.prior = before + np.diag(drift)
        regression = before @ np.linalg.pinv(self.prior, hermitian=True)
        self.sensitivity = sensitivity @ regression
        uncorrelated = sensitivity @ (before - regression @ before) @ sensitivity.T
        covariance = self.covariance * np.outer(decay, decay) + np.diag(noise)
        self.covariance = covariance + 0.5 * (uncorrelated + uncorrelated.T)

    def condition(self, rates: Array, by_parameters: Array, noise: Array) -> Array:
        """Update the covariances by a measurement (m,); return the gain (n, m) of the state."""
        gain, remaining, self.covariance = condition(self.covariance, rates, noise)
        self.sensitivity = remaining @ self.sensitivity - gain @ by_parameters
        return gain
