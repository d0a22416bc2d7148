# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Least-squares fit of k = C p^a L^b to the logarithms of the stiffnesses of one mode."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.model.stiffness_law import Law
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Largest difference between logarithms that is attributed to rounding [-].
VARIATION_TOLERANCE = 1e-12


@dataclass(frozen=True)
class FittedLaw:
    """Fitted power law of a stiffness, with confidence intervals."""

    law: Law  #: the law k = C p^a L^b in SI units
    low: Law  #: lower end of the confidence interval of each of C, a and b
    high: Law  #: upper ends of the confidence intervals
    r_squared: float  #: coefficient of determination of ln k; NaN if k is constant
    misfit: float  #: root mean square of ln(measured / fitted stiffness)


def half_widths(matrix: Array, rest: Array) -> Array:
    """
    Return the half widths (k,) of the 95 % confidence intervals of least-squares estimates.

    :param matrix: (n, k) Jacobian at the least-squares solution.
    :param rest: (n,) residuals.
    """
    from scipy import special

    freedom = len(rest) - matrix.shape[1]
    # pinv pinv^T is (X^T X)^-1 without squaring the condition of X.
    error = np.sqrt((np.linalg.pinv(matrix) ** 2).sum(axis=1) * (rest @ rest) / freedom)
    return special.stdtrit(freedom, 0.975) * error


def fit_law(pressures: Array, lengths: Array, stiffnesses: Array) -> FittedLaw:
    """
    Fit a power law to stiffnesses of one mode with equal weights.

    :param pressures: (n,) gauge pressures [Pa].
    :param lengths: (n,) lengths [m].
    :param stiffnesses: (n,) stiffnesses [N/m] or [N m/rad].
    :raises MeasurementError: the points do not determine the exponents; the message names missing
        points.
    """
    n = len(stiffnesses)
    logs = np.column_stack([np.log(pressures), np.log(lengths)])
    missing = _missing(np.unique(pressures), np.unique(lengths), logs, n)
    if missing:
        raise MeasurementError('; '.join(missing))
    target = np.log(stiffnesses)
    matrix = np.column_stack([np.ones(n), logs])
    solution, *_ = np.linalg.lstsq(matrix, target, rcond=None)
    rest = target - matrix @ solution
    reach = half_widths(matrix, rest)
    spread = target - target.mean()
    total = spread @ spread
    return FittedLaw(
        _law(solution),
        _law(solution - reach),
        _law(solution + reach),
        float(1.0 - rest @ rest / total) if total > n * VARIATION_TOLERANCE**2 else np.nan,
        float(np.sqrt(np.mean(rest**2))),
    )


def _law(logarithmic: Array) -> Law:
    with np.errstate(over='ignore', under='ignore'):
        return Law(float(np.exp(logarithmic[0])), float(logarithmic[1]), float(logarithmic[2]))


def _missing(pressures: Array, lengths: Array, logs: Array, n: int) -> list[str]:
    """Return sentences with the additional measurements that a fit needs."""
    missing = []
    for name, symbol, values, unit in (
        ('pressure', 'a', pressures, 'Pa'),
        ('length', 'b', lengths, 'm'),
    ):
        if len(values) < 2:
            found = f'only {values[0]:g} {unit}' if len(values) else 'none'
            missing.append(f'exponent {symbol} needs points at two or more {name}s, found {found}')
    if missing:
        return missing
    if np.linalg.matrix_rank(logs - logs.mean(axis=0), tol=1e-9) < 2:
        missing.append(
            'a and b cannot be distinguished, because pressure and length change together; '
            'measure another length at one of the pressures'
        )
    elif n < 4:
        missing.append(
            f'{n} pairs of pressure and length cannot check a fit of three constants; '
            'measure four or more'
        )
    return missing
