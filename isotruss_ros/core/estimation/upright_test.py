# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Likelihood ratio of an upright and a flat robot, from the innovations of joint markers.

The filter of the roller offsets neglects weight, so the offsets absorb a part of the sag of the
joints. With three markers and offsets of 10 mm they absorb all of it: then no statistic of the
markers detects an upright robot. So its weight increases the stated covariance of the offsets
until the markers exclude it.
"""

from __future__ import annotations

import math

from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: Likelihood ratio of an upright to a flat robot below which the markers exclude the upright one,
#: and the largest probability with which they exclude it wrongly [-].
MIN_LIKELIHOOD_RATIO = 0.05
#: Directions of gravity in the robot's plane, (2, 36).
DIRECTIONS = np.array(
    [[math.cos(math.radians(a)), math.sin(math.radians(a))] for a in range(0, 360, 10)]
).T


class UprightTest:
    """
    Sequential test of a constant bias of a Kalman filter, the weight w (2,) in the robot's plane.

    The unit of the weight is the largest possible one, that of an upright robot.

    :ivar is_admitted: whether weight changes the mean, and the markers do not exclude it.
    :ivar by_weight: (n, 2) derivatives of the filter's mean by the weight.
    :ivar covariance: (n, n) covariance of the mean's error by a weight that is not excluded.

    :param sag: (2j, 2) displacements of the joints by the weight [m].
    :param size: number n of states of the filter.
    """

    def __init__(self, sag: Array, size: int) -> None:
        self._sag = sag
        # Information and score of the weight in the innovations.
        self._information, self._score = np.zeros((2, 2)), np.zeros(2)
        self.is_admitted = False
        self.by_weight, self.covariance = np.zeros((size, 2)), np.zeros((size, size))

    def add(
        self, rows: Indices, rates: Array, gain: Array, innovation: Array, covariance: Array
    ) -> None:
        """
        Add an update of the filter by marker coordinates `rows` (m,), with the gain (n, m).

        :param rates: (m, n) Jacobian of the coordinates by the state.
        :param innovation: (m,) innovation with this `covariance` (m, m).
        """
        if not self._sag.any():
            return
        change = self._sag[rows] - rates @ self.by_weight  # of the innovation by the weight
        weighted = np.linalg.solve(covariance, change)
        self._information = self._information + change.T @ weighted
        self._score = self._score + weighted.T @ innovation
        self.by_weight = self.by_weight + gain @ change
        squares = (DIRECTIONS * (self._information @ DIRECTIONS)).sum(axis=0)
        log_ratio = (self._score @ DIRECTIONS - 0.5 * squares).max()
        is_possible = log_ratio > math.log(MIN_LIKELIHOOD_RATIO)
        self.is_admitted = bool(is_possible and self.by_weight.any())
        if not self.is_admitted:
            self.covariance = np.zeros_like(self.covariance)
            return
        # Second moment of the weight, with its largest value as prior deviation.
        spread = np.linalg.inv(self._information + np.eye(2))
        mean = spread @ self._score
        moment = spread + np.outer(mean, mean)
        self.covariance = self.by_weight @ moment @ self.by_weight.T
