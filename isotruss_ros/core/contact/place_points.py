# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""Where along the tubes an object could touch them."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.contact.contact_points import ContactPoints
from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.contact.surfaces import Surface
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.statics.interior import interior_points
from isotruss_ros.core.statics.structure import Structure, tube_pieces
import numpy as np

#: Points closer than this are one, as a share of the spacing.
SAME = 1e-6


def find_contact_points(
    structure: Structure,
    surface: Surface,
    spacing: float,
    flattening: Flattening | None = None,
    windows: Array | None = None,
) -> ContactPoints:
    """
    Place contact points on every piece of tube that comes within reach of an object.

    :param structure: the frame of the robot.
    :param surface: what the points meet: the object's own surface, or where the tubes do not
        flatten that which is farther out by half of the tube's diameter.
    :param spacing: distance of the points along the tube [m].
    :param flattening: how the tubes flatten; None for the paper's model, in which they do not.
    :param windows: (m, 2) between which points of each member, from its start, points are placed;
        everywhere if None [m].
    """
    topology, frame = structure.config.robot.topology, structure.frame
    width = 0.0 if flattening is None else flattening.radius
    tubes = _tube_pieces(structure, surface.center)
    low, high = _reach(tubes, surface, spacing, width)
    if windows is not None:
        bounds = tubes.ahead[:, None] * (windows[tubes.owner] - tubes.base[:, None])
        low, high = np.maximum(low, bounds.min(axis=1)), np.minimum(high, bounds.max(axis=1))
    near = np.flatnonzero(high > low)
    tubes = _TubePieces(*(values[near] for values in tubes))
    piece, place = _place_points(tubes, low[near], high[near], spacing)
    at = _TubePieces(*(values[piece] for values in tubes))
    inside = interior_points(frame, tubes.number, piece, place)
    spread = np.zeros((2, len(place), len(near), 6))
    spread[:, np.arange(len(place)), piece] = inside.shapes().swapaxes(0, 1)
    points = at.start + place * at.axis
    # All on one line: places along the member, from those along its pieces.
    in_line = at.base + at.ahead * place
    skin, dents = points, np.zeros((len(place), len(place)))
    if flattening is not None:
        line = at.ahead * at.axis
        toward = np.where(at.ahead * at.away.imag < 0.0, -1j, 1j) * line
        skin = points + flattening.radius * toward
        dents = flattening.compliance(in_line, at.owner, topology.tube[at.owner], spacing)
        if (tubes.ahead < 0.0).any():
            dents = dents * np.outer(at.ahead, at.ahead)
    return ContactPoints(
        points,
        skin,
        at.owner,
        in_line,
        tubes.number,
        piece,
        spacing,
        at.axis,
        inside.compliance(),
        spread.reshape(2, len(place), 6 * len(near)),
        frame.compliance(tubes.number),
        dents,
    )


class _TubePieces(NamedTuple):
    number: Indices  # (p,) among the members of the frame
    owner: Indices  # (p,) the member of the robot that each is part of
    long: Flags  # (p,) whether it is the long one, DE'
    start: Points  # (p,) [m]
    axis: Points  # (p,) direction
    length: Array  # (p,) [m]
    away: Points  # (p,) the object's centre from the start, along + i across [m]
    ahead: Array  # (p,) 1 where it runs along its member, -1 where it runs backward
    base: Array  # (p,) place of its start along its member [m]


def _tube_pieces(structure: Structure, center: complex) -> _TubePieces:
    """Return the pieces of all tubes."""
    topology, frame = structure.config.robot.topology, structure.frame
    m = topology.n_modules
    pieces = tube_pieces(m).ravel()
    owner = np.concatenate([np.arange(m), topology.previous, np.arange(m)])
    start = frame.points[frame.members.start[pieces]]
    length, axis = frame.length[pieces], frame.axis[pieces]
    # All pieces of a member are one line, that of the long piece, whichever way they run.
    line, origin = axis[2 * m + owner], start[2 * m + owner]
    ahead, base = (axis * line.conj()).real, length[owner] + ((start - origin) * line.conj()).real
    long, away = np.arange(3 * m) >= 2 * m, (center - start) * axis.conj()
    return _TubePieces(pieces, owner, long, start, axis, length, away, ahead, base)


def _reach(
    tubes: _TubePieces, surface: Surface, spacing: float, width: float
) -> tuple[Array, Array]:
    """
    Return between which distances from their starts pieces come within reach of an object.

    :param width: half of that of the tubes [m].
    """
    # A tube that gives elsewhere may come into contact beyond the chord of the object.
    reach, foot = surface.reach + 2.0 * spacing, tubes.away.real
    off = np.abs(tubes.away.imag) - width
    chord = np.sqrt(np.maximum(0.0, reach**2 - np.maximum(off, 0.0) ** 2))
    low, high = np.maximum(0.0, foot - chord), np.minimum(tubes.length, foot + chord)
    normals, distances = surface.tangents
    if len(normals):
        start, room = tubes.start - surface.center, distances + 2.0 * spacing
        first, last = _clip(start, tubes.axis, normals, room, width)
        low, high = np.maximum(low, first), np.minimum(high, last)
    return np.where(off < reach, low, np.inf), high


def _place_points(
    tubes: _TubePieces, low: Array, high: Array, spacing: float
) -> tuple[Indices, Array]:
    """Return the piece (c,) that each point is on, and where, from its start [m]."""
    # Counted from the foot of the centre, where contact begins: what is symmetric stays so.
    # A guide ring, where two pieces meet, is a point of the long one alone: twice the same point
    # would leave it open which of them takes the force.
    foot, long = tubes.away.real, tubes.long
    first = np.ceil((low - foot) / spacing - SAME * long).astype(int)
    last = np.floor((high - foot) / spacing + np.where(long, SAME, -SAME)).astype(int)
    counts = last - first + 1
    piece = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts - first, counts)
    place = foot[piece] + spacing * number
    return piece, np.minimum(np.maximum(place, 0.0), tubes.length[piece])


def _clip(
    start: Points, axis: Points, normals: Points, distances: Array, width: float
) -> tuple[Array, Array]:
    """
    Return between which distances from their starts strips (p,) are within all of some tangents.

    :param start: (p,) relative to the point that the tangents' distances are measured from [m].
    :param width: half of that of the strips [m].
    """
    # Of the two edges of a strip, the one that is farther inside.
    slope = (axis[:, None] * normals.conj()).real
    lean = np.abs((axis[:, None] * normals.conj()).imag)
    room = distances - (start[:, None] * normals.conj()).real + width * lean
    with np.errstate(divide='ignore', invalid='ignore'):
        place = room / slope
    low = np.where(slope < 0.0, place, -np.inf).max(axis=1)
    high = np.where(slope > 0.0, place, np.inf).min(axis=1)
    apart = ((slope == 0.0) & (room < 0.0)).any(axis=1)
    return np.where(apart, np.inf, low), high
