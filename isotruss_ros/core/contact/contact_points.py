# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact points of the tubes, with the compliance of the robot."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.contact.surfaces import Surface
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.beam import Beams
from isotruss_ros.core.statics.bent_tubes import BentTubes, Displaced, straight_tubes
from isotruss_ros.core.statics.structure import Structure
import numpy as np


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """
    Possible contact points of the tubes, with the compliance of the whole robot.

    They are in the order of the members, and of the places on these.

    Displacements of the points are those of the ends of the p pieces of tube that they are on,
    spread by shape functions, and those inside the pieces: the factors are kept, not the product.
    Both are along and across the members, so that no matrix has to be turned.

    :ivar points: (c,) on the centre lines, x + iy [m]: where they would be without forces, if they
        were as stiff as in the bent state.
    :ivar skin: (c,) what the object meets: the skin beside each point, toward the object; in the
        paper's model the centre line again [m].
    :ivar member: (c,) the member (pinch to pinch) that each is on.
    :ivar place: (c,) distance of each from its member's start [m].
    :ivar pieces: (p,) the pieces of tube, by their numbers in the frame.
    :ivar piece: (c,) which of the p pieces each is on.
    :ivar spacing: length of tube that each stands for [m].
    :ivar axis: (c,) direction of the bent member there, across its section.
    :ivar inside: (2, c, c) compliance within pieces, along and across the tube [m/N].
    :ivar spread: (2, c, 6 p) displacements along and across the tube by those of the pieces' ends.
    :ivar ends: (6 p, 6 p) compliance of the pieces' ends, in the frames of the pieces [m/N].
    :ivar dents: (c, c) compliance of the skin against the centre line, across the tube [m/N]; zero
        in the paper's model.
    :ivar bent: the tubes, linearised; None for points of no robot.
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
    bent: BentTubes | None = None
    _kept: dict[bytes, Array] = field(default_factory=dict, init=False, repr=False)

    def pushed(self, push: Points) -> Array:
        """
        Return the loads (6 p,) on the ends of the pieces that move these as forces on points do.

        :param push: (c,) x + iy [N].
        """
        local = self.axis.conj() * push
        return local.real @ self.spread[0] + local.imag @ self.spread[1]

    def end_forces(self, push: Points) -> Array:
        """
        Return the forces of the nodes on all members of the frame, see `FrameState.end_forces`.

        :param push: (c,) forces on the points, x + iy [N].
        """
        tangent, frame = self.bent.tangent, self.bent.frame
        moved = self._move(push)[0][frame.places(np.arange(len(frame.length)))]
        forces = tangent.stiffness @ (tangent.turn @ moved[:, :, None])
        forces = tangent.end_forces + forces[:, :, 0]
        forces[self.pieces] -= self.pushed(push).reshape(-1, 6)
        return forces

    def bows(self, displacements: Points, push: Points) -> Array:
        """
        Return the distances of bent centre lines from the chords of their pieces, (c,) [m].

        Zero as long as tubes are linear about straight ones.

        :param displacements: (c,) of the skin, x + iy [m].
        :param push: (c,) forces on the tubes, x + iy [N].
        """
        if self.bent.is_straight:
            return np.zeros(len(self.points))
        tangent, frame, part = self.bent.tangent, self.bent.frame, self.pieces[self.piece]
        first = frame.members.start[part]
        begin = frame.points[first] + tangent.displacements[first] @ (1.0, 1j, 0.0)
        away = self.bend(displacements, push) - begin
        return (away * tangent.axis[part].conj()).imag

    def _move(self, push: Points) -> tuple[Array, Array]:
        """Return how nodes (3 n,) and multipliers (c,) move under forces on the points."""
        response, pushed = self.bent.tangent.under_end_loads(self.pieces), self.pushed(push)
        ways = np.append(pushed, 1.0)
        return response.moved @ ways, response.multipliers @ ways

    def displace(self, push: Points, share: float = 1.0) -> Displaced:
        """
        Return where the frame is under forces on the points, as far as it is linear.

        :param push: (c,) x + iy [N].
        :param share: of the way there [-].
        """
        moved, multipliers = (share * each for each in self._move(push))
        tangent, frame, moved = self.bent.tangent, self.bent.frame, moved.reshape(-1, 3)
        changes, _ = frame.force_changes(tangent, moved[..., None])
        return Displaced(
            tangent.displacements + moved,
            tangent.multipliers + multipliers,
            np.zeros((len(self.bent.places), 3)),
            tangent.forces.pull + changes[:, 0, 0],
        )

    def distance(self, push: Points) -> float:
        """
        Return how far forces on the points move the nodes from where tubes are linearised [m].

        :param push: (c,) x + iy [N].
        """
        return float(np.abs(self._move(push)[0].reshape(-1, 3)[:, :2]).max())

    def about(self, bent: BentTubes) -> ContactPoints:
        """
        Return the same points of tubes that are linearised about another state.

        :param bent: the tubes.
        """
        found = points_on_members(bent, self.member, self.place, self.spacing)
        skin = found.points + (self.skin - self.points) / self.axis * found.axis
        return replace(found, skin=skin, dents=self.dents)

    @cached_property
    def across(self) -> Array:
        """Return the transverse compliance of the skin with fixed ends, (c, c)."""
        return self.inside[1] + self.dents

    def normal_compliance(self, normals: Points) -> Array:
        """
        Return W = N^T (S^-1 + C) N of (8), the compliance of the skin along normals.

        :param normals: (c,) unit vectors x + iy along which unit forces act.
        :return: (c, c) symmetric but for rounding [m/N].
        """
        local = self.axis.conj() * normals
        along, across = local.real[:, None], local.imag[:, None]
        lever = along * self.spread[0] + across * self.spread[1]
        matrix = lever @ self.ends @ lever.T
        matrix += along * along.T * self.inside[0]
        return matrix + across * across.T * self.across

    def displacements(self, forces: Points) -> Points:
        """
        Return the displacements of the skin at all points, by bending and dents.

        :param forces: (c,) x + iy [N].
        :return: (c,) x + iy [m].
        """
        local = self.axis.conj() * forces
        moved = self.spread @ (self.ends @ self.pushed(forces))
        moved[0] += self.inside[0] @ local.real
        moved[1] += self.across @ local.imag
        return self.axis * (moved[0] + 1j * moved[1])

    def compliance(self, places: Indices) -> Array:
        """
        Return the compliance along and across, of shape (2, a, 2, a) [m/N], cached.

        :param places: (a,) of which points.
        """
        key = places.tobytes()
        if key not in self._kept:
            count, square = len(places), np.ix_(places, places)
            spread = self.spread[:, places].reshape(2 * count, len(self.ends))
            matrix = (spread @ self.ends @ spread.T).reshape(2, count, 2, count)
            matrix[0, :, 0] += self.inside[0][square]
            matrix[1, :, 1] += self.across[square]
            self._kept[key] = matrix
        return self._kept[key]

    def bend(self, displacements: Points, push: Points) -> Points:
        """
        Return the deformed centre lines, (c,) x + iy [m], without the dents of the skin.

        :param displacements: (c,) of the skin, x + iy [m].
        :param push: (c,) forces on the tubes, x + iy [N].
        """
        depths = self.dents @ (push * self.axis.conj()).imag
        return self.points + displacements - 1j * self.axis * depths


@dataclass(frozen=True, eq=False)
class ContactState:
    """
    Contact points with their forces.

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


def find_contact_points(
    structure: Structure,
    surface: Surface,
    spacing: float,
    flattening: Flattening | None = None,
    windows: Array | None = None,
    bent: BentTubes | None = None,
) -> ContactPoints:
    """
    Place contact points on the members within reach of an object.

    :param structure: the frame of the robot.
    :param surface: what the points meet: the object's own surface, or where the tubes do not
        flatten that which is farther out by half of the tube's diameter.
    :param spacing: distance of the points along the tube [m].
    :param flattening: how the tubes flatten; None for the paper's model, in which they do not.
    :param windows: (m, 2) between which points of each member, from its start, points are placed;
        everywhere if None [m].
    :param bent: the tubes, linearised about a bent state; about the straight one if None.
    """
    config, width = structure.config, 0.0 if flattening is None else flattening.radius
    topology = config.robot.topology
    start, length = config.points[topology.b], config.member_lengths
    axis = (config.points[topology.c[topology.following]] - start) / length
    away = (surface.center - start) * axis.conj()
    low, high = _reach(surface, start, axis, width, spacing)
    low, high = np.maximum(low, 0.0), np.minimum(high, length)
    if windows is not None:
        low, high = np.maximum(low, windows[:, 0]), np.minimum(high, windows[:, 1])
    # Counted from the foot of the centre, where contact begins: what is symmetric stays so.
    near, foot = np.flatnonzero(high > low), away.real
    first, last = (((end - foot) / spacing)[near] for end in (low, high))
    first, last = np.ceil(first).astype(int), np.floor(last).astype(int)
    counts = last - first + 1
    member = np.repeat(near, counts)
    number = np.arange(len(member)) - np.repeat(np.cumsum(counts) - counts - first, counts)
    place = np.clip(foot[member] + spacing * number, 0.0, length[member])
    points = points_on_members(bent or straight_tubes(structure), member, place, spacing)
    if flattening is None:
        return points
    toward = np.where(away.imag < 0.0, -1j, 1j)
    return replace(
        points,
        skin=points.points + flattening.radius * toward[member] * points.axis,
        dents=flattening.compliance(place, member, topology.tube[member], spacing),
    )


def points_on_members(
    bent: BentTubes, member: Indices, place: Array, spacing: float
) -> ContactPoints:
    """
    Return points of the centre lines at given positions.

    :param bent: the tubes, linearised.
    :param member: (c,) the member that each is on.
    :param place: (c,) distance of each from its member's start [m].
    :param spacing: length of tube that each stands for [m].
    """
    part, within, ahead = bent.locate(member, place)
    parts, which = np.unique(part, return_inverse=True)
    frame, tangent, count = bent.frame, bent.tangent, len(place)
    shapes, inside = Beams(*(each[parts] for each in frame.beams)).points(which, within)
    # The bent parts, their ends against the chords.
    ends = np.zeros((len(parts), 6))
    ends[:, 3] = tangent.stretched[0][parts]
    ends[:, 2::3] = tangent.stretched[1][parts]
    along, across, turned = np.einsum('csi,ci->sc', shapes, ends[which])
    first = frame.members.start[parts]
    begin = frame.points[first] + tangent.displacements[first] @ (1.0, 1j, 0.0)
    points = begin[which] + tangent.axis[part] * (within + along + 1j * across)
    lean = ahead * np.exp(1j * turned)
    axis = tangent.axis[part] * lean
    rows = (shapes[:, 0] + 1j * shapes[:, 1]) * lean.conj()[:, None]
    spread = np.zeros((2, count, len(parts), 6))
    spread[:, np.arange(count), which] = rows.real, rows.imag
    spread = spread.reshape(2, count, 6 * len(parts))
    response = tangent.under_end_loads(parts).ends
    left = spread @ response[:, -1]
    points = points + axis * (left[0] + 1j * left[1])
    return ContactPoints(
        points=points,
        skin=points,
        member=member,
        place=place,
        pieces=parts,
        piece=which,
        spacing=spacing,
        axis=axis,
        inside=inside,
        spread=spread,
        ends=response[:, :-1],
        dents=np.zeros((count, count)),
        bent=bent,
    )


def _reach(
    surface: Surface, start: Points, axis: Points, width: float, spacing: float
) -> tuple[Array, Array]:
    """Return the intervals of lines (m,) within reach, from their starts."""
    # A tube that gives elsewhere may come into contact beyond the chord of the object.
    away, reach = (surface.center - start) * axis.conj(), surface.reach + 2.0 * spacing
    off = np.abs(away.imag) - width
    chord = np.sqrt(np.maximum(0.0, reach**2 - np.maximum(off, 0.0) ** 2))
    low, high = away.real - chord, away.real + chord
    if not surface.shape.is_round:
        normals, distances = surface.tangents
        room = distances + 2.0 * spacing
        first, last = _clip(start - surface.center, axis, normals, room, width)
        low, high = np.maximum(low, first), np.minimum(high, last)
    return np.where(off < reach, low, np.inf), high


def _clip(
    start: Points, axis: Points, normals: Points, distances: Array, width: float
) -> tuple[Array, Array]:
    """Return the intervals of strips inside all tangents, from their starts."""
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
