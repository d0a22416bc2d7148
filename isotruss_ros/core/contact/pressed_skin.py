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
    """Points of a tube's skin under an object, and the contact forces on them."""

    #: (c,) distances from the contact point along the tube, counter-clockwise [m]
    positions: Array
    spacing: float  #: distance between neighbouring points [m]
    heights: Array  #: (c,) heights of the object's surface above the contact point [m]
    forces: Array  #: (c,) contact forces, zero at points that the object does not touch [N]


def press_disc(kernel: Flattening, radius: float, depth: float) -> PressedSkin:
    """Return the skin under a disc at a given depth."""
    half = np.sqrt(radius**2 - (radius - depth) ** 2)
    positions = half * np.linspace(-1.0, 1.0, CHORD_POINTS)
    heights = radius - np.sqrt(radius**2 - positions**2)
    return _press(kernel, positions, heights, depth)


def _press(kernel: Flattening, positions: Array, heights: Array, depth: float) -> PressedSkin:
    """Return the skin whose contact forces close the gaps under an object at a given depth."""
    count, spacing = len(positions), float(positions[1] - positions[0])
    dents = kernel.compliance(np.arange(count), spacing)
    forces, _ = solve_complementarity(dents, heights - depth)
    return PressedSkin(positions, spacing, heights, forces)


def find_profile(outline: Points, point: complex, normal: complex) -> tuple[Array, Array]:
    """Return positions along a tube, counter-clockwise, and the surface's heights there [m]."""
    local = (outline - point) * -normal.conjugate()
    # Positions along the tube, counter-clockwise, and heights into the object.
    along, height = -local.imag, local.real
    start, end = int(along.argmin()), int(along.argmax())
    facing = (start + np.arange((end - start) % len(along) + 1)) % len(along)
    positions, heights = along[facing], np.maximum(height[facing], 0.0)
    # The contact point may be between two points of the outline.
    number = int(np.searchsorted(positions, 0.0))
    return np.insert(positions, number, 0.0), np.insert(heights, number, 0.0)


def press_corner(
    kernel: Flattening, positions: Array, heights: Array, reach: Array, depth: float
) -> PressedSkin:
    """Return the skin under a corner at a given depth."""
    dented = np.flatnonzero(heights <= depth)
    before, after = max(dented[0] - 1, 0), min(dented[-1] + 1, len(positions) - 1)
    # Interpolated positions at which the height of the surface is the depth.
    edges = [
        float(np.interp(depth, heights[pair], positions[pair]))
        for pair in ([dented[0], before], [dented[-1], after])
    ]
    begin, end = max(edges[0], -float(reach[0])), min(edges[1], float(reach[1]))
    spacing = max(end - begin, 1e-6) / CHORD_POINTS
    # Each point is in the middle of a piece of tube; the outer pieces end at `begin` and `end`.
    middles = begin + (np.arange(CHORD_POINTS) + 0.5) * spacing
    return _press(kernel, middles, np.interp(middles, positions, heights), depth)
