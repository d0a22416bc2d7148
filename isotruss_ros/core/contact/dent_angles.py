# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Interpolation of the depths of dents between the angles of the object's normal.

The polynomials have continuous second derivatives.
"""

from __future__ import annotations

import math

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np

#: Largest step of the angles of normals for which depths are sampled; a divisor of 15 degrees, so
#: that turned and mirrored objects have the same samples [rad]. Between them the depths are
#: interpolated: depths err by up to 1 %, at a third of the step by 0.3 %, and at three times the
#: step by 30 %, all of them where a face is within 0.05 rad of the tube.
ANGLE_STEP = math.radians(15.0) / 16
#: Quintic polynomials by which four samples are interpolated, with the first and second central
#: differences at both middle ones: for each sample, the coefficients of the powers.
WEIGHTS = 0.5 * np.array(
    [
        [0.0, -1.0, 1.0, 3.0, -5.0, 2.0],
        [2.0, 0.0, -2.0, -9.0, 15.0, -6.0],
        [0.0, 1.0, 1.0, 9.0, -15.0, 6.0],
        [0.0, 0.0, 0.0, -3.0, 5.0, -2.0],
    ]
)
EXPONENTS = np.arange(6.0)
#: Coefficients of their derivatives.
SLOPE_WEIGHTS = np.pad(EXPONENTS[1:] * WEIGHTS[:, 1:], ((0, 0), (0, 1)))


def weigh_samples(angles: Array, piece_angles: Array, of_tables: Array) -> tuple[Indices, Array]:
    """
    Return numbers (c,) of samples, and weights of four samples near each.

    The weights (2, c, 4) are those at given angles, and their derivatives by the angles. The rows
    (3, c) are `DentTable.angles`, all of corners or all of smooth surfaces.
    """
    # The polynomial interpolates the two samples before and the two after its own angle; the
    # second of the four has the number `base`. It is evaluated at `angles`, which may differ.
    last, is_corner = of_tables[2], bool(of_tables[2, 0])
    numbers, rates = _fractional_numbers(piece_angles, 0.0, of_tables)
    bases = np.floor(numbers)
    if is_corner:
        bases = np.minimum(bases, last - 1.0)
    if piece_angles is not angles:
        numbers, rates = _fractional_numbers(angles, bases, of_tables)
    # The base of the powers is 0 at the second sample, 1 at the third.
    powers = (numbers - bases)[:, None] ** EXPONENTS
    weights = np.empty((2, len(angles), 4))
    np.matmul(powers, WEIGHTS.T, out=weights[0])
    np.matmul(powers, SLOPE_WEIGHTS.T, out=weights[1])
    weights[1] *= rates[:, None]
    if is_corner:
        # Instead of a sample beyond a face, its depth d is extrapolated by a parabola through the
        # other three: d_0 = 3 d_1 - 3 d_2 + d_3.
        at_start, at_end = np.flatnonzero(bases == -last), np.flatnonzero(bases == last - 1.0)
        if at_start.size:
            weights[:, at_start, 1:] += weights[:, at_start, :1] * np.array([3.0, -3.0, 1.0])
            weights[:, at_start, 0] = 0.0
        if at_end.size:
            weights[:, at_end, :-1] += weights[:, at_end, -1:] * np.array([1.0, -3.0, 3.0])
            weights[:, at_end, -1] = 0.0
    return bases.astype(int), weights


def _fractional_numbers(
    angles: Array, turn_of: Array | float, of_tables: Array
) -> tuple[Array, Array]:
    """Return angles (c,) as fractional sample numbers in the turns of samples, and derivatives."""
    middle, half_turn, last = of_tables
    if not last[0]:
        difference = _wrapped(angles - ANGLE_STEP * turn_of)
        return turn_of + difference / ANGLE_STEP, np.full(len(angles), 1.0 / ANGLE_STEP)
    # Near the normal of a face the depth is almost linear in the root of the angle from it, so the
    # samples are at equal steps of the arc sine. Beyond the face it is constant, and also within
    # rounding of its normal, where the derivative would have any size.
    sines = _wrapped(angles - middle) / half_turn
    sines = np.minimum(np.maximum(sines * (1.0 + ROUNDING), -1.0), 1.0)
    step, cosines = 0.5 * math.pi / last, np.sqrt(1.0 - sines * sines)
    slopes = 1.0 / (half_turn * step * np.where(cosines > 0.0, cosines, np.inf))
    return np.arcsin(sines) / step, slopes


def _wrapped(angles: Array) -> Array:
    """Return angles within half a turn [rad]."""
    return angles - 2.0 * math.pi * np.round(angles / (2.0 * math.pi))
