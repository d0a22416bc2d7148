# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Covariances of a two-stage filter: a state, and constant parameters that bias its measurements.

The first stage estimates the state as if the parameters were zero (Schmidt-Kalman filter), so its
error is e + S c, where e is an error with the covariance P, and S is the sensitivity to the
parameters c. Then its innovations are T c plus white noise, and the second stage estimates c from
them (Friedland 1969). Both stages together are the Kalman filter of state and parameters; the
prior of the parameters may change at any time.
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
    remaining = np.eye(len(covariance)) - gain @ rates
    updated = remaining @ covariance @ remaining.T + gain @ noise @ gain.T
    return gain, remaining, 0.5 * (updated + updated.T)


class TwoStageFilter:
    """
    Covariances of a state (n,) and of parameters (c,), and the estimated parameters.

    :ivar covariance: (n, n) covariance P of the state's own error.
    :ivar sensitivity: (n, c) derivatives S of the state's error with respect to the parameters.
    :ivar prior: (c, c) covariance of the parameters without the innovations.
    :ivar posterior: (c, c) covariance of the parameters with the innovations.
    :ivar parameters: (c,) estimated parameters.
    :param variances: (n,) prior variances of the state.
    :param prior: (c, c) covariance of the parameters.
    """

    def __init__(self, variances: Array, prior: Array) -> None:
        self.prior = prior
        self.reset(np.diag(variances))
        self.forget()

    def reset(self, covariance: Array) -> None:
        """Set the covariance (n, n) of the state, independent of the parameters."""
        self.covariance = covariance
        self.sensitivity = np.zeros((len(covariance), len(self.prior)))

    def forget(self) -> None:
        """Discard the parameters that were estimated from innovations."""
        # Inverse covariance of the parameters by innovations alone, and its product with them.
        self._information = np.zeros_like(self.prior)
        self._evidence = np.zeros(len(self.prior))
        self.set_prior(self.prior)

    def set_prior(self, prior: Array) -> None:
        """Set the covariance (c, c) of the parameters without the innovations."""
        self.prior = prior
        innovated = np.eye(len(prior)) + prior @ self._information
        self.posterior = np.linalg.solve(innovated, prior)
        self.parameters = self.posterior @ self._evidence

    def shift(self, moved: Array) -> None:
        """Subtract a known change (c,) from the parameters."""
        self._evidence = self._evidence - self._information @ moved
        self.parameters = self.posterior @ self._evidence

    def resize(self, size: int, first: int, variance: float) -> None:
        """Replace the last components of the state by components with a prior variance."""
        before, sensitivity = self.covariance, self.sensitivity
        self.reset(variance * np.eye(size))
        self.covariance[:first, :first] = before[:first, :first]
        self.sensitivity[:first] = sensitivity[:first]

    def spread(self, rates: Array, by_parameters: Array) -> Array:
        """
        Return the covariance (m, m) of m linear functions of state and parameters.

        :param rates: (m, n) derivatives of the functions with respect to the state.
        :param by_parameters: (m, c) derivatives of the functions with respect to the parameters.
        """
        whole = by_parameters + rates @ self.sensitivity
        return rates @ self.covariance @ rates.T + whole @ self.posterior @ whole.T

    def predict(self, decay: Array, noise: Array, drift: Array) -> Array:
        """
        Propagate the covariances; return the change (n,) of the state that keeps the estimate.

        The state was biased by the parameters before their drift. Its sensitivity to the later
        ones is smaller (Hsieh and Chen 1999).

        :param decay: (n,) factors by which the components of the state decay.
        :param noise: (n,) variances of the process noise of the state.
        :param drift: (c,) variances of the process noise of the parameters.
        """
        before, sensitivity = self.posterior, decay[:, None] * self.sensitivity
        drifted = np.array([before, self.prior]) + np.diag(drift)
        inverse, without = np.linalg.pinv(drifted, hermitian=True)
        self._information, self._evidence = inverse - without, inverse @ self.parameters
        self.set_prior(drifted[1])
        regression = before @ inverse
        self.sensitivity = sensitivity @ regression
        uncorrelated = sensitivity @ (before - regression @ before) @ sensitivity.T
        covariance = self.covariance * np.outer(decay, decay) + np.diag(noise)
        self.covariance = covariance + 0.5 * (uncorrelated + uncorrelated.T)
        return (sensitivity - self.sensitivity) @ self.parameters

    def condition(
        self, rates: Array, by_parameters: Array, noise: Array, innovation: Array | None = None
    ) -> Array:
        """
        Update the covariances by a measurement (m,), and return the Kalman gain (n, m).

        The gain is that for known parameters.

        :param rates: (m, n) derivatives of the measurement with respect to the state.
        :param by_parameters: (m, c) derivatives of the measurement with respect to the parameters.
        :param noise: (m, m) covariance of the measurement noise.
        :param innovation: (m,) measured minus predicted values for zero parameters; None: the
            parameters are not estimated.
        """
        if innovation is not None:
            whole = by_parameters + rates @ self.sensitivity
            weighted = np.linalg.solve(rates @ self.covariance @ rates.T + noise, whole).T
            self._information = self._information + weighted @ whole
            self._evidence = self._evidence + weighted @ innovation
            self.set_prior(self.prior)
        gain, remaining, self.covariance = condition(self.covariance, rates, noise)
        self.sensitivity = remaining @ self.sensitivity - gain @ by_parameters
        return gain
