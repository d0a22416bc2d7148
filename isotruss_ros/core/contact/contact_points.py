# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Candidate contact points on the tubes, with the compliance of the robot at these points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.contact.surfaces import Surface
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.bent_tubes import BentTubes, Displaced
from isotruss_ros.core.statics.structure import Structure
import numpy as np


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """
    Candidate contact points on the tubes, with the compliance of the robot at these points.

    The points are nodes of the frame, ordered by member and by distance from the member's start.

    Each point is in one of p pieces of tube. Its displacement is the sum of two parts: the first
    is due to the displacements of the piece's ends, the second to forces on the piece while its
    ends are fixed. The compliance is stored in these two parts, along and across the bent members.

    :ivar points: (c,) positions on the centre lines that the linearised tubes have without contact
        forces, x + iy [m].
    :ivar skin: (c,) positions on the skin, on the side of the object [m]; in the paper's model,
        equal to `points`.
    :ivar member: (c,) index of the member (pinch point to pinch point) of each point.
    :ivar place: (c,) distance of each point from its member's start [m].
    :ivar spacing: length of tube that each point represents [m].
    :ivar axis: (c,) unit vector of the bent member at each point, normal to its section, x + iy.
    :ivar inside: (2, c, 2, c) compliance of the skin along and across the tube while the ends of
        the pieces are fixed [m/N].
    :ivar spread: (2, c, 6 p) derivatives of the points' displacements along and across the tube
        with respect to the displacements of the pieces' ends.
    :ivar ends: (6 p, 6 p) compliance of the ends of the pieces [m/N].
    :ivar dents: (c, c) compliance of the skin relative to the centre line, across the tube [m/N];
        zero in the paper's model.
    :ivar bent: the linearised tubes at these points; None for points without a robot.
    """

    points: Points
    skin: Points
    member: Indices
    place: Array
    spacing: float
    axis: Points
    inside: Array
    spread: Array
    ends: Array
    dents: Array
    bent: BentTubes | None = None
    _compliances: dict[bytes, Array] = field(default_factory=dict, repr=False)
    _moves: dict[int, tuple] = field(default_factory=dict, init=False, repr=False)

    def pushed(self, push: Points) -> Array:
        """
        Return the loads (6 p,) on the ends of p tube pieces equivalent to given forces.

        :param push: (c,) forces on the points, x + iy [N].
        """
        local = self.axis.conj() * push
        return local.real @ self.spread[0] + local.imag @ self.spread[1]

    def move(self, push: Points) -> tuple[Array, Array]:
        """
        Return the nodes' displacements (n, 3) and changes of multipliers (q,) that forces cause.

        :param push: (c,) forces on the points, x + iy [N].
        """
        if id(push) not in self._moves:
            self._moves[id(push)] = push, _move(self.bent, push)
        return self._moves[id(push)][1]

    def distance(self, push: Points) -> float:
        """
        Return the largest displacement of a node from the linearised state due to forces [m].

        :param push: (c,) forces on the points, x + iy [N].
        """
        return float(np.abs(self.move(push)[0][:, :2]).max())

    def bend_on(self, push: Points, share: float = 1.0) -> BentTubes:
        """
        Return the tubes, linearised about the state that is predicted under forces on the points.

        :param push: (c,) forces on the points, x + iy [N].
        :param share: fraction of the predicted change of the state that is applied [-].
        """
        if not push.any():
            return self.bent.bent_to(None)
        moved, multipliers = (share * each for each in self.move(push))
        tangent = self.bent.tangent
        forces = tangent.forces.values + tangent.force_changes(moved[..., None])[0][..., 0]
        displaced = Displaced(
            tangent.displacements + moved,
            tangent.multipliers + multipliers,
            np.zeros((len(push), 3)),
            forces[:, 0],
        )
        return self.bent.bent_to(displaced)

    def about(self, bent: BentTubes, push: Points | None = None) -> ContactPoints:
        """
        Return the contact points on tubes that are linearised about another state.

        :param bent: the tubes linearised about the other state.
        :param push: (c,) forces on the points in that state, x + iy [N]. If they are given, the
            compliance is not computed again, and the positions without forces are extrapolated
            from those under these forces.
        """
        if push is None:
            found = points_on_members(bent, self.spacing, self.dents)
        else:
            there, axis = _line(bent, _move(bent, push)[0])
            found = replace(self, place=bent.cuts, bent=bent, axis=axis)
            give = found.bend(found.displacements(push), push) - self.points
            found = replace(found, points=there - give)
        return replace(
            found, skin=found.points + (self.skin - self.points) / self.axis * found.axis
        )

    def normal_compliance(self, normals: Points) -> Array:
        """
        Return the compliance of the skin along the normals, W = N^T (S^-1 + C) N of (8).

        S is the stiffness of the frame, and C the compliance of the dents.

        :param normals: (c,) unit normals, x + iy.
        :return: (c, c) compliance, symmetric up to rounding [m/N].
        """
        local = self.axis.conj() * normals
        along, across = local.real[:, None], local.imag[:, None]
        lever = along * self.spread[0] + across * self.spread[1]
        matrix = lever @ self.ends @ lever.T
        own = self.inside
        matrix += along * (own[0, :, 0] * along.T + own[0, :, 1] * across.T)
        matrix += across * (own[1, :, 0] * along.T + own[1, :, 1] * across.T)
        return matrix

    def displacements(self, forces: Points) -> Points:
        """
        Return the displacements of all points of the skin caused by bending and dents.

        :param forces: (c,) forces on the points, x + iy [N].
        :return: (c,) displacements, x + iy [m].
        """
        local = (self.axis.conj() * forces).view(np.float64).reshape(-1, 2).T
        moved = self.spread @ (self.ends @ self.pushed(forces))
        own = self.inside.reshape(local.size, local.size)
        moved += (own @ local.ravel()).reshape(local.shape)
        return self.axis * (moved[0] + 1j * moved[1])

    def compliance(self, places: Indices) -> Array:
        """
        Return the compliance of points along and across the tubes, (2, a, 2, a), cached [m/N].

        :param places: (a,) indices of the points.
        """
        key = places.tobytes()
        if key not in self._compliances:
            count, both = len(places), np.arange(2)
            spread = self.spread[:, places].reshape(2 * count, len(self.ends))
            matrix = (spread @ self.ends @ spread.T).reshape(2, count, 2, count)
            matrix += self.inside[np.ix_(both, places, both, places)]
            self._compliances[key] = matrix
        return self._compliances[key]

    def bend(self, displacements: Points, push: Points) -> Points:
        """
        Return points (c,) on the deformed centre lines, without dents of the skin, x + iy [m].

        :param displacements: (c,) displacements of the skin, x + iy [m].
        :param push: (c,) forces on the tubes, x + iy [N].
        """
        depths = self.dents @ (push * self.axis.conj()).imag
        return self.points + displacements - 1j * self.axis * depths


@dataclass(frozen=True, eq=False)
class ContactState:
    """
    Contact points with their forces and gaps.

    :ivar forces: (c,) normal forces, not negative [N].
    :ivar gaps: (c,) distances of the deformed tubes from the surface, not negative [m].
    :ivar normals: (c,) outward unit normals of the surface, x + iy.
    :ivar displacements: (c,) displacements of `ContactPoints.skin`, x + iy [m].
    :ivar radii: (c,) radius of curvature of the surface at its point nearest to each point [m].
    :ivar push: (c,) forces of the object on the tubes, x + iy [N].
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
    Place candidate contact points on the members that an object can touch.

    :param structure: structural model of the robot.
    :param surface: surface that the points meet. It is the object's surface, or for round tubes
        the object's surface offset by the tube radius.
    :param spacing: distance between successive points along the tube [m].
    :param flattening: local compliance of the tubes; None for the paper's model.
    :param windows: (m, 2) interval of each member in which points are placed, from the member's
        start [m]; None: the whole member.
    :param bent: tubes that are linearised about a similar bent state, possibly with other load
        points; the new points are on these bent tubes. None: straight tubes.
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
    # Points are counted from the foot of the object's centre on the tube, where contact begins.
    # So a symmetric grasp has symmetric points.
    near, foot = np.flatnonzero(high > low), away.real
    first, last = (((end - foot) / spacing)[near] for end in (low, high))
    first, last = np.ceil(first).astype(int), np.floor(last).astype(int)
    counts = last - first + 1
    member = np.repeat(near, counts)
    number = np.arange(len(member)) - np.repeat(np.cumsum(counts) - counts - first, counts)
    place = np.clip(foot[member] + spacing * number, 0.0, length[member])
    tubes = BentTubes(structure, member, place)
    tubes = tubes if bent is None else tubes.bent_like(bent)
    if flattening is None:
        return points_on_members(tubes, spacing)
    dents = flattening.compliance(place, member, topology.tube[member], spacing)
    points = points_on_members(tubes, spacing, dents)
    toward = np.where(away.imag < 0.0, -1j, 1j)
    return replace(points, skin=points.points + width * toward[member] * points.axis)


def _move(tubes: BentTubes, push: Points) -> tuple[Array, Array]:
    """Return the changes of displacements (n, 3) and multipliers (q,) that forces cause."""
    loads = np.zeros((len(tubes.frame.points), 3))
    loads[tubes.frame.nodes, 0], loads[tubes.frame.nodes, 1] = push.real, push.imag
    moved, multipliers = tubes.tangent.balance(loads.ravel())
    return moved[..., 0], multipliers[:, 0]


def _line(tubes: BentTubes, moved: Array) -> tuple[Points, Points]:
    """Return points (c,) on displaced tubes, and the directions (c,) of the tubes there."""
    tangent, nodes = tubes.tangent, tubes.frame.nodes
    there = tangent.displacements[nodes, :2] + moved[nodes, :2]
    axis = tubes.axis * np.exp(1j * tangent.displacements[nodes, 2])
    return tubes.frame.points[nodes] + there @ (1.0, 1j), axis


def points_on_members(
    tubes: BentTubes, spacing: float, dents: Array | None = None
) -> ContactPoints:
    """
    Return contact points on the centre lines at the load points of the tubes.

    :param tubes: the linearised tubes with their load points.
    :param spacing: length of tube that each point represents [m].
    :param dents: (c, c) compliance of the skin relative to the centre line [m/N]; None: zero.
    """
    frame, tangent, count = tubes.frame, tubes.tangent, len(tubes.members)
    # Responses to unit loads on the ends of pieces, and the step to the state without loads.
    ends = frame.layout.ends.ravel() if count else np.zeros(0, dtype=np.intp)
    loads = np.zeros((3 * len(frame.points), len(ends)))
    loads[ends, np.arange(len(ends))] = 1.0
    moved, _ = tangent.balance(np.zeros(len(loads)), loads)
    points, axis = _line(tubes, moved[..., -1])
    inside, spread = np.zeros((2, count, 2, count)), np.zeros((2, count, len(ends)))
    for i in range(len(ends) // 6):
        owner, slot = np.divmod(frame.layout.cut[:, 0], frame.layout.width)
        at = np.flatnonzero(owner == i)
        slot, turn = slot[at] // 3, axis[at]
        turn = np.array([[turn.real, turn.imag], [-turn.imag, turn.real]])
        most = frame.layout.width // 3 - 2
        own = tangent.cuts.inverse[i].reshape(most, 3, most, 3)[:, :2, :, :2]
        own = np.einsum('aic,cidj,bjd->acbd', turn, own[slot][:, :, slot], turn)
        inside[np.ix_([0, 1], at, [0, 1], at)] = own
        own = tangent.cuts.spread[i].reshape(-1, 3, 6)[slot, :2]
        spread.reshape(2, count, -1, 6)[:, at, i] = np.einsum('aic,cie->ace', turn, own)
    dents = np.zeros((count, count)) if dents is None else dents
    inside[1, :, 1] += dents
    return ContactPoints(
        points=points,
        skin=points,
        member=tubes.members,
        place=tubes.cuts,
        spacing=spacing,
        axis=axis,
        inside=inside,
        spread=spread,
        ends=moved.reshape(len(loads), -1)[ends, :-1],
        dents=dents,
        bent=tubes,
    )


def _reach(
    surface: Surface, start: Points, axis: Points, width: float, spacing: float
) -> tuple[Array, Array]:
    """Return the interval of each line (m,) that may touch the surface, from its start [m]."""
    # The margin of two spacings is for a tube that bends and touches beyond the object's chord.
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
    """Return the interval of each strip (m,) that is inside all tangents, from its start [m]."""
    # The edge of a strip that is farther inside a tangent decides.
    slope = (axis[:, None] * normals.conj()).real
    lean = np.abs((axis[:, None] * normals.conj()).imag)
    room = distances - (start[:, None] * normals.conj()).real + width * lean
    with np.errstate(divide='ignore', invalid='ignore'):
        place = room / slope
    low = np.where(slope < 0.0, place, -np.inf).max(axis=1)
    high = np.where(slope > 0.0, place, np.inf).min(axis=1)
    apart = ((slope == 0.0) & (room < 0.0)).any(axis=1)
    return np.where(apart, np.inf, low), high
