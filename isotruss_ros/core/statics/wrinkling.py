# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How near inflated tubes are to wrinkling under loads.

Under the gauge pressure p and a compression N the wall carries the pull p pi R^2 - N. A bending
moment makes one side slack at M_w = (p pi R^2 - N) R / 2, where the wall begins to wrinkle; at
twice that the tube folds (Comer and Levy, AIAA Journal 1 (1963) 1652-1655). Beyond M_w the linear
model is void.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.frame import Frame, FrameState
from isotruss_ros.core.statics.structure import Structure
import numpy as np

#: Tubes are to bear at most this share of the moment at which they wrinkle.
MAX_UTILISATION = 0.8
#: Keeps divisions by the wave of a moment defined where there is none [rad].
TINY = 1e-9


class SectionLoads(NamedTuple):
    """
    What the sections of the tubes bear where it is largest.

    :ivar moment: (c,) of the member, on the side of the loads where their piece begins [N m].
    :ivar compression: (c,) there, the larger of both sides of the load [N].
    :ivar utilisation: (m,) largest |M| / M_w of each member; infinite where compression alone
        takes all of the pull.
    :ivar place: (m,) where along the member that is, from its start [m].
    """

    moment: Array
    compression: Array
    utilisation: Array
    place: Array


def wrinkling_moment(pressure: float, radius: float) -> float:
    """
    Return M_w = p pi R^3 / 2 of a tube without axial force [N m].

    :param pressure: p, gauge [Pa].
    :param radius: R of the tube [m].
    """
    return 0.5 * np.pi * pressure * radius**3


def load_sections(
    structure: Structure,
    end_forces: Array,
    member: Indices,
    place: Array,
    local: Points,
    couples: Array,
) -> SectionLoads:
    """
    Return moments and compressions of the tubes, and how near to wrinkling they bring them.

    Moments are piecewise linear between the loads, and are largest at one of them or at an end
    of a piece of tube.

    :param structure: the frame of the robot.
    :param end_forces: (k, 6) on all members of the frame, see `FrameState.end_forces`.
    :param member: (c,) the members of the robot that the loads act on.
    :param place: (c,) distance from that member's start [m].
    :param local: (c,) the forces along + i across these members [N].
    :param couples: (c,) with them, counter-clockwise [N m].
    """
    config, frame = structure.config, structure.frame
    topology, file = config.robot.topology, config.robot.description
    m, radius = topology.n_modules, 0.5 * file.tube_diameter
    piece, within, ahead = structure.locate(member, place)
    along, across = ahead * local.real, ahead * local.imag
    # At each load: all that acts on the piece between its start and there.
    apart = within[:, None] - within
    before = (piece[:, None] == piece) & (apart > 0.0)
    there = end_forces[piece]
    moment = there[:, 1] * within - there[:, 2] - before @ couples
    moment += np.where(before, apart, 0.0) @ across
    compression = there[:, 0] + before @ along
    # At the ends of all pieces, of the moments the sizes alone.
    pieces, owners = structure.pieces.ravel(), structure.owners.ravel()
    ends, length = end_forces[pieces], frame.length[pieces]
    ring, whole = file.module.guide_ring_distance, config.member_lengths[topology.previous]
    starts = np.concatenate([np.zeros(m), whole, np.full(m, ring)])
    stops = starts + np.repeat([1.0, -1.0, 1.0], m) * length
    moments = np.concatenate([moment, moment - couples, ends[:, 2], ends[:, 5]])
    left = np.concatenate([-compression, -compression - along, -ends[:, 0], ends[:, 3]])
    members = np.concatenate([member, member, owners, owners])
    pressure = np.array(structure.pressures)[topology.tube]
    left += (pressure * (np.pi * radius**2))[members]
    used = np.full(len(moments), np.inf)
    np.divide(np.abs(moments), 0.5 * radius * left, out=used, where=left > 0.0)
    places = np.concatenate([place, place, starts, stops])
    last = find_most_used(used, members)
    larger = np.maximum(compression, compression + along)
    return SectionLoads(ahead * moment, larger, used[last], places[last])


def find_utilisation(structure: Structure, frame: Frame, state: FrameState) -> tuple[Array, Array]:
    """
    Return how near to wrinkling loads bring the members of a robot, and where they are nearest.

    Between loads the moment of a compressed piece is part of a sine, which may peak inside.

    :param structure: of the robot.
    :param frame: its frame, cut where tubes bear loads.
    :param state: the response to the loads.
    :return: (m,) largest |M| / M_w of each member, infinite where compression alone takes all of
        the pull; and (m,) its distance from the member's start [m].
    """
    config = structure.config
    topology, radius = config.robot.topology, 0.5 * config.robot.description.tube_diameter
    first = structure.pieces[0, 0]
    pieces = np.flatnonzero(frame.whole >= first)
    member = structure.owners.ravel()[frame.whole[pieces] - first]
    length, flexural, shear = frame.length[pieces], *(x[pieces] for x in frame.members[3:5])
    ends, pull = state.end_forces[pieces], state.bowing[pieces]
    begin, end = -ends[:, 2], ends[:, 5]
    # M = begin cos(k x) + sine sin(k x); without compression the ends bear most.
    wave = np.sqrt(np.maximum(-pull, 0.0) / flexural / (1.0 + pull / shear))
    turned = np.maximum(wave * length, TINY)
    sine = (end - begin * np.cos(turned)) / np.sin(turned)
    crest = np.arctan2(sine, begin) % np.pi
    inside = np.where((wave > 0.0) & (crest < turned), crest / turned * length, 0.0)
    peak = np.where(inside > 0.0, np.hypot(begin, sine), np.abs(begin))
    moments = np.concatenate([begin, end, peak])
    start = config.points[topology.b[member]]
    along = (config.points[topology.c[topology.following[member]]] - start).conj()
    along /= np.abs(along)
    origin = ((frame.points[frame.members.start[pieces]] - start) * along).real
    ahead = (frame.axis[pieces] * along).real
    places = np.concatenate([origin, origin + ahead * length, origin + ahead * inside])
    wall = np.pi * radius**2 * np.array(structure.pressures)[topology.tube[member]]
    left = np.concatenate([wall - ends[:, 0], wall + ends[:, 3], wall + ends[:, 3]])
    used = np.full(len(moments), np.inf)
    np.divide(2.0 * np.abs(moments), radius * left, out=used, where=left > 0.0)
    last = find_most_used(used, np.tile(member, 3))
    return used[last], places[last]


def find_most_used(used: Array, member: Indices) -> Indices:
    """
    Return the places, one of each member, that are used most, (m,).

    :param used: (c,) |M| / M_w at places on all members.
    :param member: (c,) the member that each is on.
    """
    order = np.lexsort((used, member))
    return order[np.flatnonzero(np.diff(member[order], append=-1))]
