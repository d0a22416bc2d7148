# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Corners of an object that penetrate grasping members without contact."""

from __future__ import annotations

from collections.abc import Sequence
import functools
import itertools
from typing import Any, NamedTuple

from isotruss_ros.core.holding.held_grip import HeldGrip, MAX_DISPLACEMENT
from isotruss_ros.core.holding.pressed_contacts import facing_lines
from isotruss_ros.core.model.object_samples import distinct_shapes, ObjectSamples
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.samples import column, take
import numpy as np

#: Largest depth of a corner without contact in the skin of a bent tube, in tube radii [-]. It
#: covers the error of the centre line between the nodes of the frame. With a third and with three
#: times of it, 144 random polygons and 758 steps of rolling have the same outcomes.
SKIN_TOLERANCE = 4e-4


class FreeCorner(NamedTuple):
    """Corner without contact near a grasping member."""

    depth: float  #: depth in the skin, or height above a contact nearer than a tube radius [m]
    contact: int  #: index of the nearest contact of the same member
    corner: int  #: index of the corner
    face_distance: float  #: distance from this contact along faces, counter-clockwise [m]


class SampledCorners(list[list[FreeCorner]]):
    """Free corners of each of n samples."""

    def take_samples(self, index: Any) -> SampledCorners:
        """Return those of chosen samples, or of one, see `samples.take`."""
        chosen = np.arange(len(self))[index]
        return SampledCorners(self[i] for i in chosen.ravel().tolist())

    def join_samples(self, others: Sequence[SampledCorners]) -> SampledCorners:
        """Return those of the samples of several, see `samples.join`."""
        return SampledCorners(itertools.chain(*others))


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


def skin_tolerance(grip: HeldGrip) -> float:
    """Return the largest depth without contact in the skin of a grip's tubes [m]."""
    return SKIN_TOLERANCE * grip.origin.statics.tube_radius


def find_free_corners(grip: HeldGrip, gap: float | None = None) -> list[FreeCorner]:
    """
    Return the corners without contact that penetrate a grasping member, or are within a gap [m].

    A corner that is nearer to a contact than a tube radius belongs to the dent of the contact; it
    penetrates the tube if it is higher than the corner in contact.
    """
    least_depth = skin_tolerance(grip) if gap is None else -gap
    corners: list[FreeCorner] = grip.value_among_samples('free_corners', _find_corners)
    return [corner for corner in corners if corner.depth > least_depth]


def _find_corners(grip: HeldGrip) -> SampledCorners:
    """Return the corners of each sample that a member may reach, if beside it or in a dent."""
    if not isinstance(grip.statics.body, ObjectSamples):
        ((shape, factors, _),) = distinct_shapes([grip.statics.body.shape])
        corners = Corners.of(shape)
        return SampledCorners(_find_similar(grip, corners, factors[0]))
    found: dict[int, list[FreeCorner]] = {}
    for shape, factors, samples in grip.statics.body.shape.distinct:
        corners = Corners.of(shape)
        if not len(corners.positions):
            found.update((i, []) for i in samples.tolist())
            continue
        group = grip if len(samples) == len(grip.wrench) else take(grip, samples)
        of_group = _find_similar(group, corners, factors[:, None])
        found.update(zip(samples.tolist(), of_group, strict=True))
    return SampledCorners(found[i] for i in range(len(found)))


def _find_similar(grip: HeldGrip, outline: Corners, factor: Array) -> list[list[FreeCorner]]:
    """Return the corners of each sample whose shape is `factor` times one with given corners."""
    lead, every = grip.state.normals.shape[:-1], np.arange(len(outline.positions))
    found: list[list[FreeCorner]] = [[] for _ in range(lead[0] if lead else 1)]
    if not len(every):
        return found
    radius, turn = grip.statics.tube_radius, column(grip.body.turn)
    tolerance = skin_tolerance(grip)

    def heights(corners: Indices, normals: Points) -> Array:
        """Return the coordinates of corners along normals, from the origin of the object [m]."""
        facing = np.broadcast_to(normals / turn, (*lead, len(corners)))
        points, _ = grip.body.shape.surface_at(corners, outline.facing(corners, facing))
        return (points * facing.conj()).real

    for contacts in grip.contacts.by_member:
        touching, first = grip.contacts.corners[contacts], int(contacts[0])
        # Corners that the tube can reach when it bends.
        normal = grip.statics.straight_normals[..., first, None]
        start = grip.statics.bent.lines.start[..., first, None]
        line_height = ((start - column(grip.body.center)) / normal).real
        least_height = line_height - (1.0 + 2.0 * MAX_DISPLACEMENT) * radius
        is_free = np.ones(len(every), dtype=bool)
        is_free[touching] = False
        free = np.flatnonzero(is_free)
        is_reached = heights(free, normal) > least_height
        chosen = np.flatnonzero(is_reached.reshape(-1, len(free)).any(axis=0))
        if not len(chosen):
            continue
        corners, is_reached = free[chosen], is_reached[..., chosen]
        # The nearest contact. Rows: corners; columns: contacts; the shorter way round.
        distances = outline.positions[corners, None] - outline.positions[touching]
        distances -= outline.circumference * np.round(distances / outline.circumference)
        nearest = np.abs(distances).argmin(axis=1)
        face_distances = factor * distances[np.arange(len(corners)), nearest]
        is_in_dent = np.abs(face_distances) < radius
        # In a dent: heights above the corner in contact. Elsewhere: depths in the skin.
        normals = grip.state.normals[..., contacts[nearest]]
        depths = heights(corners, normals) - heights(touching[nearest], normals)
        if not is_in_dent.all():
            members = np.full(len(corners), grip.contacts.members[first])
            depths = np.where(is_in_dent, depths, _skin_depths(grip, outline, members, corners))
        is_deep = is_reached & (depths > np.where(is_in_dent, tolerance, -np.inf))
        rows, columns = np.nonzero(is_deep.reshape(-1, len(corners)))
        of_corners = contacts[nearest][columns], corners[columns]
        distance = np.broadcast_to(face_distances, is_deep.shape)[is_deep]
        values = depths[is_deep], *of_corners, distance
        deep = map(FreeCorner, *(column_of.tolist() for column_of in values))
        for row, corner in zip(rows.tolist(), deep, strict=True):
            found[row].append(corner)
    return found


def _skin_depths(grip: HeldGrip, outline: Corners, members: Indices, corners: Indices) -> Array:
    """Return the depths (c,) of corners in bent members [m]; -inf beyond the straight members."""
    body, config = grip.body, grip.config
    starts, normals = facing_lines(config, body, members)
    length, axis = config.member_lengths[..., members], config.member_axes[..., members]
    center, turn = column(body.center), column(body.turn)

    def offsets(origins: Points, directions: Points) -> Points:
        """Return vectors from given origins to the corners, along + i across the members."""
        points, _ = body.shape.surface_at(corners, outline.facing(corners, directions / turn))
        return (center + turn * points - origins) / axis

    straight_positions = offsets(starts, normals).real
    positions = straight_positions
    for _ in range(2):  # the second position is at the foot on the bent line, to second order
        feet, rotations = grip.bent_lines(members, positions)
        from_feet = offsets(feet, normals * rotations) / rotations
        positions = positions + from_feet.real
    # The normals point away from the object, so heights are negative on the object's side.
    heights = (from_feet * axis / normals).real
    is_beside = (straight_positions >= 0.0) & (straight_positions <= length)
    return np.where(is_beside, grip.statics.tube_radius + heights, -np.inf)
