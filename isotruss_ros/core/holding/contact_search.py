# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Search for the contacts of an object: all of them press, and no other corner is in a bent tube.

Each set of contacts is solved for equilibrium. The condition that is violated most proposes the
next sets: a contact in tension opens, and a corner in the skin of a tube comes into contact. The
search is depth-first, and the number of sets is bounded.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace
from typing import NamedTuple, TypeAlias

from isotruss_ros.core.holding.contacts import ANGLE, facing_lines, PressedContacts
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.overlaps import FreeCorner, SKIN_TOLERANCE
from isotruss_ros.core.manipulation.grip import CornerGap, Grip, GRIP_SIZES
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS, ROUNDING
import numpy as np

#: Largest gap of `measure_gaps` [m]. Wider gaps may close at 0.2 m/s or more, see `land_faces`.
MAX_GAP = 0.02


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
        """Return a set in which contact i was contact i of the previous equilibrium."""
        return cls(contacts, np.arange(len(contacts.members)))

    @property
    def key(self) -> tuple[object, ...]:
        """Return a hashable value that is equal for sets with the same equilibrium."""
        return *self.contacts.key, (self.origins < 0).tobytes(), self.grazing

    def without(self, dropped: int | Indices) -> ContactSet:
        """Return the set without one or more of its contacts."""
        members = np.delete(self.contacts.members, dropped)
        corners = np.delete(self.contacts.corners, dropped)
        return ContactSet(PressedContacts(members, corners), np.delete(self.origins, dropped))

    def with_contact(self, index: int, member: int, corner: int, origin: int = -1) -> ContactSet:
        """Return the set with another contact, inserted at an index."""
        members = np.insert(self.contacts.members, index, member)
        corners = np.insert(self.contacts.corners, index, corner)
        origins = np.insert(self.origins, index, origin)
        return ContactSet(PressedContacts(members, corners), origins)


#: Returns the equilibrium of a set that follows from another equilibrium (None: the first one).
ContactSolver = Callable[[ContactSet, HeldGrip | None], HeldGrip | None]
#: Search that yields sets of contacts to be solved, each with the equilibrium from which it
#: follows. The equilibrium of this set, or None, is sent to it; it returns the result.
ContactSearch: TypeAlias = Generator[
    tuple[ContactSet, HeldGrip | None], HeldGrip | None, HeldGrip | None
]


def run_search(search: ContactSearch, solve: ContactSolver) -> HeldGrip | None:
    """Return the result of a search, whose sets of contacts are solved one by one."""
    try:
        asked = next(search)
        while True:
            asked = search.send(solve(*asked))
    except StopIteration as end:
        return end.value


def search_contacts(
    contacts: PressedContacts, rolls: bool = False, limit: int = MAX_SEARCH_STEPS
) -> ContactSearch:
    """
    Search the equilibrium in which all contacts press and no other corner penetrates its member.

    At most `limit` sets are solved. If contacts roll, a third member may gain or lose contact;
    otherwise the end of a face may graze.
    """
    waiting: list[tuple[ContactSet, HeldGrip | None]] = [(ContactSet.of(contacts), None)]
    tried: set[tuple[object, ...]] = set()
    pressing: list[HeldGrip] = []
    while waiting and len(tried) < limit:
        chosen, previous = waiting.pop()
        if chosen.key in tried:
            continue
        tried.add(chosen.key)
        grip = yield chosen, previous
        if grip is None:  # without one end of a face
            face_ends = np.flatnonzero(chosen.contacts.at_faces)
            proposed = [chosen.without(k) for k in face_ends.tolist()]
        else:
            proposed = _propose_sets(grip, rolls)
        if grip is None or proposed:
            if pressing:
                continue
            # Sets wait with the equilibrium from which they follow; those with a grazing end are
            # solved last.
            origin = grip or previous
            waiting += [(item, origin) for item in proposed if item.grazing is None]
            waiting[:0] = [(item, origin) for item in proposed if item.grazing is not None]
        elif rolls:
            return grip
        else:
            # Without a history, the other sets that follow from the same equilibrium compete.
            pressing.append(grip)
            siblings = [item for item, origin in waiting if origin is previous]
            waiting = [(item, previous) for item in siblings if item.grazing is None]
    # The equilibrium nearest to the measured position.
    if len(pressing) < 2:
        return pressing[0] if pressing else None
    distances = [grip.samples.shifts[grip.number] for grip in pressing]
    return pressing[_find_least(np.array(distances), ROUNDING)]


def _find_least(values: Array, tolerance: float) -> int:
    """
    Return the index of the least value, or the first one of those within a tolerance of it.

    So a symmetric grasp, in which two values are equal, does not depend on rounding.
    """
    return int((values <= values.min() + tolerance).argmax())


def _propose_sets(grip: HeldGrip, rolls: bool) -> list[ContactSet]:
    """Return sets without the grip's largest violation, most likely last; or an empty list."""
    # A contact in tension opens. Each of two members keeps a contact; one of three may lose it.
    contacts, samples = grip.contacts, grip.samples
    forces = samples.iterate.unknowns[grip.number, samples.g.places.normal]
    may_open = contacts.at_faces | (rolls and contacts.owners[-1] > 1)
    rounding = ROUNDING * np.abs(forces).sum()
    weakest = _find_least(np.where(may_open, forces, np.inf), rounding)
    if may_open[weakest] and forces[weakest] < -rounding:
        current = ContactSet.of(contacts)
        opened = current.without(weakest)
        return [opened] if rolls else [current._replace(grazing=weakest), opened]
    least = SKIN_TOLERANCE * samples.g.structure.tube_radius
    free = [corner for corner in grip.free_corners if corner.depth > least]
    if free:
        deepest = _find_least(np.array([-corner.depth for corner in free]), ROUNDING)
        return add_corner(grip, free[deepest], rolls)
    return _add_third_member(grip) if rolls else []


def measure_gaps(held: HeldGrip, friction: float) -> Grip:
    """Return the contacts of an equilibrium as a grip, with the gaps of corners near members."""
    owners = held.contacts.owners.tolist()
    free = [corner for corner in held.free_corners if corner.depth > -MAX_GAP]
    gaps = [CornerGap(owners[c.contact], c.corner, max(-c.depth, 0.0)) for c in free]
    return replace(held.touching(friction), gaps=tuple(gaps))


def add_corner(grip: HeldGrip, free: FreeCorner, rolls: bool) -> list[ContactSet]:
    """Return the sets of contacts to which a free corner is added, the most likely set last."""
    contacts, shape, radius = grip.contacts, grip.shape, grip.samples.g.structure.tube_radius
    member = contacts.members[free.contact]
    is_on_member = contacts.members == member
    is_nearest = np.arange(len(contacts.members)) == free.contact
    other_end = np.flatnonzero(is_on_member & ~is_nearest)
    # The corner replaces the nearest contact, with the other end of the face or alone.
    corners = np.where(is_nearest, free.corner, contacts.corners)
    replaced = ContactSet.of(PressedContacts(contacts.members, corners))
    alone = replaced.without(other_end)
    if abs(free.face_distance) < radius:
        state = grip.state
        normal = complex(state.normals[free.contact] * np.exp(-1j * state.unknowns[ANGLE]))
        points = [shape.point_at(corner, normal) for corner in corners[is_on_member].tolist()]
        is_one_dent = abs(points[0] - points[-1]) < radius
        return [alone] if is_one_dent else [alone, replaced]
    # Or the corner and the nearest contact are the ends of a face; contacts are in the order of
    # their positions along the outline. If an object rolls, the corner is a new contact.
    nearest_alone = ContactSet.of(contacts).without(other_end)
    index = int(np.searchsorted(nearest_alone.origins, free.contact)) + (free.face_distance > 0.0)
    face = nearest_alone.with_contact(index, member, free.corner, -1 if rolls else free.contact)
    return [alone, face] if rolls else [face._replace(grazing=index), alone, face]


def _add_third_member(grip: HeldGrip) -> list[ContactSet]:
    """Return the set with a contact at a third member that the object penetrates; else empty."""
    if len(grip.members) >= GRIP_SIZES[-1]:
        return []
    members, every = grip.samples.depths_in_others
    depths = every[grip.number]
    if depths.max(initial=0.0) <= SKIN_TOLERANCE * grip.samples.g.structure.tube_radius:
        return []
    deepest = int(depths.argmax())
    member = int(members[deepest])
    _, normals = facing_lines(grip.config, grip.body, members)
    corner = grip.body.shape.corner_at(complex(normals[deepest]) / grip.body.turn)
    index = int(np.searchsorted(grip.contacts.members, member))
    return [ContactSet.of(grip.contacts).with_contact(index, member, corner)]
