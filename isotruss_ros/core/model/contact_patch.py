# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contact patch of a convex shape and a tube: one corner, or the two ends of a face.

A face is in contact at both ends if both corners penetrate the straight tube; the angle of the
face has no threshold. A face shorter than the tube radius is one contact. This module defines the
contacts for twist, rolling, planner, guard and the model of a held object.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import Shape

#: Assumed depth of an object that does not penetrate a tube yet, in tube radii [-].
PLANNED_DEPTH = 0.02
#: Largest relative difference of depths that count as equal [-]; then the corner nearest to the
#: centroid is taken.
TIE_TOLERANCE = 1e-6


def contact_body(body: ConvexObject, tube_radius: float) -> ConvexObject:
    """
    Return an object for contacts: short faces that sample a smooth outline become smooth.

    :param body: the object.
    :param tube_radius: radius of the tubes [m]; shorter faces are samples.
    """
    return body.smoothed(tube_radius)


class PatchEnd(NamedTuple):
    """One end of the contact patch of a shape and a tube."""

    corner: int  #: index of the corner, see `Shape.corner_at`
    point: complex  #: point of the surface, x + iy in the object's frame [m]
    height: float  #: height toward the tube, from the origin of the object's frame [m]
    along: float  #: distance from the deepest corner along the faces, counter-clockwise [m]


def contact_patch(
    shape: Shape, normal: complex, tube_radius: float, skin: float = math.inf
) -> list[PatchEnd]:
    """
    Return one or two ends of the contact patch of a shape and a tube, counter-clockwise.

    :param shape: shape of the object, see `contact_body`.
    :param normal: unit vector from the object toward the straight tube, x + iy in the object's
        frame.
    :param tube_radius: radius of the tube [m].
    :param skin: height of the straight tube's skin along the normal, from the origin of the
        object's frame [m]; infinite before the tube is pressed.
    """
    corner, back = shape.corner_at(normal), normal.conjugate()
    point, short = shape.point_at(corner, normal), tube_radius
    near = [PatchEnd(corner, point, (point * back).real, 0.0)]
    far: list[PatchEnd] = []
    depth = max(near[0].height - skin, PLANNED_DEPTH * tube_radius)
    least = near[0].height - depth
    for side in range(len(shape.faces_at(corner))):
        at, along, short_face = corner, 0.0, True
        while short_face:
            face = shape.faces_at(at)[side]
            at, along = face.corner, along + face.step * face.length
            point, short_face = shape.point_at(at, face.normal), face.length < short
            height = (point * back).real
            # A face is in contact at its ends only; a curve of short faces has no ends.
            if height < least or at == corner or (short_face and abs(along) >= short):
                break
            (near if short_face else far).append(PatchEnd(at, point, height, along))
    tie, middle = TIE_TOLERANCE * depth, (shape.centroid * back).imag
    ends = near + far
    highest = max(each.height for each in ends) - tie
    first = min(
        (each for each in ends if each.height >= highest),
        key=lambda each: abs((each.point * back).imag - middle),
    )
    apart = [each for each in ends if abs(each.along - first.along) >= short]
    other = max(apart, key=lambda each: each.height, default=None)
    return [first] if other is None else sorted((first, other), key=lambda each: each.along)
