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

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Points
from isotruss_ros.core.statics.beam import Beams
from isotruss_ros.core.statics.structure import structure_of
import numpy as np

#: Points on each of the three pieces of a member: B to D, D to E', E' to C'.
SAMPLES = (2, 13, 2)


def deformed_lines(config: Configuration, analysis: GraspAnalysis) -> Points:
    """
    Return the centre lines (m, s) of the members under the contact forces, pinch to pinch [m].

    :param config: configuration of the robot.
    :param analysis: of a grasp in this configuration.
    :raises StructureError: the robot is a mechanism.
    """
    topology, structure = config.robot.topology, structure_of(config)
    frame, (first, last, middle) = structure.frame, structure.pieces
    touching = analysis.normal_forces > 0.0
    forces = analysis.normals[touching] @ np.array([1.0, 1.0j]) * analysis.normal_forces[touching]
    pressed = analysis.members[touching], analysis.places[touching]
    loaded, at_loads, _ = structure.locate(*pressed)
    # Points of the lines, then of the forces. C' is where the last piece starts, E' where it ends;
    # where a piece ends the next begins.
    parts = [(first, np.linspace(0.0, 1.0, SAMPLES[0]))]
    parts += [(middle, np.linspace(0.0, 1.0, SAMPLES[1])[1:])]
    parts += [(last[topology.following], np.linspace(1.0, 0.0, SAMPLES[2])[1:])]
    along = [frame.length[piece][:, None] * shares for piece, shares in parts]
    pieces = [np.repeat(piece[:, None], len(shares), axis=1) for piece, shares in parts]
    lines = np.concatenate(pieces, axis=1)
    piece = np.append(lines.ravel(), loaded)
    place = np.append(np.concatenate(along, axis=1).ravel(), at_loads)
    drawn = lines.size
    shapes, _ = Beams(*(each[piece] for each in frame.beams)).points(np.arange(len(piece)), place)
    local = forces * frame.axis[loaded].conj()
    # What moves the ends of the pieces as the forces do.
    bearing, which = np.unique(loaded, return_inverse=True)
    pushed = np.zeros((len(bearing), 6))
    of_loads = shapes[drawn:]
    carried = local.real[:, None] * of_loads[:, 0] + local.imag[:, None] * of_loads[:, 1]
    np.add.at(pushed, which, carried)
    moved = frame.displacements(bearing, pushed.reshape(-1, 1))[:, :, 0]
    own, drawn_on = frame.members, piece[:drawn]
    ends = np.concatenate([moved[own.start[drawn_on]], moved[own.end[drawn_on]]], axis=1)
    ends = np.einsum('cij,cj->ci', frame.turn[drawn_on], ends)
    bent = np.einsum('cie,ce->ci', shapes[:drawn], ends) @ np.array([1.0, 1.0j])
    # What the pieces that carry forces give besides.
    here = np.flatnonzero(np.isin(piece, bearing))
    beams = Beams(*(each[bearing] for each in frame.beams))
    _, inside = beams.points(np.searchsorted(bearing, piece[here]), place[here])
    pulled, pressed = inside[:, :, here >= drawn]
    bent[here[here < drawn]] += (pulled @ local.real + 1j * (pressed @ local.imag))[here < drawn]
    start, axis = frame.points[own.start[drawn_on]], frame.axis[drawn_on]
    return (start + axis * (place[:drawn] + bent)).reshape(lines.shape)


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
