# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flattened tubes and their pressed skin."""

from __future__ import annotations

import functools
from typing import NamedTuple

from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.qp import solve_complementarity
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.tube_stiffness import Fabric, tube_stiffness
import numpy as np

# Flattening: local compliance of the section of an inflated tube under contact.
#
# An inextensible wall of radius R under the gauge pressure p deforms under a line load in ring
# modes cos(n phi), n = 2, 3, ..., with the stiffness k_n = pi p (n^2 - 1) per unit length. The
# compliance of all modes is 3 / (4 pi p) for a load from one side, which the shear flow of the
# tube as a beam balances. It is 1 / (pi p) between two plates. Along the tube each mode is a
# string on an elastic foundation,
#
#     k_n w - G_n w'' = q,
#     G_n = pi p R^2 (1 + 1/n^2) / 2 + pi R G t f_n / n^2,
#     f_n = E t / (E t + G t n^2 lambda_n^2 / R^2),   lambda_n = sqrt(G_n / k_n),
#
# where w is the amplitude of the mode, q the load per length, and G_n is due to the wall tension p
# R / 2 and the shear of the fabric. The compliance of a mode at a distance s is exp(-s / lambda_n)
# / (2 sqrt(k_n G_n)). All but the first few modes decay so fast along the tube that they deform
# only the loaded section.


class Flattening:
    """
    Local compliance of a tube's sections under transverse forces from one side.

    Without fabric, f_n = 0. `local_stiffness` is the ratio of a tube's measured local stiffness to
    the theoretical one [-].

    :ivar stiffness: stiffness k_n of the modes n = 2, 3, ..., `modes` per length [N/m^2].
    :ivar tension: tension G_n of the modes [N].
    :ivar decay_length: length lambda_n of the modes [m].
    :ivar local_compliance: compliance for a line load of the modes n > `modes`, which are assumed
        not to spread along the tube [m^2/N].
    """

    def __init__(
        self,
        radius: float,
        pressure: complex,
        fabric: Fabric | None = None,
        modes: int = 8,
        local_stiffness: float = 1.0,
    ) -> None:
        self.radius, self.pressure = radius, pressure
        self._other_arguments = fabric, modes, local_stiffness
        n = np.arange(2, modes + 1)
        stiffness = np.pi * pressure * (n**2 - 1.0)
        # With f_n inserted, G_n = a + b / (1 + c G_n), where a is due to the wall tension and b to
        # the shear of the fabric: c G_n^2 + (1 - a c) G_n - (a + b) = 0.
        a = 0.5 * np.pi * pressure * radius**2 * (1.0 + 1.0 / n**2)
        wall_modulus, shear_modulus = fabric or Fabric(1.0, 0.0)
        b = np.pi * radius * shear_modulus / n**2
        c = shear_modulus * n**2 / (wall_modulus * stiffness * radius**2)
        # The positive solution, in a form that is also valid for c = 0.
        linear = 1.0 - a * c
        tension = 2.0 * (a + b) / (linear + np.sqrt(linear * linear + 4.0 * c * (a + b)))
        self.stiffness, self.tension = local_stiffness * stiffness, local_stiffness * tension
        self.decay_length = np.sqrt(self.tension / self.stiffness)
        # The sum of 1 / k_n over all n > modes.
        local_compliance = (1.0 / modes + 1.0 / (modes + 1)) / (2.0 * np.pi * pressure)
        self.local_compliance = local_compliance / local_stiffness

    def compliance(self, points: Indices, spacing: float) -> Array:
        """Return the compliances (c, c) of points at integer multiples of a spacing [m/N]."""
        distances = np.abs(points[:, None] - points)
        count = int(distances.max(initial=0)) + 1
        return self.compliance_column(count, np.array([spacing]))[0, distances]

    def compliance_column(self, count: int, spacing: Array) -> Array:
        """Return the compliances (s, c) at 0 to c - 1 spacings (s,) from a load [m/N]."""
        # Load and depth are averaged over pieces of tube that are one spacing long.
        ratio = spacing[:, None] / self.decay_length
        # Compliance of each mode for a concentrated load, at the load.
        peak = 0.5 / np.sqrt(self.stiffness * self.tension)
        # The average over two pieces at a distance of d spacings is exp(-d ratio) times
        # (2 sinh(ratio / 2) / ratio)^2, which is here without overflow exp(-(d - 1) ratio) times
        # ((1 - exp(-ratio)) / ratio)^2.
        averaged_peak = peak * (np.expm1(-ratio) / ratio) ** 2
        decays = np.exp(-ratio[:, :, None] * (np.arange(count) - 1.0))
        by_distance = (averaged_peak[:, None] @ decays)[:, 0]
        # The average within one piece.
        same_piece = peak * (2.0 / ratio) * (1.0 + np.expm1(-ratio) / ratio)
        by_distance[:, 0] = same_piece.sum(axis=1) + self.local_compliance / spacing
        return by_distance

    def compliance_rates(self, points: Indices, spacing: float) -> Array:
        """Return the derivatives (c, c) of `compliance` with respect to pressure [m/N/Pa]."""
        inflated = Flattening(self.radius, self.pressure + 1j * EPSILON, *self._other_arguments)
        return inflated.compliance(points, spacing).imag / EPSILON


@functools.lru_cache(maxsize=32)
def flattening_of(robot: Mechanism, pressure: float) -> Flattening:
    """Return the local compliance of a robot's tube under a gauge pressure [Pa], cached."""
    file = robot.description
    return Flattening(
        0.5 * file.tube_diameter,
        pressure,
        tube_stiffness(file).model.fabric,
        local_stiffness=file.local_stiffness,
    )


# Contact forces on a tube's skin under objects at given depths of their dents.
#
# The skin of a straight tube is uniform along the tube, so without friction it slides under a
# corner without a force: each point of the skin presses across the tube, and the forces follow
# from the heights of the object's surface.
#
# The forces solve a linear complementarity problem (LCP) for each depth. Its compliance is a
# symmetric Toeplitz matrix whose elements are convex in the distance, and the object is convex:
# between two loaded points the gap is convex and zero at both ends, so the loaded points have no
# hole. Block pivoting on the first and last loaded point thus needs systems of leading blocks of
# one matrix only, which one recursion of Durbin factorises.

#: Number of contact points on the chord along which the object overlaps the round tube [-].
CHORD_POINTS = 41
#: Spacing of the points on a corner's outline, and largest extent of the contact to each side of
#: the contact point, in tube radii [-].
OUTLINE_SPACING, MAX_EXTENT = 0.02, 4.0
#: Largest number of pivots; most problems need two or three [-].
MAX_PIVOTS = 20
#: Largest penetration of a point without force, relative to the largest depth [-].
GAP_TOLERANCE = 1e-12
#: Smallest length of a chord [m].
MIN_CHORD = 1e-6


class PressedSkin(NamedTuple):
    """Points of a tube's skin under s objects or depths, and the contact forces on them."""

    #: (s, c) distances from the contact point along the tube, counter-clockwise [m]
    positions: Array
    spacing: Array  #: (s,) distances between neighbouring points [m]
    heights: Array  #: (s, c) heights of the object's surface above the contact point [m]
    #: (s, c) contact forces, zero at points that the object does not touch [N]
    forces: Array


def find_disc_chords(radius: float, depths: Array) -> tuple[Array, Array]:
    """Return positions and surface heights (s, c) on the chords of a disc at depths (s,) [m]."""
    half_chords = np.sqrt(radius**2 - (radius - depths) ** 2)
    positions = half_chords[:, None] * np.linspace(-1.0, 1.0, CHORD_POINTS)
    return positions, radius - np.sqrt(radius**2 - positions**2)


def find_profile(outline: Points, point: complex, normal: complex) -> tuple[Array, Array]:
    """Return positions along a tube from a contact point, and the surface's heights there [m]."""
    # Coordinates: the real part is along the normal, toward the tube, and the imaginary part along
    # the tube, counter-clockwise about the object.
    local = (outline - point) * normal.conjugate()
    start, end = int(local.imag.argmin()), int(local.imag.argmax())
    # The outline is counter-clockwise, so the side that faces the tube is from start to end.
    facing = np.concatenate([local[start:], local[:start]])[: (end - start) % len(local) + 1]
    positions, heights = facing.imag, np.maximum(-facing.real, 0.0)
    # The contact point, of height 0, may be between two points of the outline.
    index, zero = int(positions.searchsorted(0.0)), [0.0]
    positions = np.concatenate([positions[:index], zero, positions[index:]])
    return positions, np.concatenate([heights[:index], zero, heights[index:]])


def find_corner_chords(
    profile: tuple[Array, Array], extents: Array, depths: Array
) -> tuple[Array, Array]:
    """Return positions and surface heights (s, c) within `extents` (2,) at depths (s,) [m]."""
    positions, heights = profile
    # Heights fall up to the contact point and then rise. Each end of a dent is interpolated
    # between the last point within the depth and its neighbour beyond.
    low, high = -extents[0], extents[1]
    is_within = heights <= depths[:, None]
    first, last = is_within.argmax(axis=1), len(heights) - 1 - is_within[:, ::-1].argmax(axis=1)
    ends = []
    for inner, outer in (
        (first, np.maximum(first - 1, 0)),
        (last, np.minimum(last + 1, len(heights) - 1)),
    ):
        rises = heights[outer] - heights[inner]
        shares = (depths - heights[inner]) / np.where(rises > 0.0, rises, np.inf)
        steps = np.clip(shares, 0.0, 1.0) * (positions[outer] - positions[inner])
        ends.append(np.clip(positions[inner] + steps, low, high))
    spacing = np.maximum(ends[1] - ends[0], MIN_CHORD) / CHORD_POINTS
    # Each point is in the middle of a piece of tube; the outer pieces end where the dent does.
    middles = ends[0][:, None] + (np.arange(CHORD_POINTS) + 0.5) * spacing[:, None]
    return middles, np.interp(middles.ravel(), positions, heights).reshape(middles.shape)


def press_skin(kernel: Flattening, positions: Array, heights: Array, depths: Array) -> PressedSkin:
    """Return the pressed skins under surfaces with given heights (s, c), at depths (s,) [m]."""
    spacing = positions[:, 1] - positions[:, 0]
    columns = kernel.compliance_column(CHORD_POINTS, np.maximum(spacing, MIN_CHORD / CHORD_POINTS))
    gaps = heights - depths[:, None]
    forces, is_solved = solve_convex_contacts(columns, gaps)
    distances = np.abs(np.arange(CHORD_POINTS)[:, None] - np.arange(CHORD_POINTS))
    for i in np.flatnonzero(~is_solved).tolist():
        forces[i], _ = solve_complementarity(columns[i, distances], gaps[i])
    return PressedSkin(positions, spacing, heights, forces)


def solve_convex_contacts(columns: Array, gaps: Array) -> tuple[Array, Flags]:
    """
    Solve LCPs (s,) of convex gaps (s, c) by block pivoting on the ends of the loaded interval.

    `columns` (s, c) are the first columns of the compliances. The result is the forces (s, c), and
    whether each problem was solved (s,).
    """
    count = gaps.shape[1]
    # The samples are the last axis, along which operations are contiguous.
    columns, gaps, number = columns.T, gaps.T, np.arange(count)[:, None]
    inverse, pivots = _factorize_toeplitz(columns)
    mirrored = np.concatenate([columns[:0:-1], columns])
    along, across = mirrored.strides
    compliance = np.lib.stride_tricks.as_strided(
        mirrored[-count:], (count, *gaps.shape), (-along, along, across), writeable=False
    )
    tolerance = GAP_TOLERANCE * np.abs(gaps).max(axis=0)
    is_loaded = gaps < 0.0
    for _ in range(MAX_PIVOTS):
        first = is_loaded.argmax(axis=0)
        size = np.where(is_loaded.any(axis=0), count - is_loaded[::-1].argmax(axis=0) - first, 0)
        # A block of a Toeplitz matrix is the leading block of its size.
        right = np.take_along_axis(-gaps, np.minimum(number + first, count - 1), axis=0)
        transformed = np.einsum('ijs,js->is', inverse, right) / pivots
        transformed[number >= size] = 0.0
        block_forces = np.einsum('ijs,is->js', inverse, transformed)
        is_inside = (number >= first) & (number < first + size)
        forces = np.take_along_axis(block_forces, np.maximum(number - first, 0), axis=0)
        forces[~is_inside] = 0.0
        remaining = gaps + np.einsum('ijs,js->is', compliance, forces)
        is_loaded = np.where(is_inside, forces > 0.0, remaining < -tolerance)
        is_solved = (is_loaded == is_inside).all(axis=0)
        if is_solved.all():
            break
    return forces.T, is_solved


def _factorize_toeplitz(columns: Array) -> tuple[Array, Array]:
    """
    Return the inverse (c, c, s) of the unit triangular factor L, and pivots D, of T = L D L^T.

    They are computed from the first columns (c, s) of T by Durbin's recursion (Golub and Van Loan,
    Matrix Computations, section 4.7).
    """
    inverse, pivots = np.zeros((len(columns), *columns.shape)), np.empty_like(columns)
    inverse[0, 0], pivots[0] = 1.0, columns[0]
    for i in range(1, len(columns)):
        last = inverse[i - 1, :i]
        reflection = -np.einsum('js,js->s', last, columns[1:][:i]) / pivots[i - 1]
        inverse[i, 1:][:i] = last
        inverse[i, :i] += reflection * last[::-1]
        pivots[i] = pivots[i - 1] * (1.0 - reflection * reflection)
    return inverse, pivots
