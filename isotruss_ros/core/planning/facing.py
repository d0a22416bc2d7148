# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Directions of members around an object that admit force closure.

Two balanced forces act along one line. The required friction coefficient is the tangent of the
angle between this line and the normals, for the best line through both contacts. A face can be in
contact at any of its points, see `Shape.contact_patch`. Three members have force closure if forces
within their friction cones balance. The `radius` is that of the tubes [m].
"""

from __future__ import annotations

import functools
import math

from isotruss_ros.core.manipulation.rolling_off import balance_angles
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np
import scipy

#: Fraction of the friction angle that may be used in planned grips [-].
CONE_SHARE = 0.85
#: Weight of the members' rotation relative to the friction angle [-].
TURN_WEIGHT = 0.3
#: Digits after the point of values [-, rad] that are compared; the others are rounding.
ROUNDED_DIGITS = 9


def contact_ends(body: ConvexObject, normals: Points, radius: float) -> tuple[Points, Points]:
    """
    Return both ends (s,) of each contact with straight members, the clockwise end first [m].

    Normals (s,) point to the members; ends are relative to the object's origin, in robot axes.
    """
    shape, local_normals = body.shape.smoothed(radius), normals * body.turn.conjugate()
    if not shape.faces_at(0):  # without faces, both ends are the same point
        points = body.turn * shape.support_points(local_normals)
        return points, points
    patches = [shape.contact_patch(normal, radius) for normal in local_normals.tolist()]
    first_ends, last_ends = np.array([(patch[0].point, patch[-1].point) for patch in patches]).T
    return body.turn * first_ends, body.turn * last_ends


@functools.lru_cache(maxsize=16)
def _find_pairs(shape: Shape, radius: float) -> tuple[Points, Points, Array]:
    """Return directions of two members in the object's frame, with required friction angles."""
    # Directions of the first member every 5 degrees, and the normals of all faces: from corner to
    # corner, until the first one is reached again.
    directions = np.exp(2j * np.pi * np.arange(72) / 72).tolist()
    smooth, corner = shape.smoothed(radius), 0
    while faces := smooth.faces_at(corner):
        directions.append(faces[-1].normal)
        corner = faces[-1].corner
        if corner == 0:
            break
    # The second member is opposite, but for wedges of up to 0.8 rad.
    wedges = np.linspace(-0.8, 0.8, 17)
    firsts, wedges = np.tile(directions, len(wedges)), np.repeat(wedges, len(directions))
    seconds = -firsts * np.exp(1j * wedges)
    return firsts, seconds, friction_angles(ConvexObject(shape), firsts, seconds, radius)


def friction_angles(body: ConvexObject, normals: Points, others: Points, radius: float) -> Array:
    """Return the smallest friction angles (s,) [rad] at which pairs of members balance."""
    ends, other_ends = (contact_ends(body, n, radius) for n in (normals, others))
    return balance_angles(normals, others, np.array(ends), np.array(other_ends))


def balances(body: ConvexObject, normals: Points, angle: float, radius: float) -> bool:
    """Return whether forces within friction cones of a half angle [rad] can balance an object."""
    ends = contact_ends(body, normals, radius)
    arms = np.concatenate([*ends, *ends]) - (body.middle - body.center)
    turned = np.concatenate([-normals * np.exp(1j * sign * angle) for sign in (1, 1, -1, -1)])
    moments = (arms.conj() * turned).imag / body.arm
    wrenches = np.vstack([turned.real, turned.imag, moments])
    # Each member must press: the minimum forces are balanced by additional ones.
    return bool(scipy.optimize.nnls(wrenches, -wrenches.sum(axis=1))[1] <= ROUNDING)


def find_facing(
    body: ConvexObject, normals: Points, angle: float, radius: float, turning: float = TURN_WEIGHT
) -> Points | None:
    """
    Return directions (2,) of two members that admit force closure, near the current ones, or None.

    They minimise a weighted sum of required friction angle and rotation.
    """
    local_firsts, local_seconds, required = _find_pairs(body.shape, radius)
    pairs = np.array([local_firsts, local_seconds]) * body.turn
    turns = np.abs(np.angle(pairs / normals[:, None]))
    cost = np.where(required <= angle, required + turning * turns.sum(axis=0), math.inf)
    # Among pairs of equal cost, the turns are as equal as possible, then the first turn is small.
    # All are rounded, because rounding errors depend on the frame.
    ranks = np.round([turns[0], np.square(turns).sum(axis=0), cost], ROUNDED_DIGITS)
    best = int(np.lexsort(ranks)[0])  # sorted by the last rank first
    return None if cost[best] == math.inf else pairs[:, best]
