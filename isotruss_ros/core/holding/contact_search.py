# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Search for the contacts of an object: all of them press, and no other corner is in a bent tube.

Each set of contacts is solved for equilibrium. The condition that is violated most proposes the
next sets: a contact in tension opens, and a corner in the skin of a tube comes into contact. The
search is depth-first, and the number of sets is bounded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from isotruss_ros.core.holding.held_grip import HeldGrip, MAX_DISPLACEMENT
from isotruss_ros.core.holding.pressed_contacts import facing_lines, PressedContacts
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.manipulation.grip import GRIP_SIZES
from isotruss_ros.core.model.convex_object import ConvexObject, segment_gaps
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS, ROUNDING
import numpy as np

#: Largest depth of a corner without contact in the skin of a bent tube [m]. It covers the error
#: of the centre line between the nodes of the frame. With a third and with three times of it, 144
#: random polygons and 758 steps of rolling have the same outcomes.
SKIN_TOLERANCE = 2e-5


class ContactSet(NamedTuple):
    """Contacts whose equilibrium is to be found."""

    contacts: PressedContacts
    #: (k,) index of each contact in the previous equilibrium, also of a contact that has rolled
    #: over a face to another corner; -1 for a new contact
    origins: Indices
    #: index of a face's end that touches without force, because it would pull in contact, and
    #: penetrate the tube without; None: no such end
    grazing: int | None = None

    @classmethod
    def of(cls, contacts: PressedContacts) -> ContactSet:
        """Return the set of the contacts of the previous equilibrium, or of the first one."""
        return cls(contacts, np.arange(len(contacts.members)))

    @property
    def key(self) -> tuple[object, ...]:
        """Return a value that is equal for equal sets."""
        contacts, is_new = self.contacts, self.origins < 0
        arrays = contacts.members, contacts.corners, is_new
        return *(array.tobytes() for array in arrays), self.grazing

    def without(self, dropped: int) -> ContactSet:
        """Return the set without one of its contacts."""
        arrays = self.contacts.members, self.contacts.corners, self.origins
        members, corners, origins = (np.delete(array, dropped) for array in arrays)
        return ContactSet(PressedContacts(members, corners), origins)


class FreeCorner(NamedTuple):
    """Corner without contact that penetrates a grasping member."""

    depth: float  #: depth in the skin, or height above a contact nearer than a tube radius [m]
    contact: int  #: index of the nearest contact of the same member
    corner: int  #: index of the corner
    along: float  #: distance from this contact along the faces, counter-clockwise [m]


#: Returns the equilibrium of a set that follows from another equilibrium (None: the first one).
ContactSolver = Callable[[ContactSet, HeldGrip | None], HeldGrip | None]


def search_contacts(
    solve: ContactSolver,
    contacts: PressedContacts,
    rolls: bool = False,
    limit: int = MAX_SEARCH_STEPS,
) -> HeldGrip | None:
    """
    Return the equilibrium in which all contacts press and no other corner penetrates its member.

    At most `limit` sets are solved. If contacts roll, a third member may gain or lose contact;
    otherwise the end of a face may graze.
    """
    waiting: list[tuple[ContactSet, HeldGrip | None]] = [(ContactSet.of(contacts), None)]
    tried: set[tuple[object, ...]] = set()
    pressing: list[HeldGrip] = []
    solved = 0
    while waiting and solved < limit:
        chosen, before = waiting.pop()
        if chosen.key in tried:
            continue
        tried.add(chosen.key)
        solved += 1
        grip = solve(chosen, before)
        if grip is None:  # without one end of a face
            ends = np.flatnonzero(chosen.contacts.at_faces)
            mended = [chosen.without(k) for k in ends.tolist()]
        else:
            mended = _mend(grip, rolls)
        if grip is not None and not mended:
            pressing.append(grip)
            # Without a history, the other sets that followed from the same equilibrium compete.
            siblings = [item for item in waiting if item[1] is before and not rolls]
            waiting = [item for item in siblings if item[0].grazing is None]
        elif not pressing:
            follows = grip or before
            waiting += [(item, follows) for item in mended if item.grazing is None]
            waiting[:0] = [(item, follows) for item in mended if item.grazing is not None]
    # The nearest to the measured or previous place.
    return min(pressing, key=lambda g: abs(g.body.middle - g.statics.body.middle), default=None)


def _mend(grip: HeldGrip, rolls: bool) -> list[ContactSet]:
    """Return sets that mend the largest violation, most likely last; empty without violation."""
    contacts, normal = grip.contacts, grip.state.normal_forces
    may_open = contacts.at_faces | (rolls and contacts.owners[-1] > 1)
    least = int(np.where(may_open, normal, np.inf).argmin())
    if may_open[least] and normal[least] < -ROUNDING * np.abs(normal).sum():
        current = ContactSet.of(contacts)
        opened = current.without(least)
        return [opened] if rolls else [current._replace(grazing=least), opened]
    corner = max(free_corners(grip), default=None)
    if corner is not None:
        return with_corner(grip, corner, rolls)
    return _with_third(grip) if rolls else []


def free_corners(grip: HeldGrip, gap: float = -SKIN_TOLERANCE) -> list[FreeCorner]:
    """
    Return the corners without contact that penetrate a grasping member, or are within a gap [m].

    A corner that is nearer to a contact than a tube radius belongs to the dent of the contact; it
    penetrates the tube if it is higher than the corner in contact.
    """
    contacts, statics, body = grip.contacts, grip.statics, grip.body
    penetrating: list[FreeCorner] = []
    along = _distances_along_faces(body.shape)
    for ends in contacts.ends if len(along) else ():
        touching, straight = contacts.corners[ends], complex(statics.straight_normals[ends[0]])
        skin = ((complex(statics.bent.lines.start[ends[0]]) - body.center) / straight).real
        least = skin - (1.0 + 2.0 * MAX_DISPLACEMENT) * statics.tube_radius
        numbers = np.flatnonzero(_heights(body, np.arange(len(along) - 1), straight) > least)
        numbers = np.setdiff1d(numbers, touching)
        away = along[numbers, None] - along[touching]
        away -= along[-1] * np.round(away / along[-1])
        nearest = np.abs(away).argmin(axis=1)
        distances, beside = away[np.arange(len(numbers)), nearest], ends[nearest]
        is_near, normals = np.abs(distances) < statics.tube_radius, grip.state.normals[beside]
        higher = _heights(body, numbers, normals) - _heights(body, touching[nearest], normals)
        depths = higher
        if not is_near.all():
            members = np.full(len(numbers), contacts.members[ends[0]])
            depths = np.where(is_near, higher, skin_depths(grip, members, numbers))
        chosen = depths > np.where(is_near, SKIN_TOLERANCE, -gap)
        columns = depths, beside, numbers, distances
        penetrating += map(FreeCorner, *(values[chosen].tolist() for values in columns))
    return penetrating


def _distances_along_faces(shape: Shape) -> Array:
    """Return the distances (c + 1,) of the corners along the faces, and the sum; else empty."""
    distances, corner = [0.0], 0
    while faces := shape.faces_at(corner):
        distances.append(distances[-1] + faces[1].length)
        corner = faces[1].corner
        if corner == 0:
            return np.array(distances)
    return np.zeros(0)


def _heights(body: ConvexObject, corners: Indices, normals: Points | complex) -> Array:
    """Return the coordinates (c,) of corners along normals, from the origin of the object [m]."""
    facing = np.broadcast_to(normals / body.turn, corners.shape)
    return (_corner_points(body.shape, corners, facing) * facing.conj()).real


def _corner_points(shape: Shape, corners: Indices, normals: Points) -> Points:
    """Return the points (c,) of corners' arcs that are farthest along normals, x + iy [m]."""
    sides = [face.normal for corner in corners.tolist() for face in shape.faces_at(corner)]
    before, after = np.array(sides, dtype=np.complex128).reshape(-1, 2).T
    within = np.where((normals / after).imag > 0.0, after, normals)
    within = np.where((before / normals).imag > 0.0, before, within)
    return shape.surface_at(corners, within)[0]


def skin_depths(grip: HeldGrip, members: Indices, corners: Indices) -> Array:
    """Return the depths (c,) of corners in bent members [m]; -inf beyond the straight members."""
    body, radius = grip.body, grip.statics.tube_radius
    starts, normals = facing_lines(grip.config, body, members)
    spans = member_lines(grip.config)[members, 1] - starts
    length, axis = np.abs(spans), spans / np.abs(spans)

    def away_from(lines: Points, normals: Points) -> Points:
        points = _corner_points(body.shape, corners, normals / body.turn)
        return (body.center + body.turn * points - lines) / axis

    straight = away_from(starts, normals).real
    positions = straight
    for _ in range(2):  # the second place is at the foot on the bent line, to second order
        lines, turned = grip.bent_lines(members, positions)
        away = away_from(lines, normals * turned) / turned
        positions = positions + away.real
    depths = radius + (away * axis / normals).real
    return np.where((straight >= 0.0) & (straight <= length), depths, -np.inf)


def depths_in_others(grip: HeldGrip) -> tuple[Indices, Array]:
    """Return the other members near the object, and its depths in these bent members [m]."""
    starts, ends = member_lines(grip.config).T
    near = segment_gaps(grip.body, starts, ends)
    radius = grip.statics.tube_radius
    reach = (1.0 + 2.0 * MAX_DISPLACEMENT) * radius
    is_near = near.gaps < reach
    is_near[grip.members] = False
    members = np.flatnonzero(is_near)
    if not len(members):
        return members, np.zeros(0)
    spans, shares = (ends - starts)[members], near.shares[members]
    lines, _ = grip.bent_lines(members, shares * np.abs(spans))
    moved = lines - starts[members] - shares * spans
    return members, radius - near.gaps[members] - (moved / near.normals[members]).real


def with_corner(grip: HeldGrip, free: FreeCorner, rolls: bool) -> list[ContactSet]:
    """Return the sets with a corner in contact, the most likely set last."""
    contacts, shape, k = grip.contacts, grip.body.shape, free.contact
    radius = grip.statics.tube_radius
    normal = complex(grip.state.normals[k]) / grip.body.turn
    member, corners = contacts.members[k], contacts.corners.copy()
    corners[k] = free.corner
    owners, index = contacts.members == member, np.arange(len(contacts.members))
    kept = index[~owners | (index == k)]
    rolled = ContactSet(PressedContacts(contacts.members[kept], corners[kept]), kept)
    if abs(free.along) < radius:
        facing = [shape.point_at(corner, normal) for corner in corners[owners].tolist()]
        if abs(facing[0] - facing[-1]) < radius:
            return [rolled]
        return [rolled, ContactSet(PressedContacts(contacts.members, corners), index)]
    new = int(np.searchsorted(kept, k)) + (free.along > 0.0)
    members = np.insert(contacts.members[kept], new, member)
    corners = np.insert(contacts.corners[kept], new, free.corner)
    origins = np.insert(kept, new, -1 if rolls else k)
    pair = ContactSet(PressedContacts(members, corners), origins)
    return [rolled, pair] if rolls else [pair._replace(grazing=new), rolled, pair]


def _with_third(grip: HeldGrip) -> list[ContactSet]:
    """Return the set with a contact at a third member that the object penetrates; else empty."""
    if len(grip.members) >= GRIP_SIZES[-1]:
        return []
    members, depths = depths_in_others(grip)
    if depths.max(initial=0.0) <= SKIN_TOLERANCE:
        return []
    contacts, member = grip.contacts, members[depths.argmax()]
    normal = facing_lines(grip.config, grip.body, np.array([member]))[1][0] / grip.body.turn
    new = int(np.searchsorted(contacts.members, member))
    corner = grip.body.shape.corner_at(complex(normal))
    more = PressedContacts(
        np.insert(contacts.members, new, member), np.insert(contacts.corners, new, corner)
    )
    return [ContactSet(more, np.insert(np.arange(len(contacts.members)), new, -1))]
