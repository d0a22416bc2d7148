# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where a convex object presses into tubes: with one corner, or with both ends of a face."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import Face, Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: Ends of a face that are nearer than this many tube radii along the tube share one dent.
LEAST_FACE = 1.0


@dataclass(frozen=True, eq=False)
class PressedContacts:
    """
    The k contacts of an object with members, which rise.

    :ivar members: (k,) numbers of the members.
    :ivar corners: (k,) corners of a polygon; zero of other shapes.
    :ivar cuts: (k, 2) how far the contact reaches before and behind, see `corner_dents` [m].
    """

    members: Indices
    corners: Indices
    cuts: Array

    @cached_property
    def owners(self) -> Indices:
        """Return (k,) 0 for the first of the grasping members, 1 for the next one."""
        return np.unique(self.members, return_inverse=True)[1]

    @cached_property
    def ends(self) -> list[Indices]:
        """Return which contacts each of the grasping members has: one, or both ends of a face."""
        return [np.flatnonzero(self.owners == i) for i in range(int(self.owners[-1]) + 1)]

    def without(self, dropped: int) -> PressedContacts:
        """
        Return the others; what was one end of a face reaches all along it now.

        :param dropped: number of the contact that lets go.
        """
        cuts = self.cuts.copy()
        cuts[self.owners == self.owners[dropped]] = np.inf
        every = self.members, self.corners, cuts
        return PressedContacts(*(np.delete(each, dropped, axis=0) for each in every))

    def with_others(self, others: PressedContacts) -> tuple[PressedContacts, Indices]:
        """
        Return these contacts and those with another member, in the order of the members.

        :param others: the contacts of the other member.
        :return: all; and (k,) numbers of these, then of the others, in the order of all.
        """
        order = np.argsort(np.append(self.members, others.members), kind='stable')
        pairs = (
            (self.members, others.members),
            (self.corners, others.corners),
            (self.cuts, others.cuts),
        )
        return PressedContacts(*(np.concatenate(pair)[order] for pair in pairs)), order

    def with_face(self, k: int, face: Face) -> tuple[PressedContacts, int]:
        """
        Return the contacts with the other end of a face as well, and its number among them.

        :param k: number of the contact with the first end.
        :param face: as seen from the corner there.
        """
        half, place = 0.5 * face.length, k + (face.step > 0)
        own, other = ((np.inf, half), (half, np.inf))[:: face.step]
        cuts = self.cuts.copy()
        cuts[k] = own
        laid = PressedContacts(
            np.insert(self.members, place, self.members[k]),
            np.insert(self.corners, place, face.corner),
            np.insert(cuts, place, other, axis=0),
        )
        return laid, place


def find_pressed(config: Configuration, body: ConvexObject, members: Indices) -> PressedContacts:
    """
    Return where members touch an object: with one corner, or both ends of a face.

    :param config: configuration of the robot.
    :param body: the object in its place.
    :param members: (m,) numbers of the members, which rise.
    """
    if not body.shape.faces_at(0):
        count = len(members)
        return PressedContacts(
            members, np.zeros(count, dtype=np.intp), np.full((count, 2), np.inf)
        )
    starts, normals = member_lines(config, body, members)
    own = normals * body.turn.conjugate()
    away = ((starts - body.center) * normals.conj()).real
    radius = 0.5 * config.robot.description.tube_diameter
    found: list[tuple[int, int, float, float]] = []
    for member, normal, distance in zip(
        members.tolist(), own.tolist(), away.tolist(), strict=True
    ):
        corner = body.shape.corners_at(normal, 0.0)[0]
        face = _deeper_face(body.shape, corner, normal)
        if face is None or not _is_laid(body.shape, corner, face, normal, distance, radius):
            found.append((member, corner, np.inf, np.inf))
            continue
        one, other = (corner, face.corner)[:: face.step]
        half = 0.5 * face.length
        found += [(member, one, np.inf, half), (member, other, half, np.inf)]
    numbers, corners, before, behind = zip(*found, strict=True)
    return PressedContacts(np.array(numbers), np.array(corners), np.column_stack([before, behind]))


def _is_laid(
    shape: Shape, corner: int, face: Face, normal: complex, distance: float, radius: float
) -> bool:
    """Return whether the other end of a face is in the tube too, and not in the same dent."""
    back, end = normal.conjugate(), shape.point_at(face.corner, normal)
    apart = face.step * ((end - shape.point_at(corner, normal)) * back).imag
    deep = (end * back).real - distance + radius
    return apart >= LEAST_FACE * radius and deep > 0.0


def _deeper_face(shape: Shape, corner: int, normal: complex) -> Face | None:
    """Return the face at a corner whose other end is farther out along a normal, if it has any."""
    faces = shape.faces_at(corner)
    if not faces:
        return None
    back = normal.conjugate()
    return max(faces, key=lambda face: (shape.point_at(face.corner, normal) * back).real)


def member_lines(
    config: Configuration, body: ConvexObject, members: Indices
) -> tuple[Points, Points]:
    """
    Return where members start, and their normals out of an object, (m,) each, x + iy [m].

    :param config: configuration of the robot.
    :param body: the object in its place.
    :param members: (m,) numbers of the members.
    """
    topology, points = config.robot.topology, config.points
    starts = points[topology.b[members]]
    spans = points[topology.c[topology.following[members]]] - starts
    axes = spans / np.abs(spans)
    aside = (axes.conj() * (body.middle - starts)).imag
    return starts, -1j * np.where(aside < 0.0, -axes, axes)
