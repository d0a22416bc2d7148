# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects as MuJoCo primitives, which touch the capsules of the tubes in the plane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.ellipse import Ellipse
from isotruss_ros.core.model.obstacle import HalfPlane, Obstacle
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.shapes import Disc
import numpy as np

#: Radius that replaces sharp corners [m], because capsules have no edges.
MIN_CORNER_RADIUS = 1e-3


def object_geoms(held: ConvexObject) -> list[dict[str, str]]:
    """
    Return the attributes of the geoms of an object in the frame of its body.

    A disc becomes a sphere, and an ellipse an ellipsoid. A polygon becomes a capsule along each
    side and a sphere at each corner.

    :param held: the object at its pose.
    :raises GraspError: MuJoCo has no geoms of its shape.
    """
    if type(held.shape) not in GEOMS:
        known = ', '.join(kind.__name__ for kind in GEOMS)
        raise GraspError(f'shape {held.shape!r}: must be one of {known} in MuJoCo')
    return GEOMS[type(held.shape)](held)


def obstacle_geoms(obstacle: Obstacle) -> list[dict[str, str]]:
    """
    Return the attributes of the geoms of an obstacle in the obstacle's frame.

    :raises GraspError: MuJoCo has no geoms of its shape.
    """
    if isinstance(obstacle.body.shape, HalfPlane):
        return [{'type': 'plane', 'zaxis': '1 0 0', 'size': '0 0 1'}]
    return object_geoms(ConvexObject(obstacle.body.shape))


def _disc_geoms(held: ConvexObject) -> list[dict[str, str]]:
    return [_sphere(0.0, held.shape.reach)]


def _ellipse_geoms(held: ConvexObject) -> list[dict[str, str]]:
    shape: Any = held.shape
    a, b = shape.semi_axes
    size = {'type': 'ellipsoid', 'size': f'{a:.9g} {b:.9g} {min(a, b):.9g}'}
    return [size | {'euler': f'0 0 {held.pose.angle:.12g}'}]


def _polygon_geoms(held: ConvexObject) -> list[dict[str, str]]:
    shape: Any = held.shape
    turn = held.turn
    blunt = replace(
        shape, corner_radius=tuple(np.maximum(shape.radii, MIN_CORNER_RADIUS).tolist())
    )
    centers, radii, normals = blunt.arc_centers, blunt.radii, blunt.normals
    radius = float(radii.min())
    begin = centers + (radii - radius) * normals
    end = np.roll(centers, -1) + (np.roll(radii, -1) - radius) * normals
    geoms = []
    for start, stop in zip(turn * begin, turn * end, strict=True):
        ends = f'{start.real:.9g} {start.imag:.9g} 0 {stop.real:.9g} {stop.imag:.9g} 0'
        geoms.append({'type': 'capsule', 'fromto': ends, 'size': f'{radius:.9g}'})
    rounded = [k for k in range(len(radii)) if radii[k] > radius]
    return geoms + [_sphere(turn * centers[k], float(radii[k])) for k in rounded]


def _sphere(center: complex, radius: float) -> dict[str, str]:
    place = f'{complex(center).real:.9g} {complex(center).imag:.9g} 0'
    return {'type': 'sphere', 'pos': place, 'size': f'{radius:.9g}'}


#: Functions that make the geoms, by class of the shape.
GEOMS: dict[type, Callable[[ConvexObject], list[dict[str, str]]]] = {
    Disc: _disc_geoms,
    Ellipse: _ellipse_geoms,
    Polygon: _polygon_geoms,
}
