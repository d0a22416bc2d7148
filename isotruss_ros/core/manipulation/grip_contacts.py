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

import functools
import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, Grip, MemberNodes
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: A face lies on a member that is inclined against it by at most this [rad].
FACE_ANGLE = 1e-3
SIN_FACE_ANGLE = math.sin(FACE_ANGLE)


class Touch(NamedTuple):
    """One contact, as numbers: a few of them are quicker than arrays."""

    owner: int  #: which member of the grip it is
    start: complex  #: of the member, robot frame [m]
    span: complex  #: the member from start to end [m]
    axis: complex  #: its unit vector
    normal: complex  #: unit vector out of the object into the member
    point: complex  #: of the object's surface, robot frame [m]
    side: float  #: +1 where the object is left of the member, -1 where it is right


class GripContacts(NamedTuple):
    """The k contacts of a grip, robot frame: one for each member, two where a face lies on it."""

    nodes: MemberNodes  #: numbers of the grip's members and of their nodes
    owners: Indices  #: (k,) which member of the grip it is
    starts: Points  #: (k,) of the members [m]
    spans: Points  #: (k,) members from start to end [m]
    axes: Points  #: (k,) their unit vectors
    normals: Points  #: (k,) unit vectors out of the object into the member
    points: Points  #: (k,) of the object's surface [m]
    sides: Array  #: (k,) +1 where the object is left of the member, -1 where it is right


def find_contacts(config: Configuration, grip: Grip) -> GripContacts:
    """
    Find where the members touch the object.

    :param config: configuration of the robot.
    :param grip: the grip.
    :raises GraspError: see `touch_members`.
    """
    owners, *places, sides = zip(*touch_members(config, grip), strict=True)
    nodes = find_members(config.robot, grip.members)
    return GripContacts(nodes, np.array(owners), *np.array(places), np.array(sides))


@functools.lru_cache(maxsize=8)
def touch_members(config: Configuration, grip: Grip) -> list[Touch]:
    """
    Find where the members touch the object; the last few results are kept.

    :param config: configuration of the robot.
    :param grip: the grip.
    :return: the contacts, member after member.
    :raises GraspError: no such member; or a member does not touch the object between its ends:
        it is off by more than a tube is thick.
    """
    body, nodes = grip.body, find_members(config.robot, grip.members)
    ends = config.points.take(nodes.both).tolist()
    count, inside, turned = len(grip.members), body.middle, body.turn.conjugate()
    members: list[tuple[complex, complex, complex, complex, float]] = []
    for start, end in zip(ends[:count], ends[count:], strict=True):
        span = end - start
        axis = span / abs(span)
        side = math.copysign(1.0, (axis.conjugate() * (inside - start)).imag)
        members.append((start, span, axis, -1j * side * axis, side))
    touched = body.shape.touch_lines([turned * member[3] for member in members], SIN_FACE_ANGLE)
    tube = config.robot.description.tube_diameter
    found: list[Touch] = []
    places: list[tuple[float, float]] = []
    fits = True
    for owner, own_point in zip(touched.owners, touched.points, strict=True):
        start, span, axis, normal, side = members[owner]
        point = body.center + body.turn * own_point
        found.append(Touch(owner, start, span, axis, normal, point, side))
        local = axis.conjugate() * (point - start)
        gap, share = side * local.imag - 0.5 * tube, local.real / abs(span)
        places.append((gap, share))
        fits = fits and -tube <= gap <= tube and 0.0 <= share <= 1.0
    if not fits:
        gaps, shares = map(list, zip(*places, strict=True))
        _check_touch(grip, touched.owners, gaps, shares, tube)
    return found


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
