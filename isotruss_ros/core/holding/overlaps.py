# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Overlaps of objects with bent tubes: corners without contact, and members that do not grasp.

They decide which contacts the search tries next, and whether another member presses on an object.
"""

from __future__ import annotations

from collections.abc import Callable
import functools
from typing import Any, NamedTuple

from isotruss_ros.core.holding.contacts import facing_lines
from isotruss_ros.core.holding.equations import Grasps
from isotruss_ros.core.kinematics.depths import circle_depths, member_lines
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.samples import take
from isotruss_ros.core.statics.bent_tubes import CenterLines
import numpy as np

#: Largest depth of a corner without contact in the skin of a bent tube, in tube radii [-]. It
#: covers the error of the centre line between the nodes of the frame. With a third and with three
#: times of it, 144 random polygons and 758 steps of rolling have the same outcomes.
SKIN_TOLERANCE = 4e-4
#: Largest distance between an equilibrium and the measured pose, and largest gap of a member that
#: a motion may close, in tube diameters [-].
MAX_DISPLACEMENT = 0.25


class FreeCorner(NamedTuple):
    """Corner without contact near a grasping member."""

    depth: float  #: depth in the skin, or height above a contact nearer than a tube radius [m]
    contact: int  #: index of the nearest contact of the same member
    corner: int  #: index of the corner
    face_distance: float  #: distance from this contact along faces, counter-clockwise [m]


class Corners(NamedTuple):
    """The c corners of a shape."""

    positions: Array  #: (c,) positions along the outline [m]
    circumference: float  #: length of the outline along the corners [m]
    before: Points  #: (c,) normals of the faces before the corners
    behind: Points  #: (c,) normals of the faces behind the corners

    @classmethod
    @functools.lru_cache(maxsize=64)
    def of(cls, shape: Shape) -> Corners:
        """Return the corners of a shape; a smooth shape has none."""
        positions, normals, corner = [0.0], [], 0
        while faces := shape.faces_at(corner):
            before, behind = faces
            normals.append((before.normal, behind.normal))
            positions.append(positions[-1] + behind.length)
            corner = behind.corner
            if corner == 0:
                break
        sides = np.array(normals, dtype=np.complex128).reshape(-1, 2).T
        return cls(np.array(positions[:-1]), positions[-1], *sides)

    def facing(self, corners: Indices, normals: Points) -> Points:
        """Return normals (..., q) of corners (q,) nearest to given normals, on their arcs."""
        before, behind = self.before[corners], self.behind[corners]
        # A normal beyond the arc is replaced by that of the face at this end of the arc.
        on_arc = np.where((normals / behind).imag > 0.0, behind, normals)
        return np.where((before / normals).imag > 0.0, before, on_arc)


#: Returns bent centre lines, which take a while to find.
FindLines = Callable[[], CenterLines]


class HeldObjects(NamedTuple):
    """Objects in equilibrium at n samples of contacts, on bent tubes of one layout."""

    g: Grasps
    bodies: ObjectSamples  #: the objects at their poses in equilibrium
    normals: Points  #: (n, k) unit normals from the objects toward the tubes


def find_free_corners(at: HeldObjects, find_lines: FindLines) -> list[list[FreeCorner]]:
    """
    Return the corners of each object that a grasping member may reach, if beside it or in a dent.

    A corner that is nearer to a contact than a tube radius belongs to the dent of the contact; it
    penetrates the tube if it is higher than the corner in contact.
    """
    found: list[list[FreeCorner]] = [[] for _ in at.normals]
    for shape, factors, samples in at.bodies.shape.distinct:
        outline = Corners.of(shape)
        if not len(outline.positions):
            continue
        group, lines = at, find_lines
        if len(samples) < len(found):
            group, lines = take(at, samples), functools.partial(_take_lines, find_lines, samples)
        of_group = _find_similar(group, lines, outline, factors[:, None])
        for i, corners in zip(samples.tolist(), of_group, strict=True):
            found[i] = corners
    return found


def _take_lines(find_lines: FindLines, samples: Indices) -> CenterLines:
    """Return the bent centre lines of some of the samples."""
    return take(find_lines(), samples)


def _find_similar(
    at: HeldObjects, find_lines: FindLines, outline: Corners, factors: Array
) -> list[list[FreeCorner]]:
    """Return the corners of each object whose shape is `factors` (n, 1) times one."""
    g, contacts, radius = at.g, at.g.contacts, at.g.structure.tube_radius
    turn, every = at.bodies.turn[:, None], np.arange(len(outline.positions))
    found: list[list[FreeCorner]] = [[] for _ in turn]

    def heights(corners: Indices, normals: Points) -> Array:
        """Return the coordinates of corners along normals, from the origin of the object [m]."""
        facing = np.broadcast_to(normals / turn, (len(turn), len(corners)))
        points, _ = at.bodies.shape.surface_at(corners, outline.facing(corners, facing))
        return (points * facing.conj()).real

    for ends in contacts.by_member:
        touching, first = contacts.corners[ends], int(ends[0])
        # Corners that the tube can reach when it bends.
        normal, start = g.straight_normals[:, first, None], g.lines.start[:, first, None]
        line_height = ((start - at.bodies.center[:, None]) / normal).real
        least_height = line_height - (1.0 + 2.0 * MAX_DISPLACEMENT) * radius
        is_free = np.ones(len(every), dtype=bool)
        is_free[touching] = False
        free = np.flatnonzero(is_free)
        is_reached = heights(free, normal) > least_height
        chosen = np.flatnonzero(is_reached.any(axis=0))
        if not len(chosen):
            continue
        corners, is_reached = free[chosen], is_reached[:, chosen]
        # The nearest contact. Rows: corners; columns: contacts; the shorter way round.
        distances = outline.positions[corners, None] - outline.positions[touching]
        distances -= outline.circumference * np.round(distances / outline.circumference)
        nearest = np.abs(distances).argmin(axis=1)
        face_distances = factors * distances[np.arange(len(corners)), nearest]
        is_in_dent = np.abs(face_distances) < radius
        # In a dent: heights above the corner in contact. Elsewhere: depths in the skin.
        normals = at.normals[:, ends[nearest]]
        depths = heights(corners, normals) - heights(touching[nearest], normals)
        if not is_in_dent.all():
            members = np.full(len(corners), contacts.members[first])
            in_skin = _skin_depths(at, find_lines(), outline, members, corners)
            depths = np.where(is_in_dent, depths, in_skin)
        least = np.where(is_in_dent, SKIN_TOLERANCE * radius, -np.inf)
        rows, columns = np.nonzero(is_reached & (depths > least))
        of_corners = ends[nearest][columns], corners[columns]
        values = depths[rows, columns], *of_corners, face_distances[rows, columns]
        deep = map(FreeCorner, *(column.tolist() for column in values))
        for row, corner in zip(rows.tolist(), deep, strict=True):
            found[row].append(corner)
    return found


def _skin_depths(
    at: HeldObjects, lines: CenterLines, outline: Corners, members: Indices, corners: Indices
) -> Array:
    """Return the depths (n, c) of corners in bent members [m]; -inf beyond straight members."""
    body, config = at.bodies, at.g.structure.config
    starts, normals = facing_lines(config, body, members)
    length, axis = config.member_lengths[:, members], config.member_axes[:, members]
    center, turn = body.center[:, None], body.turn[:, None]

    def offsets(origins: Points, directions: Points) -> Points:
        """Return vectors from given origins to the corners, along + i across the members."""
        points, _ = body.shape.surface_at(corners, outline.facing(corners, directions / turn))
        return (center + turn * points - origins) / axis

    straight_positions = offsets(starts, normals).real
    positions = straight_positions
    for _ in range(2):  # the second position is at the foot on the bent line, to second order
        feet, rotations = lines.at(members, positions)
        from_feet = offsets(feet, normals * rotations) / rotations
        positions = positions + from_feet.real
    # The normals point away from the object, so heights are negative on the object's side.
    heights = (from_feet * axis / normals).real
    is_beside = (straight_positions >= 0.0) & (straight_positions <= length)
    return np.where(is_beside, at.g.structure.tube_radius + heights, -np.inf)


def find_depths_in_others(at: HeldObjects, find_lines: FindLines) -> tuple[Indices, Array]:
    """
    Return the other members (c,) near any object, and depths (n, c) in these bent members [m].

    The depth in a member that is not near the object is -inf.
    """
    config, radius = at.g.structure.config, at.g.structure.tube_radius
    # Members near the circumscribed circle of an object; all others are farther away.
    is_near = circle_depths(config, at.bodies) > -2.0 * MAX_DISPLACEMENT * radius
    is_near[:, at.g.contacts.members] = False
    members = np.flatnonzero(is_near.any(axis=0))
    if not len(members):
        return members, np.zeros((len(is_near), 0))
    starts, ends = np.moveaxis(member_lines(config)[:, members], -1, 0)
    bodies: Any = at.bodies
    gaps, normals, shares = segment_gaps(bodies, starts, ends)
    is_near = is_near[:, members] & (gaps < (1.0 + 2.0 * MAX_DISPLACEMENT) * radius)
    # Displacements of the points of the centre lines that are nearest to the object.
    to_nearest = shares * (ends - starts)
    bent_points, _ = find_lines().at(members, np.abs(to_nearest))
    displacements = bent_points - starts - to_nearest
    depths = radius - gaps - (displacements / normals).real
    near = np.flatnonzero(is_near.any(axis=0))
    return members[near], np.where(is_near, depths, -np.inf)[:, near]
