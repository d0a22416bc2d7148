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

Each member is its undeformed centre line, from pinch point to pinch point. The object's surface is
farthest toward the member. A face of a polygon that lies on the member is touched at its two ends;
so it can neither lift nor turn. Points of the plane are complex numbers, as in `constraints`.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, Grip

#: A face lies on a member that is inclined against it by at most this [rad].
FACE_ANGLE = 1e-3
SIN_FACE_ANGLE = math.sin(FACE_ANGLE)


class GripContact(NamedTuple):
    """One contact of a grip, in Python's numbers: a few of them are quicker than arrays."""

    owner: int  #: which member of the grip it is
    start: complex  #: of the member, robot frame [m]
    normal: complex  #: unit vector out of the object into the member
    point: complex  #: of the object's surface, robot frame [m]
    side: float  #: +1 where the object is left of the member, -1 where it is right


@functools.lru_cache(maxsize=8)
def find_contacts(config: Configuration, grip: Grip) -> list[GripContact]:
    """
    Find where the members touch the object; the last few results are kept.

    :param config: configuration of the robot.
    :param grip: the grip.
    :return: one for each member, member after member; two where a face lies on it.
    :raises GraspError: no such member; or a member does not touch the object between its ends:
        it is off by more than a tube is thick.
    """
    body, nodes = grip.body, find_members(config.robot, grip.members)
    ends = config.points.take(nodes.both).tolist()
    count, inside, turned = len(grip.members), body.middle, body.turn.conjugate()
    members: list[tuple[complex, complex, complex, float]] = []
    for start, end in zip(ends[:count], ends[count:], strict=True):
        span = end - start
        axis = span / abs(span)
        side = math.copysign(1.0, (axis.conjugate() * (inside - start)).imag)
        members.append((start, span, -1j * side * axis, side))
    touched = body.shape.touch_lines([turned * member[2] for member in members], SIN_FACE_ANGLE)
    tube = config.robot.description.tube_diameter
    found: list[GripContact] = []
    places: list[tuple[float, float]] = []
    fits = True
    for owner, own_point in zip(touched.owners, touched.points, strict=True):
        start, span, normal, side = members[owner]
        point = body.center + body.turn * own_point
        found.append(GripContact(owner, start, normal, point, side))
        away = start - point
        gap = (normal.conjugate() * away).real - 0.5 * tube
        share = -(span.conjugate() * away).real / abs(span) ** 2
        places.append((gap, share))
        fits = fits and -tube <= gap <= tube and 0.0 <= share <= 1.0
    if not fits:
        _check_touch(grip, touched.owners, places, tube)
    return found


def _check_touch(
    grip: Grip, owners: list[int], places: list[tuple[float, float]], tube: float
) -> None:
    """Refuse a member that does not touch the object; a face may reach beyond its end."""
    for number, name in enumerate(grip.members):
        own = [place for owner, place in zip(owners, places, strict=True) if owner == number]
        gap = min((gap for gap, _ in own), key=abs)
        nearest, farthest = min(share for _, share in own), max(share for _, share in own)
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
