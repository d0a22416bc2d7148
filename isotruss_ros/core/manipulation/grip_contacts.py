# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Where the members of a grip touch the object.

A member touches with its straight skin: the object's contact is the point of its surface that is
farthest toward the member. A face of a polygon that lies on the member is touched at its two ends;
so it can neither lift nor turn. Points of the plane are complex numbers, as in `constraints`.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, Grip, MemberNodes
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: A face lies on a member that is inclined against it by at most this [rad].
FACE_ANGLE = 1e-3
SIN_FACE_ANGLE = math.sin(FACE_ANGLE)


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


class Touches(NamedTuple):
    """
    `GripContacts` as lists: with a few entries they are quicker than arrays.

    :ivar starts: (k,) of the members, x + iy [m].
    :ivar spans: (k,) members from start to end [m].
    :ivar axes: (k,) their unit vectors.
    :ivar points: (k,) of the object's surface [m].
    :ivar normals: (k,) unit vectors out of the object into the member.
    :ivar sides: (k,) +1 where the object is left of the member, -1 where it is right.
    :ivar owners: (k,) which member of the grip it is.
    """

    starts: list[complex]
    spans: list[complex]
    axes: list[complex]
    points: list[complex]
    normals: list[complex]
    sides: list[float]
    owners: list[int]

    def kept(self, numbers: Sequence[int]) -> Touches:
        """
        Return some of the contacts.

        :param numbers: of these.
        """
        return Touches(*([values[k] for k in numbers] for values in self))

    def contacts(self, robot: Robot, grip: Grip) -> GripContacts:
        """
        Return the same as arrays.

        :param robot: the robot.
        :param grip: the grip.
        """
        nodes = find_members(robot, tuple(grip.members[i] for i in self.owners))
        found = map(np.array, (self.spans, self.axes, self.points, self.normals, self.sides))
        return GripContacts(nodes, *found, np.array(self.owners))


def find_contacts(config: Configuration, grip: Grip) -> GripContacts:
    """
    Find where the members touch the object.

    :param config: configuration of the robot.
    :param grip: the grip.
    :raises GraspError: no such member; or a member does not touch the object between its ends:
        it is off by more than a tube is thick.
    """
    return find_touches(config, grip).contacts(config.robot, grip)


def find_touches(config: Configuration, grip: Grip) -> Touches:
    """
    Find where the members touch the object, as `find_contacts`.

    :param config: configuration of the robot.
    :param grip: the grip.
    :raises GraspError: see `find_contacts`.
    """
    body, nodes = grip.body, find_members(config.robot, grip.members)
    both = config.points.take(nodes.both).tolist()
    starts, ends = both[::2], both[1::2]
    inside = body.middle
    spans, axes, sides, normals = [], [], [], []
    for start, end in zip(starts, ends, strict=True):
        span = end - start
        axis = span / abs(span)
        across = (axis.conjugate() * (inside - start)).imag
        side = math.copysign(1.0, across)
        spans.append(span)
        axes.append(axis)
        sides.append(side)
        normals.append(-1j * side * axis)
    owners, points = touched_points(body, normals)
    if len(owners) > len(starts):
        starts, spans, axes, normals, sides = (
            [values[i] for i in owners] for values in (starts, spans, axes, normals, sides)
        )
    tube = config.robot.description.tube_diameter
    gaps: list[float] = []
    shares: list[float] = []
    for start, span, axis, side, point in zip(starts, spans, axes, sides, points, strict=True):
        local = axis.conjugate() * (point - start)
        gaps.append(side * local.imag - 0.5 * tube)
        shares.append(local.real / abs(span))
    if not (
        -tube <= min(gaps) and max(gaps) <= tube and min(shares) >= 0.0 and max(shares) <= 1.0
    ):
        _check_touch(grip, owners, gaps, shares, tube)
    return Touches(starts, spans, axes, points, normals, sides, owners)


def touched_points(body: ConvexObject, normals: list[complex]) -> tuple[list[int], list[complex]]:
    """
    Return where straight members touch an object.

    :param body: the object in its place.
    :param normals: (m,) unit vectors out of the object into the members, robot frame.
    :return: (k,) numbers of the members, and (k,) points x + iy in the robot frame [m].
    """
    shape, center, turn = body.shape, body.center, body.turn
    owners, points = [], []
    for number, normal in enumerate(normals):
        own = normal * turn.conjugate()
        for corner in shape.corners_at(own, SIN_FACE_ANGLE):
            owners.append(number)
            points.append(center + turn * shape.point_at(corner, own))
    return owners, points


def touched_corners(shape: Shape, normals: Points, face_angle: float) -> tuple[Indices, Indices]:
    """
    Return with which corners a shape touches straight members.

    :param shape: the shape.
    :param normals: (m,) unit vectors out of the shape into the members, in its own frame.
    :param face_angle: a face lies on a member that is inclined by at most this [rad].
    :return: (k,) numbers of the members, one after the other, and (k,) of the corners: one, or
        both ends of a face that lies on the member.
    """
    sine = math.sin(face_angle)
    found = [shape.corners_at(normal, sine) for normal in normals.tolist()]
    owners = [number for number, corners in enumerate(found) for _ in corners]
    return np.array(owners), np.array([corner for corners in found for corner in corners])


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
