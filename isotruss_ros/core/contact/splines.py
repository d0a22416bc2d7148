# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Natural cubic splines, evaluated for many dents at once."""

from __future__ import annotations

import functools

from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np
import scipy


class Spline:
    """Natural cubic spline through n points, linear beyond the last; the first abscissa is 0."""

    def __init__(self, abscissae: Array, values: Array) -> None:
        pieces = scipy.interpolate.CubicSpline(abscissae, values, bc_type='natural').c.T
        #: abscissae of all points but the first, and then, for each of the n - 1 pieces, the
        #: coefficients of its polynomial and its first abscissa
        self.numbers = np.append(abscissae[1:], np.column_stack([pieces, abscissae[:-1]]))

    def __call__(self, x: float, x_of_piece: float) -> float:
        """Return the value at x, see `evaluate_splines`."""
        at = np.array([x]), np.array([x_of_piece])
        return evaluate_splines(self.numbers[None, None], *at)[0].item()


def evaluate_splines(numbers: Array, x: Array, x_of_piece: Array) -> tuple[Array, Array]:
    """
    Return values and slopes (c, m) at x (c,), of m splines each with `Spline.numbers` (c, m, q).

    They are those of the polynomial piece that contains `x_of_piece` (c,).
    """
    count, x, x_of_piece = numbers.shape[-1] // 6, x[:, None], x_of_piece[:, None]
    ends = numbers[..., count - 1]
    piece = (numbers[..., : count - 1] <= x_of_piece[..., None]).sum(axis=-1)
    a, b, c, d, begin = numbers.take(_places_of_first_piece(*numbers.shape) + 5 * piece)
    inside = np.where(x_of_piece < ends, x, ends)
    s = inside - begin
    slope = (3.0 * a * s + 2.0 * b) * s + c
    return ((a * s + b) * s + c) * s + d + slope * (x - inside), slope


@functools.lru_cache(maxsize=64)
def _places_of_first_piece(count: int, splines: int, size: int) -> Indices:
    """Return the places (5, c, m) of the numbers of the first pieces of (c, m, q), cached."""
    begins = size // 6 + size * np.arange(count * splines).reshape(count, splines)
    return begins + np.arange(5)[:, None, None]
