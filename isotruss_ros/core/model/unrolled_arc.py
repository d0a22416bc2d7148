# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Arc lengths of convex shapes by the direction of their normals: how far they have rolled.

A shape that rolls on a straight member is touched where its normal points at the member. Turning
unrolls the arc between the points that are touched, and a face at once, as it comes to lie on it.
Angles are not wrapped: a whole turn unrolls the perimeter.
"""

from __future__ import annotations

import functools

from isotruss_ros.core.model.ellipse import Ellipse
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.shapes import Disc, Shape
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np
import scipy


def unrolled_arc(shape: Shape, angles: Array, corners: Indices) -> Array:
    """
    Return the arcs from some point of the surface to those with given normals, (k,) [m].

    :param shape: a `Disc`, an `Ellipse` or a `Polygon`.
    :param angles: (k,) of the outward normals in the shape's frame, not wrapped [rad].
    :param corners: (k,) numbers of the corners of a polygon that are touched; else not used.
    """
    if isinstance(shape, Polygon):
        return _polygon_arc(shape, angles, corners)
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        # The parameter of the point: its normal is along (cos t / a, sin t / b).
        parameter = np.angle(a * np.cos(angles) + 1j * b * np.sin(angles))
        parameter += 2.0 * np.pi * np.round((angles - parameter) / (2.0 * np.pi))
        return np.asarray(b * scipy.special.ellipeinc(parameter, 1.0 - (a / b) ** 2))
    assert isinstance(shape, Disc)
    return 0.5 * shape.diameter * angles


def _polygon_arc(polygon: Polygon, angles: Array, corners: Indices) -> Array:
    """Return the arcs to points of the arcs at corners, whole turns included."""
    middles, starts = _corner_arcs(polygon)
    middle = middles[corners]
    turns = np.round((angles - middle) / (2.0 * np.pi))
    within = angles - 2.0 * np.pi * turns - middle
    return starts[corners] + polygon.radii[corners] * within + polygon.perimeter * turns


@functools.lru_cache(maxsize=64)
def _corner_arcs(polygon: Polygon) -> tuple[Array, Array]:
    """Return the angles of the normals in the middle of the corners, and the arcs to there."""
    turns, along = polygon.turns, 1j * polygon.normals
    middles = np.angle(polygon.normals[0]) - 0.5 * turns[0]
    middles = middles + np.append(0.0, np.cumsum(0.5 * (turns[1:] + turns[:-1])))
    ahead = np.roll(polygon.arc_centers, -1) - polygon.arc_centers
    flats = (along.conj() * ahead).real
    halves = 0.5 * polygon.radii * turns
    steps = halves[:-1] + flats[:-1] + halves[1:]
    return middles, np.append(0.0, np.cumsum(steps))
