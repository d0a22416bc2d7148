# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Candidate contact points on the centre lines of the tubes that an object can touch."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.fixed_object.straight_compliance import straight_points, StraightPoints
from isotruss_ros.core.fixed_object.surfaces import Surface
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.statics.structure import Structure
import numpy as np


class ContactPoints(NamedTuple):
    """Candidate contact points, ordered by member and by distance from the member's start."""

    points: Points  #: (c,) positions on the undeformed centre lines, x + iy [m]
    normals: Points  #: (c,) outward unit normals of the surface toward the points, x + iy
    member: Indices  #: (c,) index of the member of each point
    compliance: Array  #: (2 c, 2 c) displacements x, then y, of the points per force x, y [m/N]

    def displacements(self, forces: Points) -> Points:
        """Return the motions (c,) of the points by forces (c,), x + iy [m, N]."""
        x, y = (self.compliance @ np.concatenate([forces.real, forces.imag])).reshape(2, -1)
        return x + 1j * y

    def normal_compliance(self, normals: Points) -> Array:
        """Return the compliance (c, c) along unit normals (c,), N^T S^-1 N of (8) [m/N]."""
        count, x, y = len(normals), normals.real, normals.imag
        to_normals = self.compliance[:, :count] * x + self.compliance[:, count:] * y
        return x[:, None] * to_normals[:count] + y[:, None] * to_normals[count:]

    def part(self, chosen: Flags) -> ContactPoints:
        """Return the points that a mask (c,) chooses."""
        both = np.tile(chosen, 2)
        compliance = self.compliance[both][:, both]
        return ContactPoints(
            self.points[chosen], self.normals[chosen], self.member[chosen], compliance
        )


def find_contact_points(
    structure: Structure, surface: Surface, spacing: float
) -> tuple[ContactPoints, Array, StraightPoints]:
    """
    Return contact points, their distances (c,) from the members' starts [m], and their structure.

    Points are placed where a member may touch the surface, offset by the tube radius.
    """
    start, end = member_lines(structure.config).T
    length = np.abs(end - start)
    axis = (end - start) / length
    # The margin of two spacings is for a tube that bends and touches beyond the object's chord.
    margin, body = 2.0 * spacing, surface.body
    away = (body.middle - start) * axis.conj()
    reach = body.shape.reach + abs(body.shape.centroid) + surface.margin + margin
    chord = np.sqrt(np.maximum(0.0, reach**2 - away.imag**2))
    # Points are counted from the foot of the object's centre on the tube, where contact begins.
    # So a symmetric grasp has symmetric points.
    foot = away.real
    low, high = np.maximum(foot - chord, 0.0), np.minimum(foot + chord, length)
    near = np.flatnonzero(high > low)
    first, last = (((bound - foot) / spacing)[near] for bound in (low, high))
    first, last = np.ceil(first).astype(int), np.floor(last).astype(int)
    counts = last - first + 1
    member = np.repeat(near, counts)
    number = np.arange(len(member)) - np.repeat(np.cumsum(counts) - counts - first, counts)
    place = np.clip(foot[member] + spacing * number, 0.0, length[member])
    points = start[member] + place * axis[member]
    normals = surface.facing(points, axis[member])
    close = surface.open_gaps(points, normals) <= margin
    member, place = member[close], place[close]
    tubes = straight_points(structure, member, place)
    return ContactPoints(points[close], normals[close], member, tubes.compliance), place, tubes
