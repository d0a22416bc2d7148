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
    axis: Points  #: (c,) unit vectors along the tubes, x + iy
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
            self.points[chosen], self.axis[chosen], self.member[chosen], compliance
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
    low, high = _reach(surface, start, axis, spacing)
    low, high = np.maximum(low, 0.0), np.minimum(high, length)
    # Points are counted from the foot of the object's centre on the tube, where contact begins.
    # So a symmetric grasp has symmetric points.
    near, foot = np.flatnonzero(high > low), ((surface.center - start) * axis.conj()).real
    first, last = (((bound - foot) / spacing)[near] for bound in (low, high))
    first, last = np.ceil(first).astype(int), np.floor(last).astype(int)
    counts = last - first + 1
    member = np.repeat(near, counts)
    number = np.arange(len(member)) - np.repeat(np.cumsum(counts) - counts - first, counts)
    place = np.clip(foot[member] + spacing * number, 0.0, length[member])
    tubes = straight_points(structure, member, place)
    points = start[member] + place * axis[member]
    return ContactPoints(points, axis[member], member, tubes.compliance), place, tubes


def _reach(surface: Surface, start: Points, axis: Points, spacing: float) -> tuple[Array, Array]:
    """Return the interval of each line (m,) near the surface, as distances from its start [m]."""
    # The margin of two spacings is for a tube that bends and touches beyond the object's chord.
    away, reach = (surface.center - start) * axis.conj(), surface.reach + 2.0 * spacing
    off = np.abs(away.imag)
    chord = np.sqrt(np.maximum(0.0, reach**2 - off**2))
    low, high = away.real - chord, away.real + chord
    if not surface.shape.is_round:
        normals, distances = surface.tangents
        first, last = _clip(start - surface.center, axis, normals, distances + 2.0 * spacing)
        low, high = np.maximum(low, first), np.minimum(high, last)
    return np.where(off < reach, low, np.inf), high


def _clip(start: Points, axis: Points, normals: Points, distances: Array) -> tuple[Array, Array]:
    """Return the interval of each line (m,) inside all tangents: distances from its start [m]."""
    slope = (axis[:, None] * normals.conj()).real
    room = distances - (start[:, None] * normals.conj()).real
    with np.errstate(divide='ignore', invalid='ignore'):
        place = room / slope
    low = np.where(slope < 0.0, place, -np.inf).max(axis=1)
    high = np.where(slope > 0.0, place, np.inf).min(axis=1)
    apart = ((slope == 0.0) & (room < 0.0)).any(axis=1)
    return np.where(apart, np.inf, low), high
