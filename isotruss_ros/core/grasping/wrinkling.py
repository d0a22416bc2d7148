# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How near inflated tubes are to wrinkling under the contact forces.

Under the gauge pressure p and a compression N the wall carries the pull p pi R^2 - N. A bending
moment makes one side slack at M_w = (p pi R^2 - N) R / 2, where the wall begins to wrinkle; at
twice that the tube folds (Comer and Levy, AIAA Journal 1 (1963) 1652-1655). Beyond M_w the linear
model is void.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.grasping.contact import ContactState
from isotruss_ros.core.grasping.contact_points import ContactPoints
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.structure import Structure, tube_pieces
import numpy as np

#: Tubes are to bear at most this share of the moment at which they wrinkle.
MAX_UTILISATION = 0.8


@dataclass(frozen=True, eq=False)
class Wrinkling:
    """
    How near the tubes are to wrinkling.

    :ivar utilisation: (m,) largest |M| / M_w of each member; infinite where compression alone
        takes all of the pull.
    :ivar place: (m,) where along the member that is, from its start [m].
    :ivar tension: (c,) of the wall along the tube, on the side of the object, at the contact
        points; not negative [N/m].
    """

    utilisation: Array
    place: Array
    tension: Array


class SectionLoads(NamedTuple):
    """
    What the sections of the tubes bear where it is largest.

    :ivar moment: (c,) at the forces inside the pieces [N m].
    :ivar compression: (c,) there [N].
    :ivar utilisation: (c + 6m,) |M| / M_w there, at the starts and at the ends of all pieces.
    :ivar member: (c + 6m,) the members on which that is.
    """

    moment: Array
    compression: Array
    utilisation: Array
    member: Indices


def load_sections(
    structure: Structure,
    pressure: Array,
    end_forces: Array,
    piece: Indices,
    place: Array,
    local: Points,
    owner: Indices,
) -> SectionLoads:
    """
    Return moments and compressions of the tubes, and how near to wrinkling they bring them.

    :param structure: the frame of the robot.
    :param pressure: (m,) p in each member, gauge [Pa].
    :param end_forces: (k, 6) on all members of the frame, see `FrameState.end_forces`.
    :param piece: (c,) number of the member of the frame that each force inside acts on.
    :param place: (c,) distance from that member's start [m].
    :param local: (c,) the forces along + i across these members [N].
    :param owner: (c,) the members of the robot that they act on.
    """
    topology, file = structure.config.robot.topology, structure.config.robot.description
    m, radius = topology.n_modules, 0.5 * file.tube_diameter
    count, pieces = len(piece), 3 * m
    along, across = local.real, local.imag
    # At each force: all that acts on the piece between its start and there.
    apart = place[:, None] - place
    before = (piece[:, None] == piece) & (apart > 0.0)
    there = end_forces[piece]
    moment = there[:, 1] * place - there[:, 2] + np.where(before, apart, 0.0) @ across
    compression = there[:, 0] + before @ along
    compression = np.maximum(compression, compression + along)
    # At the ends of all pieces, of the moments the sizes alone.
    ends = end_forces[tube_pieces(m).ravel()]
    moments, left = np.empty(count + 2 * pieces), np.empty(count + 2 * pieces)
    first, second = slice(count, count + pieces), slice(count + pieces, None)
    moments[:count], moments[first], moments[second] = moment, ends[:, 2], ends[:, 5]
    left[:count], left[first], left[second] = -compression, -ends[:, 0], ends[:, 3]
    own = np.arange(m)
    of_pieces = np.concatenate([own, topology.previous, own])
    member = np.concatenate([owner, of_pieces, of_pieces])
    left += (pressure * (np.pi * radius**2))[member]
    used = np.full(len(moments), np.inf)
    np.divide(np.abs(moments), 0.5 * radius * left, out=used, where=left > 0.0)
    return SectionLoads(moment, compression, used, member)


def find_wrinkling(
    structure: Structure, pressure: Array, contact_points: ContactPoints, contact: ContactState
) -> Wrinkling:
    """
    Return how near the members of a robot are to wrinkling under contact forces.

    Moments are piecewise linear between the forces, and are largest at one of them or at an end
    of a piece of tube.

    :param structure: the frame of the robot.
    :param pressure: (m,) p in each member, gauge [Pa].
    :param contact_points: points that the object could touch.
    :param contact: where it does, and with what force.
    """
    config, frame = structure.config, structure.frame
    topology, file = config.robot.topology, config.robot.description
    m = topology.n_modules
    radius = 0.5 * file.tube_diameter
    pieces, touching = contact_points.pieces, np.flatnonzero(contact.forces > 0.0)
    local = contact.push * contact_points.axis.conj()
    # What moves the ends of the pieces as the forces inside do, which the pieces carry besides.
    pushed = local.real @ contact_points.spread[0] + local.imag @ contact_points.spread[1]
    pushed = pushed.reshape(-1, 6)
    end_forces = frame.end_forces(pieces, pushed)

    piece = pieces[contact_points.piece[touching]]
    start = frame.points[frame.members.start[piece]]
    place = np.abs(contact_points.points[touching] - start)
    local = local[touching]
    owner = contact_points.member[touching]
    sections = load_sections(structure, pressure, end_forces, piece, place, local, owner)
    used, member = sections.utilisation, sections.member
    length = frame.length[tube_pieces(m).ravel()]
    ring, whole = file.module.guide_ring_distance, config.member_lengths[topology.previous]
    starts = np.concatenate([np.zeros(m), whole, np.full(m, ring)])
    ends = starts + np.repeat([1.0, -1.0, 1.0], m) * length
    places = np.concatenate([contact_points.place[touching], starts, ends])
    order = np.lexsort((used, member))
    last = order[np.searchsorted(member[order], np.arange(m), side='right') - 1]

    # The force points away from the object, which presses the wall together on its own side.
    tension = (pressure * np.pi * radius**2)[contact_points.member]
    pressed = 2.0 / radius * sections.moment * np.sign(local.imag)
    tension[touching] += pressed - sections.compression
    tension /= 2.0 * np.pi * radius
    return Wrinkling(used[last], places[last], np.maximum(tension, 0.0))
