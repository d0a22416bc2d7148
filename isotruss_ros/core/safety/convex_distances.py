"""
Distances between straight segments and a convex object.

The signed distance of a point from a convex object is a convex function of the point, and so along
a segment: its least value is where the slope changes sign.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np

#: Steps that halve where the nearest point can be; on faces and at corners it is found before.
STEPS = 24
#: The bracket stays this share of itself away from its ends, so that both of them move.
INSET = 0.1
TINY = 1e-15


class NearestToObject(NamedTuple):
    """
    The points of straight segments that are nearest to an object; arrays over segments.

    :ivar gaps: (k,) from the object's surface, negative where the segment enters it [m].
    :ivar shares: (k,) where they are along the segments, 0 to 1.
    :ivar normals: (k,) unit vectors out of the object there, x + iy in the robot frame.
    """

    gaps: Array
    shares: Array
    normals: Points


def nearest_to_object(body: ConvexObject, starts: Points, ends: Points) -> NearestToObject:
    """
    Return the points of straight segments that are nearest to an object.

    :param body: the object in its place.
    :param starts: (k,) where the segments begin, x + iy in the robot frame [m].
    :param ends: (k,) where they end, perhaps where they begin [m].
    """
    spans = ends - starts
    low, high = np.zeros(len(spans)), np.ones(len(spans))
    low_gap, low_slope = _along(body, starts, spans, low)
    high_gap, high_slope = _along(body, starts, spans, high)
    for _ in range(STEPS):
        open_ = (low_slope < -TINY) & (high_slope > TINY)
        if not open_.any():
            break
        # Where the tangents at both ends meet: the place itself, between two straight pieces.
        with np.errstate(divide='ignore', invalid='ignore'):
            share = low_gap - high_gap + high_slope * high - low_slope * low
            share = share / (high_slope - low_slope)
        width = high - low
        share = np.where(open_, share, low)
        share = np.clip(share, low + INSET * width, high - INSET * width)
        gap, slope = _along(body, starts, spans, share)
        down, up = open_ & (slope <= 0.0), open_ & (slope > 0.0)
        low, high = np.where(down, share, low), np.where(up, share, high)
        low_gap, high_gap = np.where(down, gap, low_gap), np.where(up, gap, high_gap)
        low_slope, high_slope = np.where(down, slope, low_slope), np.where(up, slope, high_slope)
    shares = np.where(low_gap <= high_gap, low, high)
    found = body.nearest(starts + shares * spans)
    return NearestToObject(found.gaps, shares, found.normals)


def _along(
    body: ConvexObject, starts: Points, spans: Points, shares: Array
) -> tuple[Array, Array]:
    """Return the gaps (k,) of points of segments [m], and their slopes by the share [m]."""
    found = body.nearest(starts + shares * spans)
    return found.gaps, (found.normals.conj() * spans).real
