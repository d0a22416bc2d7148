# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Stiffness from a group of points, which is the slope of load over displacement.

Tubes soften or stiffen under large deformation, so only the linear range of the displacement is
used. This is the largest range |displacement| <= d in which a cubic does not fit the points better
than a line. The search decreases d from the largest displacement in steps of 5 %.
"""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.calibration.measurements import Group
from isotruss_ros.core.numerics.arrays import Array, Flags, MAX_MAGNITUDE
import numpy as np

#: Largest deviation of the cubic from the line in the linear range, relative to the rise of the
#: line [-].
TOLERANCE = 0.02
#: Significance level of the F test for the cubic [-].
SIGNIFICANCE = 0.01
#: Values of d that the search tries, relative to the largest displacement [-].
RANGES = np.linspace(1.0, 0.1, 19)

LONE_DISPLACEMENT = 'the only displacement of its trial in the linear range; a slope needs two'


@dataclass(frozen=True, eq=False)
class Slope:
    """Slope of load over displacement for one group of points."""

    group: Group  #: measured points
    stiffness: float  #: slope [N/m], in the rotary mode [N m/rad]; NaN if undetermined
    offsets: Array  #: (n,) fitted load at zero displacement in the trial of each point
    limit: float  #: largest |displacement| of the linear range [m, rad]
    used: Flags  #: (n,) mask of the points in the fit
    reasons: tuple[str, ...]  #: (n,) reason why each point is unused; empty for used points


def fit_slope(
    group: Group, tolerance: float = TOLERANCE, max_displacement: float | None = None
) -> Slope:
    """
    Fit the slope of load over displacement, with an offset of the load for each trial.

    :param group: points of one mode, pressure and length.
    :param tolerance: largest deviation of a cubic from the line, relative to the rise of the line
        [-].
    :param max_displacement: largest displacement of the linear range [m, rad]; None: the F test
        determines the linear range.
    """
    size = np.abs(group.displacements)
    if max_displacement is not None:
        inside = size <= max_displacement
        return _slope(group, inside, max_displacement)
    for limit in RANGES * size.max():
        # The largest displacement is inside its own range despite rounding.
        inside = size <= limit * (1.0 + 1e-12)
        if _is_linear(group, inside, tolerance):
            return _slope(group, inside, float(limit))
    reason = f'{group.name}: no linear range from a tenth of the largest displacement up'
    return _no_slope(group, reason)


def _slope(group: Group, inside: Flags, limit: float) -> Slope:
    used = inside & _spread(group, inside)
    unit = 'rad' if group.mode == 'rotary' else 'm'
    outside = f'{group.name}: beyond {limit:.4g} {unit}, out of the linear range'
    reasons = np.where(inside, np.where(used, '', LONE_DISPLACEMENT), outside)
    if not used.any():
        return _no_slope(
            group,
            f'{group.name}: no trial has two displacements in the linear range; a slope needs two',
        )
    stiffness, offsets = _fit(group, used, 1)[:2]
    if not 1.0 / MAX_MAGNITUDE <= stiffness <= MAX_MAGNITUDE:
        return _no_slope(
            group,
            f'{group.name}: slope {stiffness:.3g}: must be positive and that of a tube; '
            'displacement and load count in the same direction',
        )
    reasons = tuple(map(str, reasons))
    return Slope(group, stiffness, offsets[group.trials], limit, used, reasons)


def _no_slope(group: Group, reason: str) -> Slope:
    n = len(group.lines)
    return Slope(group, np.nan, np.zeros(n), 0.0, np.zeros(n, dtype=bool), (reason,) * n)


def _spread(group: Group, inside: Flags) -> Flags:
    """Return a mask (n,) of the points of trials with two or more displacements in the range."""
    count = group.trials.max() + 1
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, group.trials[inside], group.displacements[inside])
    np.maximum.at(high, group.trials[inside], group.displacements[inside])
    return (high > low)[group.trials]


def _is_linear(group: Group, inside: Flags, tolerance: float) -> bool:
    used = inside & _spread(group, inside)
    if not used.any():
        return True  # too few points for a slope as well
    slope, _, line_rest, line_freedom = _fit(group, used, 1)
    _, _, cubic_rest, freedom = _fit(group, used, 3)
    rise = abs(slope) * np.ptp(group.displacements[used])
    if freedom < 1 or np.abs(line_rest - cubic_rest).max() <= tolerance * rise:
        return True
    left = cubic_rest @ cubic_rest
    gain = line_rest @ line_rest - left
    extra = line_freedom - freedom
    if not (left > 0.0 and extra > 0):
        return False
    from scipy import special

    ratio = gain / extra / (left / freedom)
    return float(special.fdtrc(extra, freedom, ratio)) > SIGNIFICANCE


def _fit(group: Group, used: Flags, degree: int) -> tuple[float, Array, Array, int]:
    """
    Fit a polynomial in the displacement, with an offset for each trial.

    :return: slope at zero displacement; offsets (t,) of the trials, zero for a trial without used
        points; residuals of the used points; and number of degrees of freedom.
    """
    x, y, trials = group.displacements[used], group.loads[used], group.trials
    unit = np.abs(x).max()
    powers = (x / unit)[:, None] ** np.arange(1, degree + 1)
    matrix = np.hstack([powers, trials[used][:, None] == np.arange(trials.max() + 1)])
    solution, _, rank, _ = np.linalg.lstsq(matrix, y, rcond=None)
    with np.errstate(over='ignore'):
        slope = float(solution[0] / unit)
    return slope, solution[degree:], y - matrix @ solution, len(y) - int(rank)
