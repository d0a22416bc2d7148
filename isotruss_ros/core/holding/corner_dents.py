# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How deep a tube's skin dents under the part of an object that presses on it at one contact.

As in `indentation` the centre line stands still. Each point of the skin presses across the tube,
as in `sliding_contact`, so that the heights of the object's surface above its lowest point settle
how far the dent goes: a sharp corner dents the skin deeply, a face that lies on it hardly.
"""

from __future__ import annotations

import functools

from isotruss_ros.core.contact.flattening import Flattening, flattening_of
from isotruss_ros.core.holding.indentation import Press, press_on_skin, SkinIndentation
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Depths of the table as shares of the tube's radius, and points of the skin within the overlap.
DEPTHS = 0.8 * np.linspace(0.0, 1.0, 10)[1:] ** 2
POINTS = 41
#: Tables are made for normals in steps of this [rad], of outlines with points so far apart [m].
ANGLE_STEP, OUTLINE = 0.01, 1e-3
#: Beyond this many tube radii from the contact nothing is counted as part of it.
REACH = 4.0


def corner_dents(
    robot: Mechanism,
    tube: int,
    shape: Shape,
    normal: complex,
    corner: int,
    cuts: tuple[float, float],
    pressures: tuple[float, ...] | None = None,
) -> SkinIndentation:
    """
    Return the dents under one contact of an object; tables of the last contacts are kept.

    :param robot: the robot.
    :param tube: number of the tube.
    :param shape: of the object.
    :param normal: unit vector out of the object across the tube, in the object's frame.
    :param corner: number of the corner that is touched, see `Shape.corners_at`.
    :param cuts: how far the contact reaches before and behind the point that is touched,
        counter-clockwise around the object: half of a face where its other end is a contact of
        its own; may be infinite [m].
    :param pressures: (t,) gauge, by tube [Pa]; those of the robot file if None.
    """
    angle = ANGLE_STEP * round(float(np.angle(normal)) / ANGLE_STEP)
    return _table(robot, tube, shape, angle, corner, cuts, pressures)


@functools.lru_cache(maxsize=256)
def _table(
    robot: Mechanism,
    tube: int,
    shape: Shape,
    angle: float,
    corner: int,
    cuts: tuple[float, float],
    pressures: tuple[float, ...] | None,
) -> SkinIndentation:
    """Return what `corner_dents` does."""
    radius = 0.5 * robot.description.tube_diameter
    point = shape.point_at(corner, complex(np.exp(1j * angle)))
    places, heights = _profile(shape, angle, point)
    reach = np.minimum(cuts, REACH * radius)
    depths = DEPTHS * radius
    kernel = flattening_of(robot, pressures)
    presses = [_press(kernel, tube, places, heights, reach, depth) for depth in depths]
    return SkinIndentation(depths, presses, kernel, tube)


def _profile(shape: Shape, angle: float, point: complex) -> tuple[Array, Array]:
    """
    Return places along a tube and heights of the surface above a point of it, (p,) each [m].

    Places rise counter-clockwise around the object.
    """
    inward = -np.exp(1j * angle)
    seen = (shape.outline(OUTLINE) - point) * inward.conjugate()
    # Along the tube counter-clockwise, and into the object.
    along, height = -seen.imag, seen.real
    first, last = int(along.argmin()), int(along.argmax())
    count = (last - first) % len(along)
    chain = (first + np.arange(count + 1)) % len(along)
    places, found = along[chain], np.maximum(height[chain], 0.0)
    # The point itself may be between two of the outline.
    place = int(np.searchsorted(places, 0.0))
    return np.insert(places, place, 0.0), np.insert(found, place, 0.0)


def _press(
    kernel: Flattening, tube: int, places: Array, heights: Array, reach: Array, depth: float
) -> Press:
    """Return how a surface presses on a tube that it dents this deep."""
    low = np.flatnonzero(heights <= depth)
    first, last = max(low[0] - 1, 0), min(low[-1] + 1, len(places) - 1)
    begin = _crossing(places, heights, first, low[0], depth)
    end = _crossing(places, heights, last, low[-1], depth)
    begin, end = max(begin, -float(reach[0])), min(end, float(reach[1]))
    spacing = max(end - begin, 1e-6) / POINTS
    # Points in the middle of pieces, so that these end where the contact may.
    gaps = np.interp(begin + (np.arange(POINTS) + 0.5) * spacing, places, heights) - depth
    return press_on_skin(kernel, tube, spacing, gaps)


def _crossing(places: Array, heights: Array, outside: int, inside: int, depth: float) -> float:
    """Return where the surface is as high as a depth, between two points of it [m]."""
    rise = float(heights[outside] - heights[inside])
    if rise <= 0.0:
        return float(places[inside])
    share = (depth - float(heights[inside])) / rise
    return float(places[inside] + share * (places[outside] - places[inside]))
