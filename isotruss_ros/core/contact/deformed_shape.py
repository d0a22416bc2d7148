# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The lines by which a grasp is drawn: tubes as they were and bent, forces, contact regions."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.interior import interior_points
from isotruss_ros.core.statics.structure import structure_of, tube_pieces
import numpy as np

#: Points on each of the three pieces of a member: B to D, D to E', E' to C'.
SAMPLES = (2, 13, 2)


class TubeLoad(NamedTuple):
    """
    Forces at points inside members of a frame.

    :ivar piece: (c,) number of the member of the frame that each force acts on.
    :ivar place: (c,) distance from that member's start [m].
    :ivar local: (c,) the forces along + i across that member [N].
    """

    piece: Indices
    place: Array
    local: Points


def deformed_lines(config: Configuration, analysis: GraspAnalysis) -> Points:
    """
    Return the centre lines (m, s) of the members under the contact forces, pinch to pinch [m].

    :param config: configuration of the robot.
    :param analysis: of a grasp in this configuration.
    :raises StructureError: the robot is a mechanism.
    """
    topology, frame = config.robot.topology, structure_of(config).frame
    m = topology.n_modules
    first, last, middle = tube_pieces(m)
    touching = analysis.normal_forces > 0.0
    forces = analysis.normals[touching] @ np.array([1.0, 1.0j]) * analysis.normal_forces[touching]
    loaded, places = _on_pieces(config, analysis.members[touching], analysis.places[touching])
    load = TubeLoad(loaded, places, forces * frame.axis[loaded].conj())
    moved = _displacements(frame, load)
    # C' is where the last piece starts, E' where it ends.
    parts = [(first, False), (middle, False), (last[topology.following], True)]
    lines = []
    for (piece, backward), count in zip(parts, SAMPLES, strict=True):
        line = _line(frame, piece, count, load, moved)
        lines.append(line[:, ::-1] if backward else line)
    # Where a piece ends the next begins.
    return np.concatenate([lines[0], lines[1][:, 1:], lines[2][:, 1:]], axis=1)


def force_lines(body: ConvexObject, analysis: GraspAnalysis, scale: float) -> Points:
    """
    Return (k, 2) tails and tips [m] of the forces on the object, which push at its surface.

    :param body: the object.
    :param analysis: of the grasp.
    :param scale: length for a force [m/N].
    """
    touching = analysis.normal_forces > 0.0
    normals = analysis.normals[touching] @ np.array([1.0, 1.0j])
    forces = 1j * analysis.friction_forces[touching] - analysis.normal_forces[touching]
    tips = _feet(body, analysis.points[touching] @ np.array([1.0, 1.0j]))
    return np.stack([tips - scale * forces * normals, tips], axis=1)


def region_lines(
    config: Configuration, body: ConvexObject, analysis: GraspAnalysis
) -> list[Points]:
    """
    Return the regions of contact along the object's surface, (k,) points each [m].

    :param config: where the robot is.
    :param body: the object.
    :param analysis: of its grasp in this configuration.
    :return: in the order of `GraspAnalysis.contact_spans`.
    """
    regions = []
    for name, (start, end) in analysis.contact_spans.items():
        here = np.flatnonzero(analysis.members == config.robot.member_names.index(name))
        here = here[np.argsort(analysis.places[here])]
        places, points = analysis.places[here], analysis.points[here]
        inside = places[(places > start) & (places < end)]
        along = np.concatenate([[start], inside, [end]])
        met = np.interp(along, places, points[:, 0]) + 1j * np.interp(along, places, points[:, 1])
        regions.append(_feet(body, met))
    return regions


def _feet(body: ConvexObject, points: Points) -> Points:
    """Return what is nearest to points on the object's surface, (c,) [m]."""
    found = body.nearest(points)
    return points - found.gaps * found.normals


def _on_pieces(config: Configuration, member: Indices, place: Array) -> tuple[Indices, Array]:
    """Return the piece of tube that each place of a member is on, and how far from its start."""
    topology = config.robot.topology
    ring = config.robot.description.module.guide_ring_distance
    length = config.member_lengths[member]
    first, last, middle = tube_pieces(topology.n_modules)
    pieces = np.select(
        [place < ring, place > length - ring],
        [first[member], last[topology.following[member]]],
        middle[member],
    )
    along = np.select([place < ring, place > length - ring], [place, length - place], place - ring)
    return pieces, along


def _displacements(frame: Frame, load: TubeLoad) -> Array:
    """Return the displacements of the nodes, (n, 3), see `FrameState`."""
    shapes = interior_points(frame, load.piece, np.arange(len(load.piece)), load.place).shapes()
    # What moves the ends of the members as the forces do.
    carried = load.local.real[:, None] * shapes[:, 0] + load.local.imag[:, None] * shapes[:, 1]
    pushed = np.einsum('cji,cj->ci', frame.to_member_frame(load.piece), carried)
    loads = np.zeros((len(frame.points), 3))
    np.add.at(loads, frame.members.start[load.piece], pushed[:, :3])
    np.add.at(loads, frame.members.end[load.piece], pushed[:, 3:])
    return frame.solve(loads).displacements


def _line(frame: Frame, pieces: Indices, count: int, load: TubeLoad, ends: Array) -> Points:
    """Return points (p, count) of bent pieces, by displacements (n, 3) of the nodes [m]."""
    start, axis = frame.points[frame.members.start[pieces]], frame.axis[pieces]
    place = frame.length[pieces, None] * np.linspace(0.0, 1.0, count)
    member = np.repeat(np.arange(len(pieces)), count)
    shapes = (
        interior_points(frame, pieces, member, place.ravel()).shapes()
        @ frame.to_member_frame(pieces)[member]
    )
    moved = np.concatenate(
        [ends[frame.members.start[pieces]], ends[frame.members.end[pieces]]], axis=1
    )
    local = np.einsum('cie,ce->ci', shapes, moved[member]) @ np.array([1.0, 1.0j])
    local = local.reshape(place.shape)
    for i in np.flatnonzero(np.isin(pieces, load.piece)):
        here = load.piece == pieces[i]
        both = np.concatenate([place[i], load.place[here]])
        alone = np.zeros(len(both), dtype=int)
        along, across = interior_points(frame, pieces[[i]], alone, both).compliance()
        pull = load.local[here]
        bent = along[:count, count:] @ pull.real + 1j * (across[:count, count:] @ pull.imag)
        local[i] += bent
    return start[:, None] + axis[:, None] * (place + local)
