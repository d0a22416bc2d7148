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


class GripContacts(NamedTuple):
    """
    The k contacts of a grip, in the robot frame: one for each member, two where a face lies on it.

    :ivar nodes: numbers of the grip's members and of their nodes.
    :ivar starts: (k,) of the members [m].
    :ivar spans: (k,) members from start to end [m].
    :ivar axes: (k,) their unit vectors.
    :ivar normals: (k,) unit vectors out of the object into the member.
    :ivar points: (k,) of the object's surface [m].
    :ivar sides: (k,) +1 where the object is left of the member, -1 where it is right.
    :ivar owners: (k,) which member of the grip it is.
    """

    nodes: MemberNodes
    starts: Points
    spans: Points
    axes: Points
    normals: Points
    points: Points
    sides: Array
    owners: Indices

    def take(self, numbers: Sequence[int]) -> GripContacts:
        """
        Return some of the contacts.

        :param numbers: of these.
        """
        chosen = list(numbers)
        return GripContacts(self.nodes, *(values[chosen] for values in self[1:]))


@functools.lru_cache(maxsize=8)
def find_contacts(config: Configuration, grip: Grip) -> GripContacts:
    """
    Find where the members touch the object; the last few results are kept.

    :param config: configuration of the robot.
    :param grip: the grip.
    :return: the contacts, whose arrays are not to be written to.
    :raises GraspError: no such member; or a member does not touch the object between its ends:
        it is off by more than a tube is thick.
    """
    body, nodes = grip.body, find_members(config.robot, grip.members)
    ends = config.points.take(nodes.both).tolist()
    count, inside, turned = len(grip.members), body.middle, body.turn.conjugate()
    # A few complex numbers are quicker than arrays.
    members: list[tuple[complex, complex, complex, complex, float]] = []
    for start, end in zip(ends[:count], ends[count:], strict=True):
        span = end - start
        axis = span / abs(span)
        side = math.copysign(1.0, (axis.conjugate() * (inside - start)).imag)
        members.append((start, span, axis, -1j * side * axis, side))
    own = [turned * normal for _, _, _, normal, _ in members]
    owners, _, touched = body.shape.touch_lines(own, SIN_FACE_ANGLE)
    points = [body.center + body.turn * point for point in touched]
    tube = config.robot.description.tube_diameter
    gaps: list[float] = []
    shares: list[float] = []
    for owner, point in zip(owners, points, strict=True):
        start, span, axis, _, side = members[owner]
        local = axis.conjugate() * (point - start)
        gaps.append(side * local.imag - 0.5 * tube)
        shares.append(local.real / abs(span))
    if not (
        -tube <= min(gaps) and max(gaps) <= tube and min(shares) >= 0.0 and max(shares) <= 1.0
    ):
        _check_touch(grip, owners, gaps, shares, tube)
    *places, sides = zip(*(members[owner] for owner in owners), strict=True)
    return GripContacts(nodes, *np.array([*places, points]), np.array(sides), np.array(owners))


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
