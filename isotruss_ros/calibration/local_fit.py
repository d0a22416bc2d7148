# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fit of the local stiffness of a tube to tests in which a cylinder is pressed into the tube.

The constants of the beam are known from the fit to the other modes. The only unknown is a factor
on the local stiffness of the module `flattening`, which is equal for all pressures, cylinders and
depths.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools

from isotruss_ros.calibration.measurements import MeasurementError, Presses
from isotruss_ros.calibration.pressed_tube import ClampedTube, press
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.tube_stiffness import InflatableBeam
import numpy as np

#: Largest factor, in either direction, between the local stiffness and its theoretical value in
#: the search [-].
SEARCH_FACTOR = 100.0
#: Rounding tolerances of the logarithm of the factor, and of the logarithm of the load [-].
TOLERANCE, LOAD_TOLERANCE = 1e-8, 1e-9
#: Numerical tolerance of the logarithms of the confidence limits [-].
LIMIT_TOLERANCE = 1e-4
#: Smallest relative change of a load due to a change of the factor by 10 %, at which the load
#: determines the factor [-].
MIN_LOAD_CHANGE = 1e-3


@dataclass(frozen=True)
class FittedLocalStiffness:
    """Fitted ratio of the local stiffness to its theoretical value, with confidence interval."""

    value: float  #: ratio to the theoretical stiffness [-]
    #: lower end of the 95 % confidence interval, from the profile of the sum of squares
    low: float
    high: float  #: upper end of the 95 % confidence interval
    misfit: float  #: root mean square of ln(measured / fitted load)
    count: int  #: number of points


def fit_local_stiffness(presses: Presses, beam: InflatableBeam) -> FittedLocalStiffness:
    """
    Fit the ratio of the local stiffness to its theoretical value.

    :param presses: measured points of tests in which a cylinder is pressed into the middle of a
        clamped tube.
    :param beam: model of the tube as a beam.
    :raises MeasurementError: the points do not determine the ratio, or the tube has wrinkled.
    """
    target = np.log(presses.loads)
    count = len(target)
    if count < 3:
        raise MeasurementError(f'{count} points of interference: must be three or more')
    # Moments of a clamped tube: F L / 8 at both ends and in the middle; wrinkling at p pi R^3 / 2.
    bearable = 4.0 * np.pi * beam.radius**3 * presses.pressures / presses.lengths
    wrinkled = np.flatnonzero(presses.loads > bearable)
    if len(wrinkled):
        row = wrinkled[0]
        raise MeasurementError(
            f'the tube wrinkled at {len(wrinkled)} of {count} points of interference, outside of '
            f'the model; the first: {presses.loads[row]:.3g} N at {presses.pressures[row]:.5g} Pa '
            f'on {presses.lengths[row]:.3g} m, which wrinkles at {bearable[row]:.3g} N. Omit them'
        )

    @functools.cache
    def misfit(log_factor: float) -> float:
        """Return the sum of squares of ln(measured / fitted load)."""
        away = np.log(_loads(presses, beam, float(np.exp(log_factor)))) - target
        return float(away @ away)

    from scipy import optimize, special

    ends = (-np.log(SEARCH_FACTOR), np.log(SEARCH_FACTOR))
    found = optimize.minimize_scalar(
        misfit, bounds=ends, method='bounded', options={'xatol': TOLERANCE}
    )
    best, least = float(found.x), float(found.fun)
    change = np.log(
        _loads(presses, beam, 1.1 * np.exp(best)) / _loads(presses, beam, np.exp(best))
    )
    if float(np.sqrt(np.mean(change**2))) < MIN_LOAD_CHANGE:
        raise MeasurementError(
            'the loads do not depend on the local stiffness: the tube bends and does not flatten; '
            'press a shorter piece, or narrower cylinders'
        )
    # Profile likelihood interval: outside, the sum of squares exceeds the minimum by over `share`.
    share = special.stdtrit(count - 1, 0.975) ** 2 / (count - 1)
    bound = (1.0 + share) * least + count * LOAD_TOLERANCE**2
    low, high = (
        optimize.brentq(
            lambda log_factor: misfit(log_factor) - bound,
            best,
            end,
            xtol=LIMIT_TOLERANCE,
        )
        if misfit(end) > bound
        else end
        for end in ends
    )
    value, lower, upper = (float(np.exp(log_factor)) for log_factor in (best, low, high))
    return FittedLocalStiffness(value, lower, upper, float(np.sqrt(least / count)), count)


def _loads(presses: Presses, beam: InflatableBeam, factor: float) -> Array:
    """Return the loads (n,) that the model predicts at the measured points [N]."""
    return np.array(
        [
            depth
            * press(
                ClampedTube(beam, beam.radius, length, factor),
                pressure,
                0.5 * length,
                cylinder,
                depth,
            ).stiffness
            for pressure, length, cylinder, depth in zip(
                presses.pressures, presses.lengths, presses.cylinders, presses.depths, strict=True
            )
        ]
    )
