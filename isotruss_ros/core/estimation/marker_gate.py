# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which markers of joints fit, and whether those that do not tell of a roller that slips."""

from __future__ import annotations

import itertools

from isotruss_ros.core.numerics.arrays import Array, Flags
import numpy as np
import scipy

#: Markers that are farther off than one in so many is do not fit.
RARE = 1e-4


def fits(innovation: Array, covariance: Array) -> bool:
    """
    Tell whether a measurement is as near to its expectation as it should be.

    :param innovation: (m,) measured minus expected.
    :param covariance: (m, m) of that.
    """
    return _size(innovation, covariance) <= scipy.special.chdtri(len(innovation), RARE)


def judge_markers(
    innovation: Array, covariance: Array, by_rollers: Array, reach: Array
) -> tuple[Flags, Array]:
    """
    Choose the markers that fit together, see `RARE`.

    Where they do not all fit, either one roller has slipped, by no more than it has turned; or
    markers lie, and the worst are left out until the others fit: all, where most do not. What
    explains more holds.

    :param innovation: (k, 2) measured minus expected joints [m].
    :param covariance: (2k, 2k) of these.
    :param by_rollers: (2k, r) derivatives of the joints by the rollers.
    :param reach: (r,) by how much each roller can have slipped at most [m].
    :return: (k,) which are used, and (r,) by how much rollers have slipped if these fit [m].
    """
    count, off = len(innovation), innovation.ravel()
    every, kept = np.ones((2, count), dtype=bool)
    if fits(off, covariance):
        return every, np.zeros_like(reach)

    def size(some: Flags) -> float:
        rows = np.flatnonzero(np.repeat(some, 2))
        return _size(off[rows], covariance[np.ix_(rows, rows)]) if len(rows) else 0.0

    slip = _find_slip(off, covariance, by_rollers, reach)
    left = _size(off - by_rollers @ slip, covariance)
    explained = left <= scipy.special.chdtri(2 * count, RARE)
    while kept.any() and size(kept) > scipy.special.chdtri(2 * kept.sum(), RARE):
        kept = min(kept & ~np.eye(count, dtype=bool)[kept], key=size)
    if 2 * kept.sum() < count:
        kept[:] = False
    # A slip that explains all of them is likelier than two markers that lie at once.
    if explained and count - kept.sum() == 1 and kept.any():
        explained = left / (2 * count - 1) < size(kept) / (2 * kept.sum())
    return (every, slip) if explained else (kept, np.zeros_like(reach))


def find_swap(measured: Array, expected: Array, covariance: Array) -> tuple[int, int] | None:
    """
    Return two markers that fit, with all others, once they are swapped; None if none do.

    :param measured: (k, 2) joints [m].
    :param expected: (k, 2) the same [m].
    :param covariance: (2k, 2k) of the difference [m^2].
    """
    for pair in itertools.combinations(range(len(measured)), 2):
        swapped = measured.copy()
        swapped[list(pair)] = measured[list(reversed(pair))]
        if fits((swapped - expected).ravel(), covariance):
            return pair
    return None


def _find_slip(off: Array, covariance: Array, by_rollers: Array, reach: Array) -> Array:
    """Return the slip of one roller, (r,), that leaves the least of what markers are off [m]."""
    weighted = np.linalg.solve(covariance, by_rollers)
    size = np.einsum('ij,ij->j', by_rollers, weighted)
    slipped = np.clip((weighted.T @ off) / np.maximum(size, 1e-12), -reach, reach)
    slips = np.diag(slipped)
    return min(slips, key=lambda each: _size(off - by_rollers @ each, covariance))


def _size(off: Array, covariance: Array) -> float:
    """Return the square of a deviation in units of its standard deviation."""
    return float(off @ np.linalg.solve(covariance, off))
