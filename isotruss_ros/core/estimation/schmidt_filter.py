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
    """Return the Kalman gain K, I - K H and the covariance after a measurement by `rates` H."""
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
        """Resize the state; set the components from index `first` on to a prior `variance`."""
        covariance, sensitivity = self.covariance, self.sensitivity
        self.reset(variance * np.eye(size))
        self.covariance[:first, :first] = covariance[:first, :first]
        self.sensitivity[:first] = sensitivity[:first]

    def spread(self, rates: Array, by_parameters: Array) -> Array:
        """Return the covariance (m, m) of outputs with these Jacobians by state and parameters."""
        total_rates = by_parameters + rates @ self.sensitivity  # by the parameters
        return rates @ self.covariance @ rates.T + total_rates @ self.prior @ total_rates.T

    def predict(self, decay: Array, noise: Array, drift: Array) -> None:
        """
        Propagate the covariances by variances of the state's noise and the parameters' drift.

        The state x becomes A x with A = diag(`decay`). It was biased by the parameters before
        their drift; its sensitivity to the later ones is smaller (Hsieh and Chen 1999).
        """
        # Parameters with the covariance C drift to C' = C + D. Linear regression of the earlier on
        # the later ones has the matrix R = C C'^-1 and residuals with the covariance C - R C.
        prior_before = self.prior
        self.prior = prior_before + np.diag(drift)
        regression = prior_before @ np.linalg.pinv(self.prior, hermitian=True)
        residual = prior_before - regression @ prior_before
        # S' = A S R, and P' = A P A^T + N + A S (C - R C) (A S)^T.
        decayed = decay[:, None] * self.sensitivity
        self.sensitivity = decayed @ regression
        by_residual = decayed @ residual @ decayed.T
        covariance = self.covariance * np.outer(decay, decay) + np.diag(noise)
        self.covariance = covariance + 0.5 * (by_residual + by_residual.T)

    def condition(self, rates: Array, by_parameters: Array, noise: Array) -> Array:
        """Update the covariances by a measurement (m,); return the gain (n, m) of the state."""
        gain, remaining, self.covariance = condition(self.covariance, rates, noise)
        self.sensitivity = remaining @ self.sensitivity - gain @ by_parameters
        return gain
