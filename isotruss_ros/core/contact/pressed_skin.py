# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contact forces on a tube's skin under an object at a given depth of the dent.

The skin of a straight tube is uniform along the tube, so without friction it slides under a corner
without a force: each point of the skin presses across the tube, and the forces follow from the
heights of the object's surface.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.qp import solve_complementarity
import numpy as np

#: Number of contact points on the chord along which the object overlaps the round tube [-].
CHORD_POINTS = 41
#: Spacing of the points on a corner's outline, and largest extent of the contact to each side of
#: the contact point, in tube radii [-].
OUTLINE_SPACING, MAX_EXTENT = 0.02, 4.0


class PressedSkin(NamedTuple):
    """
    Points of a tube's skin under an object, and the contact forces on them.

    Of several contacts, all values have the contacts as their first axis.
    """

    #: (c,) distances from the contact point along the tube, counter-clockwise [m]
    positions: Array
    spacing: float  #: distance between neighbouring points [m]
    heights: Array  #: (c,) heights of the object's surface above the contact point [m]
    forces: Array  #: (c,) contact forces, zero at points that the object does not touch [N]


def press_disc(kernel: Flattening, radius: float, depth: float) -> PressedSkin:
    """Return the pressed skin under a disc of a given radius at a given depth."""
    half_chord = np.sqrt(radius**2 - (radius - depth) ** 2)
    positions = half_chord * np.linspace(-1.0, 1.0, CHORD_POINTS)
    heights = radius - np.sqrt(radius**2 - positions**2)
    return _press(kernel, positions, heights, depth)


def _press(kernel: Flattening, positions: Array, heights: Array, depth: float) -> PressedSkin:
    """Return the pressed skin under an object with given surface heights, at a depth [m]."""
    count, spacing = len(positions), float(positions[1] - positions[0])
    compliance = kernel.compliance(np.arange(count), spacing)
    forces, _ = solve_complementarity(compliance, heights - depth)
    return PressedSkin(positions, spacing, heights, forces)


def find_profile(outline: Points, point: complex, normal: complex) -> tuple[Array, Array]:
    """Return positions along a tube from a contact point, and the surface's heights there [m]."""
    # Coordinates: the real part is along the normal, toward the tube, and the imaginary part along
    # the tube, counter-clockwise about the object.
    local = (outline - point) * normal.conjugate()
    start, end = int(local.imag.argmin()), int(local.imag.argmax())
    # The outline is counter-clockwise, so the side that faces the tube is from start to end.
    facing = np.roll(local, -start)[: (end - start) % len(local) + 1]
    positions, heights = facing.imag, np.maximum(-facing.real, 0.0)
    # The contact point, of height 0, may be between two points of the outline.
    index = int(np.searchsorted(positions, 0.0))
    return np.insert(positions, index, 0.0), np.insert(heights, index, 0.0)


def press_corner(
    kernel: Flattening, positions: Array, heights: Array, extents: Array, depth: float
) -> PressedSkin:
    """Return the pressed skin under a corner at a depth, within `extents` (2,) of it [m]."""
    indenting = np.flatnonzero(heights <= depth)
    # Points of the profile at the ends of the dent, each with its neighbour beyond the end.
    start = [indenting[0], max(indenting[0] - 1, 0)]
    end = [indenting[-1], min(indenting[-1] + 1, len(positions) - 1)]
    # Interpolated positions at which the height of the surface is the depth.
    low = max(np.interp(depth, heights[start], positions[start]), -extents[0])
    high = min(np.interp(depth, heights[end], positions[end]), extents[1])
    spacing = max(float(high - low), 1e-6) / CHORD_POINTS
    # Each point is in the middle of a piece of tube; the outer pieces end at `low` and `high`.
    middles = low + (np.arange(CHORD_POINTS) + 0.5) * spacing
    return _press(kernel, middles, np.interp(middles, positions, heights), depth)
