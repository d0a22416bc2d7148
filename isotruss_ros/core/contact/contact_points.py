# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Points of the tubes that an object could touch: how the robot gives there, and contact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """
    Points of the tubes that an object could touch, and how the whole robot gives there.

    Displacements of the points are those of the ends of the p pieces of tube that they are on,
    spread by shape functions, and those inside the pieces: the factors are kept, not the product.
    Both are along and across the pieces, so that no matrix has to be turned.

    :ivar points: (c,) on the undeformed centre lines, x + iy [m].
    :ivar skin: (c,) what the object meets: the undeformed skin, at the foot of each point toward
        the object; in the paper's model the centre line again [m].
    :ivar member: (c,) the member (pinch to pinch) that each is on.
    :ivar place: (c,) distance of each from its member's start [m].
    :ivar pieces: (p,) the pieces of tube, by their numbers in the frame.
    :ivar piece: (c,) which of the p pieces each is on.
    :ivar spacing: length of tube that each stands for [m].
    :ivar axis: (c,) direction of the tube.
    :ivar inside: (2, c, c) compliance within pieces, along and across the tube [m/N].
    :ivar spread: (2, c, 6 p) displacements along and across the tube by those of the pieces' ends.
    :ivar ends: (6 p, 6 p) compliance of the pieces' ends, in the frames of the pieces [m/N].
    :ivar dents: (c, c) compliance of the skin against the centre line, across the tube [m/N]; zero
        in the paper's model.
    """

    points: Points
    skin: Points
    member: Indices
    place: Array
    pieces: Indices
    piece: Indices
    spacing: float
    axis: Points
    inside: Array
    spread: Array
    ends: Array
    dents: Array

    def __getitem__(self, places: Indices) -> ContactPoints:
        """Return some of the points."""
        return ContactPoints(
            self.points[places],
            self.skin[places],
            self.member[places],
            self.place[places],
            self.pieces,
            self.piece[places],
            self.spacing,
            self.axis[places],
            self.inside[:, places][:, :, places],
            self.spread[:, places],
            self.ends,
            self.dents[places][:, places],
        )

    @cached_property
    def across(self) -> Array:
        """Return the compliance of the skin across the tube while the ends stand still, (c, c)."""
        return self.inside[1] + self.dents

    def normal_compliance(self, normals: Points) -> Array:
        """
        Return W = N^T (S^-1 + C) N of (8): how the skin gives along normals.

        :param normals: (c,) unit vectors x + iy along which unit forces act.
        :return: (c, c) symmetric [m/N].
        """
        local = self.axis.conj() * normals
        along, across = local.real[:, None], local.imag[:, None]
        lever = along * self.spread[0] + across * self.spread[1]
        matrix = lever @ self.ends @ lever.T
        matrix += along * along.T * self.inside[0]
        matrix += across * across.T * self.across
        return 0.5 * (matrix + matrix.T)

    def displacements(self, forces: Points) -> Points:
        """
        Return how the skin moves at all points, by the tubes' bending and its own dents.

        :param forces: (c,) x + iy [N].
        :return: (c,) x + iy [m].
        """
        local = self.axis.conj() * forces
        push = local.real @ self.spread[0] + local.imag @ self.spread[1]
        moved = self.spread @ (self.ends @ push)
        moved[0] += self.inside[0] @ local.real
        moved[1] += self.across @ local.imag
        return self.axis * (moved[0] + 1j * moved[1])

    @cached_property
    def _compliances(self) -> dict[bytes, Array]:
        """Return what `compliance` has found, by the bytes of the places."""
        return {}

    def compliance(self, places: Indices) -> Array:
        """
        Return displacements (2, a) along and across the tube for unit forces (2, a), [m/N]; kept.

        :param places: (a,) of which points.
        """
        key = places.tobytes()
        if key not in self._compliances:
            self._compliances[key] = self._compliance(places)
        return self._compliances[key]

    def _compliance(self, places: Indices) -> Array:
        """Compute what `compliance` returns."""
        count, square = len(places), np.ix_(places, places)
        spread = self.spread[:, places].reshape(2 * count, len(self.ends))
        matrix = (spread @ self.ends @ spread.T).reshape(2, count, 2, count)
        matrix[0, :, 0] += self.inside[0][square]
        matrix[1, :, 1] += self.across[square]
        return matrix


@dataclass(frozen=True, eq=False)
class ContactState:
    """
    Where and how hard the object is touched.

    :ivar forces: (c,) normal forces, not negative [N].
    :ivar gaps: (c,) distances of the deformed tube from the surface, not negative [m].
    :ivar normals: (c,) unit normals of the surface, outward, x + iy.
    :ivar displacements: (c,) of what meets the object, see `ContactPoints.skin`, x + iy [m].
    :ivar radii: (c,) radius of curvature of the surface at the feet of the points [m].
    :ivar push: (c,) forces on the tubes, x + iy [N].
    """

    forces: Array
    gaps: Array
    normals: Points
    displacements: Points
    radii: Array
    push: Points


class ContactGuess(NamedTuple):
    """
    Where a search for the contact begins.

    :ivar forces: (c,) normal forces of a similar problem [N]; points with one are taken to touch.
    :ivar normals: (c,) unit normals of one, x + iy; None for those of the undeformed tubes.
    """

    forces: Array
    normals: Points | None = None
