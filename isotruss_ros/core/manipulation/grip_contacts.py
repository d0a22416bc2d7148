"""
Where the members of a grip touch the object.

A member touches with its straight skin: the object's contact is the point of its surface that is
farthest toward the member. A face of a polygon that lies on the member is touched at its two ends;
so it can neither lift nor turn. Points of the plane are complex numbers, as in `constraints`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, Grip, MemberNodes
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.objects import Cylinder
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: A face lies on a member that is inclined against it by at most this [rad].
FACE_ANGLE = 1e-3


class GripContacts(NamedTuple):
    """
    The k contacts of a grip, in the robot frame: one for each member, two where a face lies on it.

    :ivar nodes: numbers of the members, one for each contact, and of their nodes.
    :ivar spans: (k,) members from start to end [m].
    :ivar axes: (k,) their unit vectors.
    :ivar points: (k,) of the object's surface [m].
    :ivar normals: (k,) unit vectors out of the object into the member.
    :ivar sides: (k,) +1 where the object is left of the member, -1 where it is right.
    :ivar owners: (k,) which member of the grip it is.
    """

    nodes: MemberNodes
    spans: Points
    axes: Points
    points: Points
    normals: Points
    sides: Array
    owners: Indices


def find_contacts(config: Configuration, grip: Grip) -> GripContacts:
    """
    Find where the members touch the object.

    :param config: configuration of the robot.
    :param grip: the grip.
    :raises GraspError: no such member; or a member does not touch the object between its ends:
        it is off by more than a tube is thick.
    """
    body, nodes = grip.body, find_members(config.robot, grip.members)
    owners = nodes.numbers
    # Lists: with a few entries quicker than arrays.
    starts = config.points.take(nodes.starts).tolist()
    ends = config.points.take(nodes.ends).tolist()
    inside = grip.center if isinstance(body, Cylinder) else body.middle
    radius = _radius(body)
    members: list[tuple[complex, complex, float, complex]] = []
    points: list[complex] = []
    for start, end in zip(starts, ends, strict=True):
        span = end - start
        axis = span / abs(span)
        across = (axis.conjugate() * (inside - start)).imag
        side = math.copysign(1.0, across) if across else 0.0
        normal = -1j * side * axis
        members.append((span, axis, side, normal))
        points.append(inside + radius * normal)
    if math.isnan(radius):
        own = np.array([normal for *_, normal in members])
        owners, touched = touched_points(body, own)
        points = touched.tolist()
        if len(owners) > len(members):
            nodes = find_members(config.robot, tuple(grip.members[i] for i in owners))
        starts = [starts[i] for i in owners]
        members = [members[i] for i in owners]
    spans, axes, sides, normals = zip(*members, strict=True)
    tube = config.robot.description.tube_diameter
    gaps: list[float] = []
    shares: list[float] = []
    for start, (span, axis, side, _), point in zip(starts, members, points, strict=True):
        local = axis.conjugate() * (point - start)
        gaps.append(side * local.imag - 0.5 * tube)
        shares.append(local.real / abs(span))
    if not (
        -tube <= min(gaps) and max(gaps) <= tube and min(shares) >= 0.0 and max(shares) <= 1.0
    ):
        _check_touch(grip, owners.tolist(), gaps, shares, tube)
    found = [np.array(values) for values in (spans, axes, points, normals, sides)]
    return GripContacts(nodes, *found, owners)


def _radius(body: Cylinder | ConvexObject) -> float:
    """Return the radius of a round object [m], nan of another."""
    if isinstance(body, Cylinder):
        return 0.5 * body.diameter
    return 0.5 * body.shape.diameter if isinstance(body.shape, Disc) else math.nan


def touched_points(body: ConvexObject, normals: Points) -> tuple[Indices, Points]:
    """
    Return where straight members touch an object.

    :param body: the object in its place.
    :param normals: (m,) unit vectors out of the object into the members, robot frame.
    :return: (k,) numbers of the members, and (k,) points x + iy in the robot frame [m].
    """
    own = normals * body.turn.conjugate()
    if not isinstance(body.shape, Polygon):
        return np.arange(len(own)), body.center + body.turn * body.shape.support_points(own)
    owners, corners = touched_corners(body.shape, own)
    points = body.shape.arc_centers[corners] + body.shape.radii[corners] * own[owners]
    return owners, body.center + body.turn * points


def touched_corners(
    polygon: Polygon, normals: Points, face_angle: float = FACE_ANGLE
) -> tuple[Indices, Indices]:
    """
    Return with which corners a polygon touches straight members.

    :param polygon: the shape.
    :param normals: (m,) unit vectors out of the polygon into the members, in its own frame.
    :param face_angle: a face lies on a member that is inclined by at most this [rad].
    :return: (k,) numbers of the members, one after the other, and (k,) of the corners: one, or
        both ends of a face that lies on the member.
    """
    count = len(polygon.vertices)
    every = np.arange(count)
    turned = normals[:, None] * polygon.normals.conj()
    # Faces in their order fall behind a normal; between those before and behind it is its corner.
    behind = turned.imag <= 0.0
    corners = (behind & ~behind[:, every - 1]).argmax(axis=1)
    faces = turned.real.argmax(axis=1)
    nearest = turned[np.arange(len(normals)), faces]
    flat = np.abs(nearest.imag) <= math.sin(face_angle)
    first = np.where(flat, faces, corners)
    owners = np.arange(len(normals)).repeat(1 + flat)
    second = np.append(False, owners[1:] == owners[:-1])
    return owners, (first[owners] + second) % count


def _check_touch(
    grip: Grip, owners: list[int], gaps: list[float], shares: list[float], tube: float
) -> None:
    """Refuse a member that does not touch the object; a face may reach beyond its end."""
    for number, name in enumerate(grip.members):
        own = [k for k, owner in enumerate(owners) if owner == number]
        gap = min((gaps[k] for k in own), key=abs)
        nearest, farthest = min(shares[k] for k in own), max(shares[k] for k in own)
        if nearest <= 1.0 and farthest >= 0.0 and abs(gap) <= tube:
            continue
        what = f'the gap is {gap:.3g} m, within {tube:.3g} m in a grip'
        if nearest > 1.0 or farthest < 0.0:
            share = nearest if nearest > 1.0 else farthest
            what = f'it would touch at {share:.3g} of its length'
        center = grip.center
        raise GraspError(
            f'member {name} does not touch the object at ({center.real:.4g}, '
            f'{center.imag:.4g}) m: {what}; name the members that hold it, or give its place in '
            'the robot frame'
        )
