# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rejection of wrong joint markers, and detection of slipped rollers from the markers."""

from __future__ import annotations

from collections import deque
import itertools

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

    If some markers are inconsistent, two hypotheses are compared: one roller has slipped by at
    most its travel `reach` (r,) [m], or some markers are wrong. For each, the worst marker is
    rejected repeatedly until the others are consistent; if most are inconsistent, all are
    rejected. The hypothesis with more consistent markers is selected.
    """
    count, difference = len(innovation), innovation.ravel()
    all_markers, no_slip = np.ones(count, dtype=bool), np.zeros_like(reach)
    if passes_gate(difference, covariance):
        return all_markers, no_slip

    def select(markers: Flags) -> tuple[Array, Array]:
        rows = np.flatnonzero(np.repeat(markers, 2))
        return difference[rows], covariance[np.ix_(rows, rows)]

    # The slip of one roller that best explains the markers.
    weighted = np.linalg.solve(covariance, by_rollers)
    squares = np.einsum('ij,ij->j', by_rollers, weighted)
    slips = np.diag(np.clip(weighted.T @ difference / np.maximum(squares, 1e-12), -reach, reach))
    distances = [_squared_distance(difference - by_rollers @ slip, covariance) for slip in slips]
    slip = slips[int(np.argmin(distances))]
    is_slip = passes_gate(difference - by_rollers @ slip, covariance)
    kept = all_markers
    while kept.any() and not passes_gate(*select(kept)):
        without_one = kept & ~np.eye(count, dtype=bool)[kept]
        kept = min(without_one, key=lambda markers: _squared_distance(*select(markers)))
    if 2 * kept.sum() < count:
        kept = np.zeros_like(kept)
    # A slip that explains all markers is more probable than two simultaneous wrong markers.
    if is_slip and count - kept.sum() == 1 and kept.any():
        mean_square = _squared_distance(*select(kept)) / (2 * kept.sum())
        is_slip = min(distances) / (2 * count - 1) < mean_square
    return (all_markers, slip) if is_slip else (kept, no_slip)


def find_swap(measured: Array, expected: Array, covariance: Array) -> tuple[int, int] | None:
    """Return two markers whose swap makes all markers (k, 2) consistent, or None."""
    for pair in itertools.combinations(range(len(measured)), 2):
        swapped = measured.copy()
        swapped[list(pair)] = measured[list(reversed(pair))]
        if passes_gate((swapped - expected).ravel(), covariance):
            return pair
    return None


def _squared_distance(off: Array, covariance: Array) -> float:
    """Return the squared Mahalanobis distance of an innovation from zero."""
    return float(off @ np.linalg.solve(covariance, off))


class SlipWatch:
    """Detector of slipping rollers, which compares roller offsets with an earlier estimate."""

    def __init__(self, count: int) -> None:
        self.slipping = np.zeros(count, dtype=bool)  #: (r,) mask of the slipping rollers
        self._kept: deque[tuple[float, Array, Array, Array]] = deque()

    def add(self, time: float, travel: Array, offsets: Array, variances: Array) -> None:
        """Update `slipping` with offsets (r,), compared with the offsets `SLIP_SPAN` earlier."""
        self._kept.append((time, travel, offsets, variances))
        while time - self._kept[0][0] > SLIP_SPAN:
            self._kept.popleft()
        _, travel_then, offsets_then, variances_then = self._kept[0]
        change, rolled = offsets - offsets_then, travel - travel_then
        is_significant = np.abs(change) > SLIP_SIGMAS * np.sqrt(variances + variances_then)
        is_large = np.abs(change) > np.maximum(MIN_SLIP, MIN_SLIP_SHARE * np.abs(rolled))
        # A slipping tube lags behind its roller.
        self.slipping = is_significant & is_large & (change * rolled < 0.0)
