# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Signed distance of two convex objects.

With the support functions h, it is the maximum of n . (c2 - c1) - h1(n) - h2(-n) over all unit
normals n from the first object to the second; negative values are depths of penetration. Each
normal gives a lower bound.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Points
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np

#: Normals among which the largest distance is searched, with shares of the range between the
#: neighbours of the best one, and number of searches [-]. For objects of 1 m, the normal is
#: accurate to 1e-7 rad, and the distance to rounding.
SHARES = np.linspace(-1.0, 1.0, 64)
DIRECTIONS, REFINEMENTS = np.exp(1j * np.pi * np.linspace(-1.0, 1.0, 64)), 5


class Separation(NamedTuple):
    """Signed distance of two objects, with the nearest points."""

    distance: float  #: distance of the surfaces, negative for an overlap [m]
    normal: complex  #: unit vector from the first object to the second, robot frame
    point: complex  #: nearest point of the second object, x + iy in the robot frame [m]


def separate(first: ConvexObject, second: ConvexObject) -> Separation:
    """Return the signed distance of two objects and its direction."""
    if second.shape.is_round:
        (gap,), (normal,) = first.nearest(np.array([second.center]))
        gap -= second.shape.reach
    elif first.shape.is_round:
        (gap,), (away,) = second.nearest(np.array([first.center]))
        gap, normal = gap - first.shape.reach, -away
    else:
        gap, normal = _maximize(first, second)
    point = _support_point(second, -normal)
    # On a face, the nearest point is opposite to the corner or arc of the first object.
    faces = face_normals(second.shape) * second.turn
    if (np.abs(faces + normal) < ROUNDING).any():
        point = _support_point(first, normal) + gap * normal
    return Separation(float(gap), complex(normal), point)


def _support_point(body: ConvexObject, normal: complex) -> complex:
    """Return the point of the surface with a normal, robot frame, x + iy [m]."""
    local = np.array([normal]) * body.turn.conjugate()
    return body.center + body.turn * complex(body.shape.support_points(local)[0])


def _maximize(first: ConvexObject, second: ConvexObject) -> tuple[float, complex]:
    """Return the largest distance of parallel tangents between two objects, and its normal."""
    faces = [first.turn * face_normals(first.shape), -second.turn * face_normals(second.shape)]
    normals = np.concatenate([*faces, DIRECTIONS])
    best, width = 0, np.pi
    for _ in range(REFINEMENTS):
        along = ((second.center - first.center) * normals.conj()).real
        distances = along - first.support(normals) - second.support(-normals)
        best = int(distances.argmax())
        distance, normal = float(distances[best]), complex(normals[best])
        # Normals between the neighbours of the best one; it comes first, so that it remains if
        # none is better.
        width *= 2.0 / (len(SHARES) - 1)
        normals = normal * np.exp(1j * width * np.append(0.0, SHARES))
    return distance, normal


@functools.lru_cache(maxsize=64)
def face_normals(shape: Shape) -> Points:
    """Return the outward unit normals (f,) of the faces of a shape; none for a smooth shape."""
    normals: list[complex] = []
    corner = first = shape.corner_at(1.0 + 0j)
    while faces := shape.faces_at(corner):
        following = faces[-1]
        normals.append(following.normal)
        corner = following.corner
        if corner == first:
            break
    return np.array(normals, dtype=np.complex128)
