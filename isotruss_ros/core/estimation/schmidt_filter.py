# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Covariances of a Schmidt-Kalman filter, whose measurements are biased by constant parameters.

The parameters are not estimated. The state is estimated as if they were zero, so its error is
e + S c, where e is an error with the covariance P, and S is the sensitivity to the parameters c.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace
import numpy as np
from scipy.linalg import lapack

F = TypeVar('F', bound='SchmidtFilter')


def condition(covariance: Array, rates: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Return the Kalman gain K, I - K H and the covariance after a measurement by `rates` H."""
    gain = np.linalg.solve(rates @ covariance @ rates.T + noise, rates @ covariance).T
    remaining = np.eye(len(covariance)) - gain @ rates
    updated = remaining @ covariance @ remaining.T + gain @ noise @ gain.T
    return gain, remaining, 0.5 * (updated + updated.T)


@dataclass(frozen=True, eq=False)
class SchmidtFilter:
    """
    Covariances of a state (n,) and of parameters (c,) that are not estimated.

    :ivar covariance: (n, n) covariance P of the state's own error.
    :ivar sensitivity: (n, c) derivatives S of the state's error with respect to the parameters.
    :ivar prior: (c, c) covariance of the parameters.
    """

    covariance: Array
    sensitivity: Array
    prior: Array

    def resized(self: F, size: int, first: int, variance: float) -> F:
        """Return the filter of n states, of which those from `first` on have a prior variance."""
        covariance, sensitivity = variance * np.eye(size), np.zeros((size, len(self.prior)))
        covariance[:first, :first] = self.covariance[:first, :first]
        sensitivity[:first] = self.sensitivity[:first]
        return replace(self, covariance=covariance, sensitivity=sensitivity)

    def spread(self, rates: Array, by_parameters: Array) -> Array:
        """Return the covariance (m, m) of outputs with these Jacobians by state and parameters."""
        total_rates = by_parameters + rates @ self.sensitivity  # by the parameters
        return rates @ self.covariance @ rates.T + total_rates @ self.prior @ total_rates.T

    def predicted(self: F, decay: Array, noise: Array, drift: Array) -> F:
        """
        Return the filter after variances of the state's noise and the parameters' drift.

        The state x becomes A x with A = diag(`decay`). It was biased by the parameters before
        their drift; its sensitivity to the later ones is smaller (Hsieh and Chen 1999).
        """
        # Parameters with the covariance C drift to C' = C + D. Linear regression of the earlier on
        # the later ones has the matrix R = C C'^-1 and residuals with the covariance C - R C.
        prior = self.prior + np.diag(drift)
        _, transposed, info = lapack.dposv(prior, self.prior)
        if info:  # a parameter is known exactly
            transposed = np.linalg.pinv(prior, hermitian=True) @ self.prior
        regression = transposed.T
        residual = self.prior - regression @ self.prior
        # S' = A S R, and P' = A P A^T + N + A S (C - R C) (A S)^T.
        decayed = decay[:, None] * self.sensitivity
        by_residual = decayed @ residual @ decayed.T
        covariance = self.covariance * np.outer(decay, decay) + np.diag(noise)
        covariance = covariance + 0.5 * (by_residual + by_residual.T)
        return replace(self, covariance=covariance, sensitivity=decayed @ regression, prior=prior)

    def conditioned(self: F, rates: Array, by_parameters: Array, noise: Array) -> tuple[F, Array]:
        """Return the filter after a measurement (m,), and the gain (n, m) of the state."""
        gain, remaining, covariance = condition(self.covariance, rates, noise)
        sensitivity = remaining @ self.sensitivity - gain @ by_parameters
        return replace(self, covariance=covariance, sensitivity=sensitivity), gain
