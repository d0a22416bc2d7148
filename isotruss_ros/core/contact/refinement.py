# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Contact of tubes that flatten, with contact points as fine as the regions of contact need.

Forces and lengths of contact converge fast with the spacing of the points, but what friction can
balance rests on how the pressure is spread within each region: its error falls with the square of
the number of points in the smallest one. A search with few points finds the regions; the points
of the answer lie there alone, and close enough.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from isotruss_ros.core.contact.contact import estimate_contact
from isotruss_ros.core.contact.contact_points import ContactGuess, ContactPoints, ContactState
from isotruss_ros.core.contact.contact_regions import contact_extents, ContactExtents
from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.contact.place_points import find_contact_points
from isotruss_ros.core.contact.surfaces import Surface
from isotruss_ros.core.model.shapes import normalize
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.statics.structure import Structure
import numpy as np

#: Spacing of the search, and room for points to both sides of a region, over that of the answer.
SEARCH = 2.0
#: A region of contact has this many points, or the spacing is divided by the last of these.
REGION_POINTS = 10
DIVISIONS = (1, 2, 4)
#: Lengths of a region with points of one spacing and of half of it differ by less than this share.
LENGTH_SPREAD = 0.02
#: Regions are found in so many steps, or points are placed wherever tubes are within reach.
MAX_STEPS = 3
EVERYWHERE = np.array([-np.inf, np.inf])

ContactSolver = Callable[[ContactPoints, Surface, ContactGuess | None], ContactState]


class PreviousContact(NamedTuple):
    """
    The contact of a similar grasp.

    :ivar spans: where members are touched, see `GraspAnalysis.contact_spans` [m].
    :ivar member: (k,) the member that each point is on.
    :ivar place: (k,) where on it, from its start [m].
    :ivar normals: (k,) unit normals there, x + iy.
    """

    spans: Mapping[str, tuple[float, float]]
    member: Indices
    place: Array
    normals: Points


def refine_contact(
    structure: Structure,
    surface: Surface,
    spacing: float,
    flattening: Flattening,
    solver: ContactSolver,
    previous: PreviousContact | None = None,
    budget: int | None = None,
) -> tuple[ContactPoints, ContactState, ContactExtents, Indices]:
    """
    Solve the contact of tubes that flatten with points where it is.

    :param structure: the frame of the robot.
    :param surface: of the object.
    :param spacing: largest distance of the points [m].
    :param flattening: how the tubes flatten.
    :param solver: `solve_contact`, `solve_sliding_contact` or `relax_contact`.
    :param previous: contact of a similar grasp; a search finds one if None.
    :param budget: number of points up to which the spacing is divided in any case; if None it is
        divided where the shortest region needs it.
    :return: points, the contact there, how far it goes, and which of the points are the answer:
        those from one spacing before each region of contact to one behind it; without a touch,
        points of all tubes within reach.
    :raises SolverError: the contact problem was not solved.
    """
    names = structure.config.robot.member_names
    room = spacing * np.array([-1.0, 1.0])

    def place(distance: float, windows: Array | None = None) -> tuple[ContactPoints, Surface]:
        """Return points so far apart, and what such points can tell of the surface."""
        points = find_contact_points(structure, surface, distance, flattening, windows)
        return points, surface.resolved(distance)

    def solve(
        regions: Array, around: PreviousContact, limited: bool
    ) -> tuple[ContactPoints, ContactState, ContactExtents, Array, bool]:
        """Solve with points around regions, and return whether they are enough."""
        division = _division(regions, spacing, budget)
        within = limited & _touched(regions)
        windows = np.where(within, regions + SEARCH * room, EVERYWHERE)
        points, seen = place(spacing / division, windows)
        forces = _within(points, regions).astype(float)
        contact = solver(points, seen, ContactGuess(forces, _carry_over(around, points)))
        extents = contact_extents(points, contact, len(names))
        found = _regions(extents)
        # A member whose contact has left its window may be touched elsewhere.
        fits = ((found + room - windows) * room <= 0.0).all() and (_touched(found) >= within).all()
        divided = budget is not None or division == _division(found, spacing)
        enough = bool(fits) and divided
        return points, contact, extents, found, enough

    def solve_everywhere() -> tuple[ContactPoints, ContactState, ContactExtents, Indices]:
        """Solve with points of all tubes within reach."""
        points, seen = place(spacing)
        contact = solver(points, seen, None)
        extents = contact_extents(points, contact, len(names))
        return points, contact, extents, np.arange(len(points.points))

    settled = False
    if previous is not None:
        before = np.array([previous.spans.get(name, -EVERYWHERE) for name in names])
        points, contact, extents, regions, fits = solve(before, previous, limited=True)
        settled = fits and (budget is not None or _is_division_clear(regions, spacing))
    if not settled:
        points, seen = place(SEARCH * spacing)
        contact = estimate_contact(points, seen)
        regions = _regions(contact_extents(points, contact, len(names)))
        if not _touched(regions).any():
            return solve_everywhere()
    for step in range(MAX_STEPS):
        if settled:
            break
        limited = step < MAX_STEPS - 1
        around = PreviousContact({}, points.member, points.place, contact.normals)
        points, contact, extents, regions, settled = solve(regions, around, limited)
        # The search goes by tangents, which may be touched where the surface is not.
        if not len(points.points) or (budget is not None and not _touched(regions).any()):
            return solve_everywhere()
    # Whatever the search began with, the answer is the same.
    kept = np.flatnonzero(_within(points, regions + room))
    return points, contact, extents, kept


def _touched(regions: Array) -> Flags:
    """Return which members are touched, (m, 1)."""
    return regions[:, 1:] > regions[:, :1]


def _carry_over(before: PreviousContact, points: ContactPoints) -> Points:
    """Return normals at points, between those of a similar grasp on the same members."""
    # Members one after the other, so far apart that none has points among those of another.
    apart = 1.0 + max(before.place.max(initial=0.0), points.place.max(initial=0.0))
    known, wanted = before.place + apart * before.member, points.place + apart * points.member
    order = np.argsort(known)
    known, normals = known[order], before.normals[order]
    found = np.interp(wanted, known, normals.real) + 1j * np.interp(wanted, known, normals.imag)
    return normalize(found)


def _regions(extents: ContactExtents) -> Array:
    """Return where contact begins and ends on each member, (m, 2); inf, -inf without [m]."""
    return np.stack([extents.start, extents.end], axis=1)


def _division(regions: Array, spacing: float, budget: int | None = None) -> int:
    """Return by what the spacing is to be divided: for the shortest region, or within a budget."""
    length = (regions[:, 1] - regions[:, 0])[_touched(regions)[:, 0]]
    if budget is not None:
        points = (length + 2.0 * SEARCH * spacing).sum() / spacing
        return next((n for n in reversed(DIVISIONS) if n * points <= budget), DIVISIONS[0])
    shortest = length.min(initial=np.inf)
    enough = REGION_POINTS * spacing / shortest
    return next((n for n in DIVISIONS if n >= enough), DIVISIONS[-1])


def _is_division_clear(regions: Array, spacing: float) -> bool:
    """Return whether points of another spacing would find regions that need the same division."""
    shorter, longer = (
        _division((1.0 + change) * regions, spacing) for change in (-LENGTH_SPREAD, LENGTH_SPREAD)
    )
    return shorter == longer


def _within(points: ContactPoints, regions: Array) -> Flags:
    """Return which points are within the regions (m, 2) of their members."""
    first, last = regions[points.member].T
    return (points.place >= first) & (points.place <= last)
