# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Toward which directions members are to face an object so that friction holds it between them.

Two forces that balance act along one line. What it takes is the angle between that line and the
normals, at the best places within the contacts: a face that all but lies on a member is touched
anywhere on it. Three members that enclose the object balance with forces within their cones.
"""

from __future__ import annotations

import functools
import math

from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np
import scipy

#: Corners that are within this of the farthest one are touched too: tubes give [m].
SINK = 0.001
#: Directions that are tried, and angles between the members [rad].
DIRECTIONS, WEDGES = 72, np.linspace(-0.8, 0.8, 17)
#: What is left of a balance of unit forces.
BALANCED = 1e-6
#: Of the friction cones that grips are to use at most, and that they use where they are open.
CONE_SHARE, USED_SHARE = 0.75, 0.85
#: Angle of friction that is given up for a smaller turn of the members [-].
TURNING_PRICE = 0.3


def contact_ends(body: ConvexObject, normals: Points) -> tuple[Points, Points]:
    """
    Return the ends of the places where straight members touch, first those farther clockwise.

    :param body: the object in its place.
    :param normals: (s,) unit vectors out of the object into the members, robot frame.
    :return: (s,) each, x + iy from the origin of the object's frame, robot frame [m].
    """
    facing = (normals * body.turn.conjugate())[:, None]
    points, _ = body.shape.surface_at(_outline(body.shape)[0], facing)
    seen = points * facing.conj()
    touched = seen.real >= seen.real.max(axis=1)[:, None] - SINK
    first = np.where(touched, seen.imag, np.inf).argmin(axis=1)
    last = np.where(touched, seen.imag, -np.inf).argmax(axis=1)
    own = np.arange(len(normals))
    return body.turn * points[own, first], body.turn * points[own, last]


@functools.lru_cache(maxsize=16)
def _outline(shape: Shape) -> tuple[Indices, Points]:
    """Return the corners of a shape and the normals of its faces, counter-clockwise, (k,) each."""
    corners, normals = [0], []
    while faces := shape.faces_at(corners[-1]):
        normals.append(faces[-1].normal)
        if faces[-1].corner == 0:
            break
        corners.append(faces[-1].corner)
    return np.array(corners), np.array(normals, dtype=np.complex128)


def friction_angles(body: ConvexObject, normals: Points, others: Points) -> Array:
    """
    Return the least angle of the friction cones in which two members balance, (s,) [rad].

    :param body: the object in its place.
    :param normals: (s,) of the first members, unit vectors out of the object, robot frame.
    :param others: (s,) of the second ones.
    """
    clockwise, counter = contact_ends(body, normals)
    clockwise_too, counter_too = contact_ends(body, others)
    # Directions of the line from the first contact to the second, from that of its normal inward.
    lines = [
        np.angle((end - begin) / -normals)
        for begin in (clockwise, counter)
        for end in (clockwise_too, counter_too)
    ]
    between = np.angle(-others / normals)
    # The best is half way between both normals.
    best = np.clip(0.5 * between, np.min(lines, axis=0), np.max(lines, axis=0))
    return np.maximum(np.abs(best), np.abs(best - between))


def balances(body: ConvexObject, normals: Points, angle: float) -> bool:
    """
    Tell whether members that face an object balance, with forces in friction cones.

    :param body: the object in its place.
    :param normals: (s,) unit vectors out of the object into the members, robot frame.
    :param angle: of the cones [rad].
    """
    if len(normals) == 2:  # the closed form, in place of the least squares below
        return bool(friction_angles(body, normals[:1], normals[1:])[0] <= angle)
    ends = contact_ends(body, normals)
    arms = np.concatenate([*ends, *ends]) - (body.middle - body.center)
    turned = np.concatenate([-normals * np.exp(1j * sign * angle) for sign in (1, 1, -1, -1)])
    moments = (arms.conj() * turned).imag / body.arm
    wrenches = np.vstack([turned.real, turned.imag, moments])
    # Each member presses, and what it presses with in any case is balanced by more of all.
    return bool(scipy.optimize.nnls(wrenches, -wrenches.sum(axis=1))[1] <= BALANCED)


def find_facing(
    body: ConvexObject, normals: Points, angle: float, turning: float = TURNING_PRICE
) -> Points | None:
    """
    Return directions in which two members hold an object, the best near to the present ones.

    :param body: the object in its place.
    :param normals: (2,) in which they face it now, unit vectors out of the object, robot frame.
    :param angle: of the friction cones that may be used [rad].
    :param turning: what a turn of the members counts against an angle of friction [-].
    :return: (2,) such directions; None where there are none.
    """
    firsts = np.exp(2j * np.pi * np.arange(DIRECTIONS) / DIRECTIONS)
    firsts = np.concatenate([firsts, _outline(body.shape)[1] * body.turn])
    firsts, wedges = (grid.ravel() for grid in np.meshgrid(firsts, WEDGES))
    others = -firsts * np.exp(1j * wedges)
    used = friction_angles(body, firsts, others)
    moved = np.abs(np.angle(firsts / normals[0])) + np.abs(np.angle(others / normals[1]))
    price = np.where(used <= angle, used + turning * moved, math.inf)
    best = int(price.argmin())
    if price[best] == math.inf:
        return None
    return np.array([firsts[best], others[best]])
