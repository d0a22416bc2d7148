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
influence function of the member with clamped ends. Both are exact for Timoshenko beams, so that a
frame with loaded points anywhere needs no finer mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.statics.beam import local_stiffness
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
    :ivar pinned: (p, 2) whether start and end transmit no moment; not both.
    """

    member: Indices
    place: Array
    length: Array
    axial: Array
    flexural: Array
    shear: Array
    pinned: Flags

    def shapes(self) -> Array:
        """
        Return the shape functions: displacements of the points by those of the ends.

        :return: (c, 2, 6): along and across the member, by (ux, uy, theta) at start and end.
        """
        shapes = self._clamped_shapes.copy()
        for rotation, end in ((2, 0), (5, 1)):
            if not self.pinned[:, end].any():
                continue
            freed, stiffness = self.pinned[self.member, end], self._stiffness[self.member]
            # The free rotation follows from no moment: theta = -K_theta,u / K_theta,theta u.
            turned = shapes[freed, 1, rotation] / stiffness[freed, rotation, rotation]
            shapes[freed, 1] -= turned[:, None] * stiffness[freed, rotation]
            shapes[freed, 1, rotation] = 0.0
        return shapes

    @cached_property
    def _stiffness(self) -> Array:
        return local_stiffness(self.length, self.axial, self.flexural, self.shear)

    @cached_property
    def _clamped_shapes(self) -> Array:
        length = self.length[self.member]
        part = self.place / length
        rest = 1.0 - part
        shear = 12.0 * (self.flexural / (self.shear * self.length**2))[self.member]
        whole = 1.0 + shear
        shapes = np.zeros((len(part), 2, 6))
        shapes[:, 0, 0], shapes[:, 0, 3] = rest, part
        shapes[:, 1, 1] = rest * (1.0 + part * (rest - part) / whole)
        shapes[:, 1, 4] = part * (1.0 + rest * (part - rest) / whole)
        shapes[:, 1, 2] = length * part * rest * (rest + 0.5 * shear) / whole
        shapes[:, 1, 5] = -length * part * rest * (part + 0.5 * shear) / whole
        return shapes

    def compliance(self) -> Array:
        """
        Return the displacements of points under unit forces at points while the ends are held.

        :return: (2, c, c): along the members, across them [m/N]; zero between members.
        """
        place, same = self.place, self.member[:, None] == self.member
        near, far = np.minimum(place[:, None], place), np.maximum(place[:, None], place)
        length = self.length[self.member]
        found = np.empty((2, *near.shape))
        # What does not reach from member to member is left out with the stiffness.
        found[0] = near * (length - far) * (same / (self.axial * self.length)[self.member])
        # A cantilever from the start, then its ends brought back.
        left, right = self.held_back
        bend = near * near * (3.0 * far - near) * (1.0 / (6.0 * self.flexural))[self.member]
        bend += near * (1.0 / self.shear)[self.member]
        bend -= left.T @ right
        np.multiply(bend, same, out=found[1])
        return found

    @cached_property
    def held_back(self) -> tuple[Array, Array]:
        """
        Return what the far end, and pins, take off the bending of a cantilever from the start.

        :return: (r, c) and (r, c): the displacement of a point by a force at another one of its
            member is less by the sum of the products of both their columns [m/N].
        """
        place, length = self.place, self.length[self.member]
        flexural, shear = self.flexural[self.member], self.shear[self.member]
        sink = place**2 * (3.0 * length - place) / (6.0 * flexural) + place / shear
        tilt = place**2 / (2.0 * flexural)
        tip = length**3 / (3.0 * flexural) + length / shear
        cross, turn = length**2 / (2.0 * flexural), length / flexural
        scale = 1.0 / (tip * turn - cross**2)
        left = [scale * (turn * sink - cross * tilt), scale * (tip * tilt - cross * sink)]
        right = [sink, tilt]
        for rotation, end in ((2, 0), (5, 1)):
            if not self.pinned[:, end].any():
                continue
            freed, stiffness = self.pinned[self.member, end], self._stiffness[self.member]
            shape = np.where(freed, self._clamped_shapes[:, 1, rotation], 0.0)
            left.append(-shape / stiffness[:, rotation, rotation])
            right.append(shape)
        return np.stack(left), np.stack(right)
