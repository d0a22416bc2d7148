# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where a convex object presses into tubes, and the equations of its equilibrium there."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core.holding.contact_statics import ContactStatics, surface_points
from isotruss_ros.core.holding.corner_dents import corner_dents
from isotruss_ros.core.holding.indentation import (
    Indentation,
    no_indentation,
    skin_indentation,
    SkinIndentation,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.member_compliance import MemberCompliance
from isotruss_ros.core.statics.pressures import Pressure
from isotruss_ros.core.statics.structure import structure_of
import numpy as np

#: A shorter face than this many tube radii is touched in one place: its ends share one dent.
LEAST_FACE = 1.0
#: Objects that only touch are taken to be this deep, as a share of their size.
LEAST_DEPTH = 1e-3


@dataclass(frozen=True, eq=False)
class PressedContacts:
    """
    The k contacts of an object with members.

    :ivar members: (k,) numbers of the members.
    :ivar owners: (k,) 0 for the first of the grasping members, 1 for the next one.
    :ivar corners: (k,) corners of a polygon; zero of other shapes.
    :ivar cuts: (k, 2) how far the contact reaches before and behind, see `corner_dents` [m].
    """

    members: Indices
    owners: Indices
    corners: Indices
    cuts: Array

    def without(self, dropped: int) -> PressedContacts:
        """
        Return the others; what was one end of a face reaches all along it now.

        :param dropped: number of the contact that lets go.
        """
        kept = np.delete(np.arange(len(self.members)), dropped)
        cuts = self.cuts.copy()
        cuts[self.owners == self.owners[dropped]] = np.inf
        owners = np.unique(self.members[kept], return_inverse=True)[1]
        return PressedContacts(self.members[kept], owners, self.corners[kept], cuts[kept])

    def with_others(self, others: PressedContacts) -> tuple[PressedContacts, Indices]:
        """
        Return these contacts and those with another member, in the order of the members.

        :param others: the contacts of the other member.
        :return: all; and (k,) numbers of these, then of the others, in the order of all.
        """
        members = np.concatenate([self.members, others.members])
        order = np.argsort(members, kind='stable')
        owners = np.unique(members, return_inverse=True)[1]
        corners = np.concatenate([self.corners, others.corners])
        cuts = np.concatenate([self.cuts, others.cuts])
        every = PressedContacts(members[order], owners[order], corners[order], cuts[order])
        return every, order


def find_pressed(config: Configuration, body: ConvexObject, members: Indices) -> PressedContacts:
    """
    Return where members touch an object: with one corner, or both ends of a face.

    :param config: configuration of the robot.
    :param body: the object in its place.
    :param members: (m,) numbers of the members.
    """
    shape, count = body.shape, len(members)
    owners = corners = np.zeros(count, dtype=np.intp)
    owners = np.arange(count)
    cuts = np.full((count, 2), np.inf)
    if not isinstance(shape, Polygon):
        return PressedContacts(members, owners, corners, cuts)
    starts, normals = _lines(config, body, members)
    own = normals * body.turn.conjugate()
    away = ((starts - body.center) * normals.conj()).real
    radius = 0.5 * config.robot.description.tube_diameter
    found: list[tuple[int, int, float, float]] = []
    for i, (normal, distance) in enumerate(zip(own, away, strict=True)):
        # How deep the corners' arcs are in the tube.
        heights = (shape.arc_centers * normal.conjugate()).real + shape.radii
        depths = heights - distance + radius
        first = int(heights.argmax())
        after, before = (first + 1) % len(heights), (first - 1) % len(heights)
        second = after if depths[after] > depths[before] else before
        face = abs(shape.arc_centers[second] - shape.arc_centers[first])
        if depths[second] <= 0.0 or face < LEAST_FACE * radius:
            found.append((i, first, np.inf, np.inf))
            continue
        one, other = (first, second) if second == after else (second, first)
        found += [(i, one, np.inf, 0.5 * face), (i, other, 0.5 * face, np.inf)]
    owners = np.array([row[0] for row in found])
    return PressedContacts(
        members[owners],
        owners,
        np.array([row[1] for row in found]),
        np.array([row[2:] for row in found]),
    )


def contact_statics(
    config: Configuration,
    body: ConvexObject,
    contacts: PressedContacts,
    stiffness_scale: float = 1.0,
    flattening: bool = True,
    pressure: Pressure | None = None,
    normals: Points | None = None,
) -> ContactStatics:
    """
    Return the equations of an object at some contacts.

    :param config: configuration of the robot.
    :param body: the object in its place.
    :param contacts: its contacts.
    :param stiffness_scale: stiffness of the robot against that of the model.
    :param flattening: whether the tubes' sections flatten where they are touched.
    :param pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
    :param normals: (k,) of the tubes as they are bent, for the dents; straight ones if None.
    :raises StructureError: see `structure_of`.
    """
    structure = structure_of(config, pressure)
    compliance = MemberCompliance(structure, contacts.members, stiffness_scale)
    aside = (compliance.axis.conj() * (body.middle - compliance.start)).imag
    sides = np.where(aside > 0.0, -1.0, 1.0)
    dents = no_indentation
    if flattening:
        pressures = None if pressure is None else structure.pressures
        straight = 1j * sides * compliance.axis
        bent = straight if normals is None else normals
        tables = _dents(config, body, contacts, bent, pressures)
        dents = Indentation(tables, stiffness_scale)
    radius = 0.5 * config.robot.description.tube_diameter
    return ContactStatics(
        compliance, body, contacts.owners, contacts.corners, radius, sides, dents
    )


def moved_statics(
    before: ContactStatics,
    config: Configuration,
    contacts: PressedContacts,
    stiffness_scale: float,
    pressure: Pressure | None,
) -> ContactStatics:
    """
    Return the equations of the same contacts in another configuration, with the same dents.

    :param before: the equations so far.
    :param config: configuration of the robot, near to that of these.
    :param contacts: the contacts of these.
    :param stiffness_scale: stiffness of the robot against that of the model.
    :param pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
    :raises StructureError: see `structure_of`.
    """
    structure = structure_of(config, pressure)
    compliance = MemberCompliance(structure, contacts.members, stiffness_scale)
    return replace(before, compliance=compliance)


def start_at(statics: ContactStatics, body: ConvexObject) -> Array:
    """
    Return unknowns (3 + 4k,) to begin the search for an equilibrium with.

    :param statics: the equations.
    :param body: the object where it was measured.
    """
    places, compliance = statics.places, statics.compliance
    start = np.zeros(places.size)
    start[:3] = body.center.real, body.center.imag, body.pose.angle
    normals = statics.straight_normals
    points, _ = surface_points(body.shape, normals * body.turn.conjugate(), statics.corners)
    touched = body.center + body.turn * points
    local = compliance.axis.conj() * (touched - compliance.start)
    start[places.feet] = np.clip(local.real, 0.0, compliance.length)
    depths = statics.tube_radius + statics.sides * local.imag
    depths = np.maximum(depths, LEAST_DEPTH * statics.arm)
    own = np.einsum('iaia->ia', compliance.at(start[places.feet]).matrix)[:, 1]
    _, dent = statics.indentation(depths / own)
    start[places.normal] = depths / (own + dent)
    return start


def _lines(config: Configuration, body: ConvexObject, members: Indices) -> tuple[Points, Points]:
    """Return starts and normals (m,) of members, the latter out of the object."""
    topology, points = config.robot.topology, config.points
    starts = points[topology.b[members]]
    spans = points[topology.c[topology.following[members]]] - starts
    axes = spans / np.abs(spans)
    aside = (axes.conj() * (body.middle - starts)).imag
    return starts, -1j * np.where(aside < 0.0, -axes, axes)


def _dents(
    config: Configuration,
    body: ConvexObject,
    contacts: PressedContacts,
    normals: Points,
    pressures: tuple[float, ...] | None,
) -> list[SkinIndentation]:
    """Return the dents at all contacts."""
    own = normals * body.turn.conjugate()
    points, _ = surface_points(body.shape, own, contacts.corners)
    tubes = config.robot.topology.tube[contacts.members]
    if isinstance(body.shape, Disc):
        radius = 0.5 * body.shape.diameter
        return [skin_indentation(config.robot, int(tube), radius, pressures) for tube in tubes]
    return [
        corner_dents(
            config.robot,
            int(tube),
            body.shape,
            complex(normal),
            complex(point),
            (float(cut[0]), float(cut[1])),
            pressures,
        )
        for tube, normal, point, cut in zip(tubes, own, points, contacts.cuts, strict=True)
    ]
