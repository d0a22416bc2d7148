# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detection of outliers, such as typing errors, in a group of measured points."""

from __future__ import annotations

from isotruss_ros.calibration.measurements import Group
from isotruss_ros.core.numerics.arrays import Array, Flags
import numpy as np

#: Probability that a group without outliers has a detected outlier [-].
FALSE_OUTLIER_PROBABILITY = 1e-5
#: Smallest deviation of an outlier relative to the rise of the line [-]. At a third of this value,
#: correct points of softening tubes are removed; at three times of it, typing errors of half the
#: load are not removed.
MIN_DEVIATION_SHARE = 0.2
#: Largest fraction of outliers in a group [-].
MAX_OUTLIER_SHARE = 0.2


def outlying_points(group: Group) -> tuple[Flags, Array]:
    """
    Return the points of a group that are outliers from its regression line.

    The line has an offset for each trial. If the largest externally studentised residual exceeds a
    bound, its point is an outlier; it is removed, and the test is repeated with the other points.

    :param group: points of one mode, pressure and length.
    :return: mask (n,) of the outliers; and deviation (n,) of each outlier from the line through
        the points that are no outliers, zero for other points [N or N m].
    """
    from scipy import special

    off, out = np.zeros(len(group.loads)), np.zeros(len(group.loads), dtype=bool)
    for _ in range(int(MAX_OUTLIER_SHARE * len(out))):
        rest, scale, rise = _deleted(group, ~out)
        with np.errstate(divide='ignore', invalid='ignore'):
            ratio = np.abs(rest) / scale
        worst = int(np.nan_to_num(ratio, nan=0.0, posinf=np.inf).argmax())
        freedom = int((~out).sum()) - 3 - int(group.trials.max())
        if freedom < 2 or abs(rest[worst]) <= MIN_DEVIATION_SHARE * rise[worst]:
            break
        if 2.0 * special.stdtr(freedom, -ratio[worst]) * len(out) > FALSE_OUTLIER_PROBABILITY:
            break
        out[worst], off[worst] = True, rest[worst]
    return out, off


def _deleted(group: Group, used: Flags) -> tuple[Array, Array, Array]:
    """
    Return residuals from the line through the other points, their deviations, and rises.

    Each of the three arrays has one value for each point. The line is fitted without this point.
    The deviation is the standard deviation of the residual; the rise is the difference between the
    largest and the smallest load of the other points. The residual is zero if the point is unused,
    or if the other points do not determine a line.
    """
    n, x, y = len(used), group.displacements, group.loads
    trials = group.trials[:, None] == np.arange(group.trials.max() + 1)
    matrix = np.column_stack([x / max(np.abs(x).max(), np.finfo(float).tiny), trials])[used]
    rest, scale, rise = np.zeros(n), np.full(n, np.inf), np.full(n, np.inf)
    basis, sizes, _ = np.linalg.svd(matrix, full_matrices=False)
    basis = basis[:, sizes > 1e-12 * sizes[0]]
    left = y[used] - basis @ (basis.T @ y[used])
    free = 1.0 - (basis**2).sum(axis=1)
    freedom = int(used.sum()) - basis.shape[1] - 1
    if freedom < 1:
        return rest, scale, rise
    told = free > 1e-6
    deleted = np.where(told, left / np.where(told, free, 1.0), 0.0)
    squares = np.maximum(left @ left - deleted**2 * free, 0.0)
    # Lower bound of the scatter by rounding.
    least = np.finfo(float).eps * np.abs(y[used]).max()
    rest[used] = deleted
    scale[used] = np.maximum(np.sqrt(squares / freedom), least) / np.sqrt(np.maximum(free, 1e-6))
    loads = np.sort(y[used])
    high = np.where(y[used] == loads[-1], loads[-2], loads[-1])
    rise[used] = high - np.where(y[used] == loads[0], loads[1], loads[0])
    return rest, scale, rise
