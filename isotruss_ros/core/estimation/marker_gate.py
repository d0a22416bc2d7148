# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rejection of wrong joint markers, and detection of slipped rollers from the markers."""

from __future__ import annotations

from collections import deque
import itertools
import math

from isotruss_ros.core.numerics.arrays import Array, Flags
import numpy as np
import scipy

#: Probability that valid measurements fail a gate or a comparison [-]. Some twenty independent
#: comparisons per second then have one false alarm in an hour.
FALSE_ALARM_PROBABILITY = 1.5e-5
#: Smallest change of an offset under slip, in standard deviations [-].
SLIP_SIGMAS = -float(scipy.special.ndtri(FALSE_ALARM_PROBABILITY))
#: Smallest change of an offset under slip [m], and as a fraction of the travel [-].
MIN_SLIP, MIN_SLIP_SHARE = 1e-3, 0.01
#: Interval in which offsets are compared [s].
SLIP_SPAN = 4.0


def passes_gate(innovation: Array, covariance: Array) -> bool:
    """Return whether an innovation (m,) with a covariance (m, m) passes the chi-square gate."""
    gate = scipy.special.chdtri(len(innovation), FALSE_ALARM_PROBABILITY)
    return _squared_distance(innovation, covariance) <= gate


def judge_markers(
    innovation: Array, covariance: Array, by_rollers: Array, reach: Array
) -> tuple[Flags, Array]:
    """
    Return the mask (k,) of consistent markers, and the slip (r,) of at most one roller [m].

    If some markers are inconsistent, there are two hypotheses. One roller has slipped by at most
    its travel `reach` (r,) [m]; this must explain all markers. Or some markers are wrong: the
    worst one is rejected repeatedly until the others are consistent; if most are wrong, all are
    rejected.
    """
    count, coordinates = len(innovation), innovation.ravel()
    all_markers = np.ones(count, dtype=bool)
    if passes_gate(coordinates, covariance):
        return all_markers, np.zeros_like(reach)
    # First hypothesis: slip of each roller by weighted least squares, (b^T S^-1 z) / (b^T S^-1 b);
    # the best roller has the smallest residual.
    weighted = np.linalg.solve(covariance, by_rollers)
    information = np.maximum(np.einsum('ij,ij->j', by_rollers, weighted), 1e-12)
    slips = np.diag(np.clip(weighted.T @ coordinates / information, -reach, reach))
    residuals = [coordinates - by_rollers @ slip for slip in slips]
    distances = [_squared_distance(residual, covariance) for residual in residuals]
    best = int(np.argmin(distances))
    is_slip = passes_gate(residuals[best], covariance)
    # Second hypothesis: wrong markers.
    consistent, mean_square = _reject_markers(coordinates, covariance)
    # A slip that explains all markers is more probable than two simultaneous wrong markers. With
    # one wrong marker, the mean squares per degree of freedom decide; the slip uses one degree.
    if count - consistent.sum() == 1:
        is_slip = is_slip and distances[best] / (2 * count - 1) < mean_square
    return (all_markers, slips[best]) if is_slip else (consistent, np.zeros_like(reach))


def _reject_markers(coordinates: Array, covariance: Array) -> tuple[Flags, float]:
    """Return the mask (k,) of consistent markers, and their mean squared distance [-]."""

    def select(markers: Flags) -> tuple[Array, Array]:
        rows = np.flatnonzero(np.repeat(markers, 2))
        return coordinates[rows], covariance[np.ix_(rows, rows)]

    consistent = np.ones(len(coordinates) // 2, dtype=bool)
    while consistent.any() and not passes_gate(*select(consistent)):
        # Masks of the present markers without one of them; the best mask lacks the worst marker.
        masks = consistent & ~np.eye(len(consistent), dtype=bool)[consistent]
        consistent = min(masks, key=lambda markers: _squared_distance(*select(markers)))
    if 2 * consistent.sum() < len(consistent):  # most are wrong, so all are rejected
        return np.zeros_like(consistent), math.inf
    return consistent, _squared_distance(*select(consistent)) / (2 * consistent.sum())


def find_swap(measured: Array, expected: Array, covariance: Array) -> tuple[int, int] | None:
    """Return two markers whose swap makes all markers (k, 2) consistent, or None."""
    for pair in itertools.combinations(range(len(measured)), 2):
        swapped = measured.copy()
        swapped[list(pair)] = measured[list(reversed(pair))]
        if passes_gate((swapped - expected).ravel(), covariance):
            return pair
    return None


def _squared_distance(innovation: Array, covariance: Array) -> float:
    """Return the squared Mahalanobis distance of an innovation (m,) from zero."""
    return float(innovation @ np.linalg.solve(covariance, innovation))


class SlipWatch:
    """Detector of slipping rollers, which compares roller offsets with an earlier estimate."""

    def __init__(self, count: int) -> None:
        self.slipping = np.zeros(count, dtype=bool)  #: (r,) mask of the slipping rollers
        #: Arguments of `add` within `SLIP_SPAN`, in order of time.
        self._history: deque[tuple[float, Array, Array, Array]] = deque()

    def add(self, time: float, travel: Array, offsets: Array, variances: Array) -> None:
        """Update `slipping` with offsets (r,), compared with the offsets `SLIP_SPAN` earlier."""
        self._history.append((time, travel, offsets, variances))
        while time - self._history[0][0] > SLIP_SPAN:
            self._history.popleft()
        _, travel_before, offsets_before, variances_before = self._history[0]
        slip, distance = offsets - offsets_before, travel - travel_before
        is_significant = np.abs(slip) > SLIP_SIGMAS * np.sqrt(variances + variances_before)
        is_large = np.abs(slip) > np.maximum(MIN_SLIP, MIN_SLIP_SHARE * np.abs(distance))
        # A slipping tube lags behind its roller.
        self.slipping = is_significant & is_large & (slip * distance < 0.0)
