# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How far straight segments are from a convex object that they may press into."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np

#: Segments shorter than this are points [m].
TINY = 1e-12


class SegmentGaps(NamedTuple):
    """
    Where segments are nearest to an object; arrays over segments.

    :ivar gaps: (k,) from the object's surface, negative where the line cuts into it [m].
    :ivar normals: (k,) unit vectors out of the object toward the segments, robot frame.
    :ivar shares: (k,) where along the segment that is, 0 to 1.
    """

    gaps: Array
    normals: Points
    shares: Array


def segment_gaps(body: ConvexObject, starts: Points, ends: Points) -> SegmentGaps:
    """
    Return how far segments are from an object, and which way.

    A segment is on that side of the object on which its line does not have the object's middle.

    :param body: the object in its place.
    :param starts: (k,) where the segments begin, robot frame [m].
    :param ends: (k,) where they end, perhaps where they begin [m].
    """
    spans = ends - starts
    lengths = np.abs(spans)
    some = lengths > TINY
    axes = np.where(some, spans, 1.0) / np.where(some, lengths, 1.0)
    away = axes.conj() * (body.middle - starts)
    normals = -1j * np.where(away.imag < 0.0, -axes, axes)
    turn = body.turn
    points = body.center + turn * body.shape.support_points(normals * turn.conjugate())
    gaps = ((starts - points) * normals.conj()).real
    shares = (axes.conj() * (points - starts)).real / np.maximum(lengths, TINY)
    beside = np.flatnonzero((shares < 0.0) | (shares > 1.0) | ~some)
    if len(beside):
        first = shares[beside] < 0.0
        found = body.nearest(np.where(first, starts[beside], ends[beside]))
        gaps[beside], normals[beside] = found.gaps, found.normals
        shares[beside] = np.where(first, 0.0, 1.0)
    return SegmentGaps(gaps, normals, shares)
