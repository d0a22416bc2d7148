# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Points inside members: their displacements with the ends and under loads, without more nodes.

A prismatic member deforms under loads at its inside as the shape functions of its ends plus the
influence function of the member with clamped ends, see `ClampedBeam`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.statics.clamped_beam import ClampedBeam, DEFLECTION
from isotruss_ros.core.statics.frame import Frame
import numpy as np


@dataclass(frozen=True, eq=False)
class InteriorPoints:
    """
    Points on members; arrays over points c, and over the members p that they are on.

    :ivar member: (c,) place of each point's member among the p members.
    :ivar place: (c,) distance from the member's start [m].
    :ivar length: (p,) of the members [m].
    :ivar axial: (p,) EA [N].
    :ivar flexural: (p,) EI [N m^2].
    :ivar shear: (p,) GA [N].
    :ivar pinned: (p,) whether the start transmits no moment.
    """

    member: Indices
    place: Array
    length: Array
    axial: Array
    flexural: Array
    shear: Array
    pinned: Flags

    @cached_property
    def _beam(self) -> ClampedBeam:
        of_members = (self.length, self.axial, self.flexural, self.shear, self.pinned)
        return ClampedBeam(*(values[self.member] for values in of_members))

    def shapes(self) -> Array:
        """
        Return the shape functions: displacements of the points by those of the ends.

        :return: (c, 2, 6): along and across the member, by (ux, uy, theta) at start and end.
        """
        part = self.place / self.length[self.member]
        shapes = np.zeros((len(part), 2, 6))
        shapes[:, 0, 0], shapes[:, 0, 3] = 1.0 - part, part
        shapes[:, 1, [1, 2, 4, 5]] = np.transpose(self._beam.shapes(self.place, 1)[DEFLECTION])
        return shapes

    def compliance(self) -> Array:
        """
        Return the displacements of points under unit forces at points while the ends are held.

        :return: (2, c, c): along the members, across them [m/N]; zero between members.
        """
        place, same = self.place, self.member[:, None] == self.member
        near, far = np.minimum(place[:, None], place), np.maximum(place[:, None], place)
        left, right = self._beam.held_back(place, 1)[DEFLECTION]
        found = np.empty((2, *near.shape))
        found[0] = self._beam.along(near, far)
        found[1] = self._beam.cantilever(near, far)
        found[1] -= np.transpose(left) @ np.array(right)
        found *= same
        return found


def interior_points(
    frame: Frame, pieces: Indices, member: Indices, place: Array
) -> InteriorPoints:
    """
    Return points on members of a frame.

    :param frame: the frame.
    :param pieces: (p,) numbers of the members.
    :param member: (c,) which of these each point is on.
    :param place: (c,) distance from its start [m].
    """
    members = frame.members
    return InteriorPoints(
        member,
        place,
        frame.length[pieces],
        members.axial[pieces],
        members.flexural[pieces],
        members.shear[pieces],
        members.pinned_start[pieces],
    )
