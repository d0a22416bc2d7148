# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Displacements of cross sections inside straight beams.

The beams have the section stiffness EA, EI and GA (Timoshenko; with infinite GA, Euler-Bernoulli).
The displacements are exact.
"""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
import numpy as np

IDENTITY = np.eye(6)


class Beams:
    """
    Straight beams between fixed ends, computed by transfer matrices.

    The state of a section is z = (u, w, theta, N, V, M): displacements along and across the beam,
    rotation, axial force, shear force and bending moment. The state at a distance x follows from
    the state at the start by z(x) = exp(A x) z(0); loads are jumps of N, V and M (Pestel and
    Leckie, Matrix Methods in Elastomechanics, 1963).

    :ivar length: (k,) lengths [m].
    :ivar series: (k, 4, 6, 6) nonzero terms A^n / n! of exp(A x).
    :ivar by_ends: (k, 6, 6) matrix that converts (ux, uy, theta) of start and end to z at the
        start.
    :param length: (k,) lengths [m].
    :param axial: (k,) EA [N].
    :param flexural: (k,) EI [N m^2].
    :param shear: (k,) GA [N]; infinite for beams without shear deformation.
    :param pinned: (k,) whether the start transmits no moment.
    """

    def __init__(
        self, length: Array, axial: Array, flexural: Array, shear: Array, pinned: Flags
    ) -> None:
        self.length = length
        self.series = np.zeros((len(length), 4, 6, 6))
        unity, first = self.series[:, 0], self.series[:, 1]
        unity[:] = IDENTITY
        # u' = N / EA, w' = theta + V / GA, theta' = M / EI, M' = -V
        first[:, 0, 3], first[:, 1, 4], first[:, 2, 5] = 1.0 / axial, 1.0 / shear, 1.0 / flexural
        first[:, 1, 2], first[:, 5, 4] = 1.0, -1.0
        self.series[:, 2] = 0.5 * first @ first
        self.series[:, 3] = self.series[:, 2] @ first / 3.0
        ends = unity.copy()
        ends[:, 2, 2], ends[:, 2, 5] = ~pinned, pinned
        ends[:, 3:] = sum_series(self.series, length)[:, :3]
        self.by_ends = np.linalg.inv(ends)
        self.by_ends[pinned, :, 2] = 0.0

    def points(self, beam: Indices, place: Array) -> tuple[Array, Array]:
        """
        Return the shape functions and the compliance of points on the beams.

        :param beam: (c,) index of the beam of each point.
        :param place: (c,) distance of each point from the start of its beam [m].
        :return: (c, 3, 6) shape functions, which are the derivatives of a point's displacements
            along and across the beam and of the section's rotation with respect to (ux, uy, theta)
            at start and end; and (2, c, c) compliance of the points along and across beams with
            fixed ends [m/N], which is zero between points on different beams.
        """
        series = self.series
        shapes = sum_series((series[:, :, :3] @ self.by_ends[:, None])[beam], place)
        behind = sum_series(series[beam, :, :3, 3:5], self.length[beam] - place)
        # Without the jump a load moves the end, which is moved back; z jumps where it acts.
        apart, first = np.maximum(place[:, None] - place, 0.0), series[beam, 1]
        along = shapes[:, 0, 3:] @ behind[:, :, 0].T - apart * first[:, 0, 3]
        across = shapes[:, 1, 3:] @ behind[:, :, 1].T
        across -= apart * (first[:, 1, 4] - apart**2 / 6.0 * first[:, 2, 5])
        return shapes, np.stack([along, across]) * (beam[:, None] == beam)


def sum_series(terms: Array, distance: Array) -> Array:
    """
    Return the sum of terms times powers of a distance.

    :param terms: (k, 4, a, b) terms of `Beams.series`, possibly multiplied by matrices.
    :param distance: (k,) distances x [m].
    :return: (k, a, b) sums.
    """
    return np.einsum('kn,knab->kab', distance[:, None] ** np.arange(4), terms)
