# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Triangle meshes of tubes along their centre lines, and tube colours that show utilisation."""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: Number of corners of a cross section [-].
CORNERS = 12
#: Thickness of a pinched end and length of its taper, in tube diameters [-].
PINCH, TAPER = 0.15, 0.8
#: Utilisations [-] of the colours blue (no load), grey, orange (close to wrinkling) and red
#: (wrinkled).
UTILISATION_LEVELS = np.array([0.0, 0.4, 0.8, 1.0])
COLORS = np.array([[111, 159, 200], [196, 196, 196], [242, 153, 0], [217, 26, 26]])


def tube_vertices(line: Points, diameter: float, samples: int) -> Array:
    """
    Return the vertices (samples * CORNERS, 3) of a tube with pinched ends [m].

    :param line: (s,) points of the centre line, x + iy [m].
    :param diameter: diameter of the tube [m].
    """
    along = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(line)))])
    length = along[-1]
    taper = min(TAPER * diameter, 0.5 * length)
    ends = taper * np.linspace(0.0, 1.0, 5)[:-1]
    middle = np.linspace(taper, length - taper, samples - 2 * len(ends))
    part = np.concatenate([ends, middle, length - ends[::-1]])
    centers = np.interp(part, along, line.real) + 1j * np.interp(part, along, line.imag)
    tangents = np.gradient(centers)
    sides = 1j * tangents / np.abs(tangents)
    near = np.minimum(part, length - part) / taper
    # Quarter of an ellipse, the profile of a pinched tube.
    shape = PINCH + (1.0 - PINCH) * np.sqrt(1.0 - (1.0 - np.minimum(near, 1.0)) ** 2)
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    radius = 0.5 * diameter * shape[:, None]
    around = centers[:, None] + sides[:, None] * radius * np.cos(angle)
    height = radius * np.sin(angle)
    return np.stack([around.real, around.imag, height], axis=-1).reshape(-1, 3)


def tube_faces(samples: int) -> Indices:
    """Return the triangles (f, 3) of a tube, as indices of the vertices of `tube_vertices`."""
    ring, corner = np.meshgrid(np.arange(samples - 1), np.arange(CORNERS), indexing='ij')
    first, after = ring * CORNERS + corner, ring * CORNERS + (corner + 1) % CORNERS
    quads = np.stack([first, after, after + CORNERS, first + CORNERS], axis=-1).reshape(-1, 4)
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def prism(outline: Points, height: float) -> tuple[Array, Indices]:
    """
    Return the vertices (2 k, 3) and triangles (f, 3) of an upright prism.

    :param outline: (k,) convex cross section around the origin, counter-clockwise, x + iy [m].
    :param height: height of the prism, whose lower half is below the plane [m].
    """
    count = len(outline)
    here = np.arange(count)
    after = np.roll(here, -1)
    vertices = [
        np.column_stack([outline.real, outline.imag, np.full(count, z)])
        for z in (0.5 * height, -0.5 * height)
    ]
    fan = np.column_stack([np.zeros(count - 2, dtype=int), here[1:-1], here[2:]])
    sides = [[here, here + count, after], [after, here + count, after + count]]
    faces = [fan, fan[:, ::-1] + count, *(np.column_stack(side) for side in sides)]
    return np.concatenate(vertices), np.concatenate(faces)


def color_of(utilisation: float) -> tuple[int, int, int]:
    """
    Return the colour (r, g, b), 0 to 255, of a tube for its utilisation.

    :param utilisation: ratio of the largest bending moment to the wrinkling moment [-].
    """
    red, green, blue = (
        int(np.interp(utilisation, UTILISATION_LEVELS, channel)) for channel in COLORS.T
    )
    return red, green, blue
