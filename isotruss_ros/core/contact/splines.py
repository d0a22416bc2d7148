# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Natural cubic splines of many dents at once."""

from __future__ import annotations

import functools

from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np


def fit_splines(abscissae: Array, values: Array) -> Array:
    """
    Return the numbers (s, q) of natural cubic splines through values (n,) or (s, n).

    The abscissae (s, n) begin with 0. The numbers are the abscissae of all points but the first,
    and then, for each of the n - 1 pieces, the coefficients of its polynomial and its first
    abscissa.
    """
    steps = np.diff(abscissae)
    slopes = np.diff(np.broadcast_to(values, abscissae.shape)) / steps
    inner = np.arange(abscissae.shape[1] - 2)
    matrix = np.zeros((len(abscissae), len(inner), len(inner)))
    matrix[:, inner, inner] = 2.0 * (steps[:, :-1] + steps[:, 1:])
    matrix[:, inner[:-1], inner[1:]] = matrix[:, inner[1:], inner[:-1]] = steps[:, 1:-1]
    bending = np.zeros(abscissae.shape)  # half of the second derivatives
    bending[:, 1:-1] = np.linalg.solve(matrix, 3.0 * np.diff(slopes)[..., None])[..., 0]
    before, after = bending[:, :-1], bending[:, 1:]
    pieces = [
        (after - before) / (3.0 * steps),
        before,
        slopes - steps * (2.0 * before + after) / 3.0,
        np.broadcast_to(values, abscissae.shape)[:, :-1],
        abscissae[:, :-1],
    ]
    flat = np.stack(pieces, axis=-1).reshape(len(abscissae), -1)
    return np.concatenate([abscissae[:, 1:], flat], axis=1)


def evaluate_splines(numbers: Array, x: Array, x_of_piece: Array) -> tuple[Array, Array]:
    """
    Return values and slopes (c, m) at x (c,), of m splines each, see `fit_splines`.

    The splines have the numbers (c, m, q). The values are those of the polynomial piece that
    contains `x_of_piece` (c,).
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
